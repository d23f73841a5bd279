//! A DAG file's commit in virtual time is that of the machine: the same bounds by the same tests,
//! the same reasons where there is none, and the same places of DAGs.

use crate::support::{folder, succeed};
use views::protocol::{MachineLine, Transcript};

#[test]
fn the_commit_on_the_host_is_the_machines() {
    let folder = folder("same-commit");
    let kept = folder.join("kept.dag");
    let text = "dag a period 10ms\nsubtask s wcet 2ms non-preemptive\n\
        dag b period 30ms\nsubtask s wcet 8ms non-preemptive\n\
        dag c period 60ms\nsubtask s wcet 13ms non-preemptive\nend\n";
    std::fs::write(&kept, text).unwrap();
    let examples = tool::system::workspace().join("apps/dag-file/examples");
    for (file, words) in [
        ("vision.dag", "--policy edf --cores 4"),
        (&*kept.to_string_lossy(), "--policy edf --cores 2"),
        ("hogs.dag", "--policy static --cores 4 --clusters auto"),
    ] {
        let run = format!(
            "run --dag {} --jobs 2 {words}",
            examples.join(file).display()
        );
        let commit = |on: &str| {
            let said = succeed(&folder, &format!("{run} --on {on}"));
            let of_commit = |line: &&MachineLine| line.kind == "dag_run" || line.kind == "dag_sink";
            let told = |line: &MachineLine| {
                let texts = ["dag", "sink", "test", "not_proven"];
                let texts = texts.map(|name| line.text_at(name).map(String::from));
                (texts, line.number_at("bound_ns"))
            };
            let lines: Vec<_> = Transcript::read(&said).machine;
            let lines: Vec<_> = lines.iter().filter(of_commit).map(told).collect();
            let is_placed = |line: &&str| line.starts_with("dag `") && line.contains("; it runs ");
            let placed: Vec<_> = said.lines().filter(is_placed).map(String::from).collect();
            (lines, placed)
        };
        let [host, machine] = ["host", "machine"].map(commit);
        assert!(!host.0.is_empty(), "{file}");
        assert_eq!(host.1.is_empty(), !words.contains("auto"), "{file}");
        // Only a certificate proves what keeps its core there.
        let tests = host.0.iter().filter_map(|(texts, _)| texts[2].as_ref());
        let by_graph = tests.filter(|test| test.contains("certificate")).count();
        assert_eq!(by_graph > 0, file.ends_with("kept.dag"), "{file}");
        assert_eq!(host, machine, "{file}");
    }
}
