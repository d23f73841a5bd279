//! Views of the record of a guest that has proven a DAG and run it three times.

use super::observed::ObservedDag;
use super::*;
use crate::tests::made::{commit, record_of};
use crate::tests::{altered, rows as rows_of};
use recording::{Commit, Counted, DagTimes, SubtaskTimes, Times, Writer};
use sched_dag::law::MeasuredCosts;
use std::fs;
use views::record::Record;

/// A chain of 2 and 3 ms, each charged 1 us.
const CHAIN: &str = "static 2
demo T=10000000 D=10000000 O=0 bound=5002000 hash=5: a/0/2000000 b/1/3000000; 0>1";

/// The record of that chain, with three calls of `a`; the parameters are the longest call and
/// response.
fn record(longest_ns: u64) -> Record {
    let commit = Commit {
        charge_ns: Some(1000),
        ..commit(CHAIN)
    };
    let calls = Counted {
        min_ns: 4,
        buckets: vec![(4, 1), (5, 1), (longest_ns, 1)],
    };
    let subtask = |execution: &Counted| SubtaskTimes {
        execution: execution.clone(),
        ..SubtaskTimes::default()
    };
    let mut record = Writer::begin(Vec::new());
    record.commit(&commit);
    record.times(&Times {
        written: Vec::new(),
        dags: vec![DagTimes {
            response: calls.clone(),
            subtasks: vec![subtask(&calls), subtask(&Counted::default())],
            ..DagTimes::default()
        }],
    });
    Record::read(&record.end()).unwrap()
}

fn observed(longest_ns: &[u64]) -> Vec<ObservedDag> {
    let mut all = Vec::new();
    for longest_ns in longest_ns {
        observed::add(&mut all, &record(*longest_ns)).unwrap();
    }
    all
}

fn rows_with(longest_ns: u64) -> Vec<ProofRow> {
    rows(record(9).proven().unwrap(), &observed(&[longest_ns])).unwrap()
}

#[test]
fn the_model_is_made_again_and_bounded_alike() {
    let record = record(9);
    let commits = record.proven().unwrap();
    assert_eq!(commits[0].told.dags[0].bound_ns, Some(5_002_000));
    assert_eq!(commits[0].task_set.dags()[0].name(), "demo");
    // The parts add up to the bound.
    let expected = [5_000_000, 0, 0, 0, 2_000].map(Some);
    assert_eq!(super::slack(&commits[0], DagId(0)), expected);
}

#[test]
fn another_bound_and_no_times_are_refused() {
    let mut other = record(9);
    other.commits[0].told.dags[0].bound_ns = Some(5_001_000);
    let said = other.proven().unwrap_err();
    let words = "the bound of dag `demo` in commit 0 is Some(5001000) ns";
    assert!(said.starts_with(words), "{said}");
    let refused = |record: &Record| observed::add(&mut Vec::new(), record).unwrap_err();
    assert!(refused(&Record::default()).starts_with("the guest has run no DAG"));
    let mut fewer = record(9);
    fewer.times[0].1.dags[0].subtasks.pop();
    assert_eq!(
        refused(&fewer),
        "the times of dag `demo` are not of its subtasks"
    );
}

#[test]
fn runs_of_one_graph_are_added() {
    let all = observed(&[9, 12]);
    let [dag] = &all[..] else { panic!("{all:?}") };
    assert_eq!((dag.hash, dag.longest_responses_ns[&0]), (5, 12));
    let (name, times) = &dag.subtasks[0];
    assert_eq!((name.as_str(), times.count()), ("a", 6));
    assert_eq!((times.min(), times.max()), (4, 12));
    assert_eq!((times.median(), times.p99()), (5, 12));
}

#[test]
fn a_response_above_its_bound_is_a_complaint_and_one_that_was_not_is_no_proof() {
    let within = rows_with(2_501_000);
    assert_eq!(complaint(&within), None);
    assert!(table(&within).contains("50.0 %"), "{}", table(&within));
    let words = "\"tightness_permille\":500,\"longest_path_ns\":5000000";
    assert!(within[0].line().contains(words));
    let late = rows_with(5_002_001);
    let said = complaint(&late).unwrap();
    let words = "dag `demo` of commit 0 took 5.002 ms";
    assert!(said.starts_with(words), "{said}");
    let words = "1 of 1 DAGs proven, 1 responses above a bound";
    assert_eq!(summary(&late), words);
    let not_run = rows(record(9).proven().unwrap(), &[]).unwrap_err();
    assert!(not_run.contains("has not run"), "{not_run}");
}

