//! A DAG file's commit in virtual time is that of the machine: the same bounds by the same tests,
//! the same reasons where there is none, and the same places of DAGs.

use crate::support::{folder, succeed};
use views::protocol::{MachineLine, Transcript};

#[test]
fn the_commit_on_the_host_is_the_machines() {
    let folder = folder("same-commit");
    let examples = tool::system::workspace().join("apps/dag-file/examples");
    for (file, words) in [
        ("vision.dag", "--policy edf --cores 4"),
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
        assert_eq!(host, machine, "{file}");
    }
}
