//! Apps as programs of this computer, by `run --on linux`: the lines, the verdict and the exit
//! code are those of a guest, and the trace is judged and drawn as a guest's.
//!
//! By SCHED_FIFO where the host allows it, and without preemption where it does not.

use std::fs;
use std::path::Path;

use crate::support::{call, folder, succeed};
use tool::system::workspace;
use views::protocol::{MachineLine, Transcript};
use views::record::Record;

/// Returns the numbers of machine lines of kind `fork_join`, one row a line.
fn fork_joins<const N: usize>(said: &str, members: [&str; N]) -> Vec<[Option<u64>; N]> {
    let transcript = Transcript::read(said);
    assert!(transcript.faults.is_empty(), "{:?}", transcript.faults);
    let row = |line: &MachineLine| members.map(|member| line.number_at(member));
    transcript.of_kind("fork_join").map(row).collect()
}

/// Asserts that a trace breaks no rule. The bound is for a busy host.
fn check_trace(folder: &Path, runs: usize) {
    let judged = succeed(folder, "check-trace --bound-us 5000000 trace.rec");
    let checks = Transcript::read(&judged);
    assert_eq!(checks.of_kind("trace_check").count(), runs, "{judged}");
}

#[test]
fn fork_join_says_what_it_says_on_the_machine_and_its_trace_is_judged_and_drawn() {
    let folder = folder("on-linux");
    let run =
        "run --app fork-join --on linux --subtasks 2,4 --longest 3 --jobs 10 --trace trace.rec";
    let said = succeed(&folder, run);
    let members = ["subtasks", "jobs", "joins", "violations", "allocations"];
    let expected = [[2, 10, 10, 0, 0], [4, 10, 10, 0, 0]];
    assert_eq!(
        fork_joins(&said, members),
        expected.map(|row| row.map(Some))
    );
    assert!(said.contains("N = 4: 10 jobs, 10 joins, 0 semantic violations"));
    check_trace(&folder, 2);
    succeed(&folder, "trace trace.rec -o drawing.json");
    assert!(folder.join("drawing.json").is_file());
}

#[test]
fn a_dag_file_is_run_and_drawn_with_its_cores_divided_as_on_the_machine() {
    let folder = folder("divided");
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let cases = [
        (["", ""], "--cores 1", 1),
        ([" cluster 0", " cluster 1"], "--cores 2 --clusters 1,1", 2),
        // By the commit's own division one core does each of them, too.
        (["", ""], "--cores 2 --clusters auto", 2),
    ];
    for (stated, words, cores) in cases {
        if cores > processors {
            continue;
        }
        let dags = [("a", stated[0]), ("b", stated[1])].map(|(name, cluster)| {
            format!("dag {name} period 20ms{cluster}\nsubtask a wcet 12ms\nsubtask b wcet 1ms\n")
        });
        fs::write(folder.join("divided.dag"), dags.concat() + "end\n").expect("a file of ours");
        let run = "run --on linux --jobs 5 --occupy hold --dag divided.dag --trace trace.rec";
        let said = succeed(&folder, &format!("{run} {words}"));
        let transcript = Transcript::read(&said);
        assert_eq!(transcript.of_kind("dag_run").count(), 2, "{said}");
        assert_eq!(transcript.of_kind("verdict").count(), 1, "{said}");
        let written = fs::read(folder.join("trace.rec")).expect("it was written");
        let record = Record::read(&written).expect("it is whole");
        let clusters = &record.commits[0].told.clusters[..];
        assert_eq!(clusters == [1, 1], cores > 1, "{clusters:?}");
        check_trace(&folder, 1);
    }
}

/// Only a certificate proves the set on two cores.
const KEPT: &str = "dag a period 10ms\nsubtask s wcet 2ms non-preemptive\n\
    dag b period 30ms\nsubtask s wcet 8ms non-preemptive\n\
    dag c period 60ms\nsubtask s wcet 13ms non-preemptive\nend\n";

#[test]
fn a_certificate_travels_with_its_set_and_is_made_anew_for_other_words() {
    let folder = folder("certified");
    fs::write(folder.join("kept.dag"), KEPT).expect("a file");
    let run = "run --policy edf --cores 2 --jobs 2 --dag";
    let printed = succeed(&folder, &format!("{run} kept.dag --print-dag"));
    assert!(printed.contains("\ncertificate v1 of "), "{printed}");
    fs::write(folder.join("printed.dag"), printed).expect("a file");
    // Bounds by the certificate.
    let commit = |on: &str, file: &str, word: &str| {
        let said = succeed(&folder, &format!("{run} {file} --on {on} --append {word}"));
        let transcript = Transcript::read(&said);
        let of_dag = |line: &MachineLine| {
            let test = line.text_at("test").unwrap_or_default();
            assert!(test.starts_with("a certificate of "), "{said}");
            line.number_at("bound_ns")
        };
        let bounds: Vec<_> = transcript.of_kind("dag_run").map(of_dag).collect();
        assert_eq!(bounds.len(), 3, "{said}");
        bounds
    };
    // On a busy host a run may be late.
    let bounds = commit("host", "printed.dag", "bounds=observe");
    if std::thread::available_parallelism().is_ok_and(|count| count.get() > 1) {
        assert_eq!(commit("linux", "printed.dag", "bounds=observe"), bounds);
    }
    let free = commit("host", "printed.dag", "overheads_ns=0,0,0");
    assert_eq!(commit("host", "kept.dag", "overheads_ns=0,0,0"), free);
    assert!(
        free.iter()
            .zip(&bounds)
            .all(|(free, charged)| free < charged)
    );
}

#[test]
fn what_is_wrong_has_the_exit_code_and_the_line_that_it_has_on_the_machine() {
    let rows = "\
run --app fork-join --on linux --append sed=3 | the app refused its command line: `sed` is no option; there are longest, 
run --app fork-join --on linux --cores 64 | 64 cores are asked for, and this program may use 
run --app fork-join --on linux --append mechanism=sched-ext | `mechanism=sched-ext`: allowed are fifo, sched_ext, normal
run --app faults --on linux | app `faults` has no program for Linux; these have: autoware, 
run --app gait --on linux | no recording; give one by `./scripts/run --app gait --module FILE`
run --app fork-join --on linux --mode threads | `--mode` is not for `--on linux`; leave it out, or give `--on debian`";
    for row in rows.lines() {
        let (line, says) = row.split_once(" | ").expect(row);
        let called = call(workspace(), line.split(' '));
        let said = called.complaint;
        assert_eq!(called.code, Some(2), "{line}: {said}");
        assert!(said.contains(says), "{line}: {said}");
    }
}

/// The guest's success means that the policy was there until the program's end, and no longer.
#[test]
#[ignore = "fetches 145 MB of Debian's; `cargo test -p tool --test it -- --ignored` runs it"]
fn in_a_guest_both_mechanisms_keep_the_rules() {
    let folder = folder("in-guest");
    for mechanism in ["fifo", "sched_ext"] {
        let run = "run --on debian --app fork-join --subtasks 2,4,6 --longest 5 --jobs 10 --trace \
                   trace.rec --mechanism";
        let said = succeed(&folder, &format!("{run} {mechanism}"));
        let rows = fork_joins(&said, ["joins", "violations"]);
        assert_eq!(rows, [[Some(10), Some(0)]; 3]);
        check_trace(&folder, 3);
    }
}