#[test]
fn what_is_of_one_of_several_files_or_commits_has_its_name() {
    let row = rows_with(9).remove(0).of_file("a.dag");
    let begin = "{\"kind\":\"proof\",\"file\":\"a.dag\",\"commit\":0";
    assert!(row.line().starts_with(begin));
    assert!(table(&[row]).contains("\na.dag: demo  "));
    let path = std::env::temp_dir().join(format!("witness-{}", std::process::id()));
    let first = record(9).commits.remove(0);
    let third = CommittedDags {
        number: 2,
        ..first.clone()
    };
    let said = super::write(&path, &[first, third]).unwrap();
    let (first, second) = (path.display(), format!("{}.2", path.display()));
    assert!(said.starts_with(&format!("{first} {second}: ")), "{said}");
    fs::remove_file(&path).and(fs::remove_file(second)).unwrap();
}

/// A part of a file of WCETs, its replacement, and the line and the reason of the refusal.
const WRONG: &str = r"wcet 11 | wcet 0 | 7 | a WCET of 0
wcet 11 | wect 11 | 7 | this is no record
end\n |  | 7 | the file does not end by `end`
end\n | end\nmargin 3\n | 9 | more follows after `end`
end\n | dag 5 demo\nend\n | 8 | this DAG stands here twice
end\n | wcet 1 0 a\nend\n | 8 | this subtask stands here twice
dag 5 demo\n |  | 6 | a WCET before the first DAG";

#[test]
fn wcets_that_are_written_are_read_and_have_the_margin() {
    let text = observed::text(&observed(&[9]), 20);
    let end = "margin 20\ndag 5 demo\nwcet 11 0 a\nend\n";
    assert!(text.ends_with(end), "{text}");
    let path = std::env::temp_dir().join(format!("wcets-{}", std::process::id()));
    fs::write(&path, &text).unwrap();
    assert_eq!(observed::read(&path), Ok(text.clone()));
    for [right, wrong, line, why] in rows_of(WRONG) {
        fs::write(&path, altered(&text, [&right, &wrong])).unwrap();
        let said = observed::read(&path).unwrap_err();
        let expected = format!("{}:{line}: {why}", path.display());
        assert!(said.starts_with(&expected), "{said}");
    }
    fs::remove_file(&path).unwrap();
    let said = "line 7 of the WCETs: the DAG has no such subtask; observe it again: dag `d`";
    let told = observed::translate(said, Path::new("own.wcets")).unwrap();
    let begin = "own.wcets:7: the DAG has no such";
    assert!(told.starts_with(begin), "{told}");
    let other = observed::translate("line 7 of the file", Path::new("x"));
    assert_eq!(other, None);
}

#[test]
fn the_table_of_wcets_shows_figures_and_a_histogram() {
    let table = observed::table(&observed(&[9]), 20);
    let row = table.lines().nth(2).unwrap();
    let words: Vec<&str> = row.split_whitespace().collect();
    assert_eq!(words[..6], ["a", "3", "4", "ns", "5", "ns"], "{table}");
    assert!(row.ends_with("  █ █      █"), "{table}");
}

#[test]
fn the_longest_waits_of_a_run_are_what_is_charged() {
    let events = "
        2 released c0 0.0\n 2 ready c0 0.0.0\n 5 start c0 0.0.0
        20 finish c0 0.0.0\n 20 completed c0 0.0
        101 released c0 0.1\n 101 ready c0 0.1.0\n 108 start c0 0.1.0
        120 finish c0 0.1.0\n 120 completed c0 0.1";
    let record = record_of("", &commit("edf 1\nx T=100 D=100 O=0: a/0/50"), events);
    let measured = observed::measure(&Record::read(&record).unwrap().runs).unwrap();
    let expected = MeasuredCosts {
        dispatches: 2,
        owed_ns: 7,
        releases: 2,
        late_ns: 2,
    };
    assert_eq!(measured, expected);
    let word = |margin| observed::overheads_word(&measured, margin);
    assert_eq!(
        [word(0), word(50)],
        ["overheads_ns=0,9,7,0,0,0", "overheads_ns=0,14,11,0,0,0"]
    );
    let nothing = observed::measure(&[]).unwrap_err();
    assert_eq!(nothing, "the guest has run nothing");
}
