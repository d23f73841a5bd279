//! What is made of the lines of a guest: of one that has proven a DAG and run it three times.

use std::fs;
use std::path::Path;

use sched_dag::DagId;
use sched_dag::law::Costs;

use super::commits::{self, Commit};
use super::observed::{self, OfDag};
use super::report::{Row, complaint, rows, summary, table};
use super::{overheads, slack, wcets, witness};
use crate::protocol::Transcript;

/// A chain of 2 and 3 ms, each charged 1 us; of `a` it says what three calls took.
const LOG: &str = r#"{"kind":"graph","commit":0,"policy":"static","preemption":"on","cores":2,"overhead_ns":[1000],"bound_ns":[5002000],"dag":0,"name":"demo","period_ns":10000000,"relative_deadline_ns":10000000,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,2000000],["b",1,0,3000000]],"edges":[[0,1]],"hash":5,"sporadic":false,"jobs":[],"topics":[],"states":[],"samples":[]}
{"kind":"times_dag","dag":0,"name":"demo","first_recorded_job":0,"response_time_ns":{"count":3,"min":4,"median":5,"p99":9,"p999":9,"max":9},"release_jitter_ns":{}}
{"kind":"times_subtask","dag":0,"subtask":0,"name":"a","join_latency_ns":{},"execution_time_ns":{"count":3,"min":4,"median":5,"p99":9,"p999":9,"max":9},"execution_histogram":[[4,1],[5,1],[9,1]]}
"#;

/// The log of a run whose longest call and response take so long.
fn log(longest: u64) -> String {
    let max = LOG.replace("\"max\":9", &format!("\"max\":{longest}"));
    max.replace("[9,1]", &format!("[{longest},1]"))
}

fn commits(log: &str) -> Vec<Commit> {
    commits::read(&Transcript::read(log)).unwrap()
}

fn observed(logs: &[String]) -> Vec<OfDag> {
    let mut all = Vec::new();
    for log in logs {
        observed::add(&mut all, &Transcript::read(log)).unwrap();
    }
    all
}

fn rows_with(longest_ns: u64) -> Vec<Row> {
    rows(&commits(LOG), &observed(&[log(longest_ns)])).unwrap()
}

#[test]
fn the_model_is_made_again_and_bounded_alike() {
    let commits = commits(LOG);
    assert_eq!(commits[0].bounds_ns, [Some(5_002_000)]);
    assert_eq!(commits[0].task_set.dags()[0].name(), "demo");
    // The parts of a bound are the bound.
    let expected = slack::Slack {
        overheads_ns: Some(2_000),
        blocking_ns: Some(0),
        interference_ns: Some(0),
        own_order_ns: Some(0),
        length_ns: Some(5_000_000),
    };
    assert_eq!(slack::of(&commits[0], DagId(0)), expected);
}

#[test]
fn another_bound_a_damaged_line_and_no_times_are_refused() {
    let refused = |log: &str| commits::read(&Transcript::read(log)).unwrap_err();
    let other = refused(&LOG.replace("5002000", "5001000"));
    let words = "dag `demo` in commit 0 is Some(5001000) ns";
    assert!(other.contains(words), "{other}");
    let damaged = refused(&LOG.replace("\"on\"", "\"maybe\""));
    let words = "serial line 1: `graph`: `preemption` is `maybe` and must be on or off";
    assert_eq!(damaged, words);
    let refused = |log: &str| observed::add(&mut Vec::new(), &Transcript::read(log)).unwrap_err();
    assert!(refused("").starts_with("the guest has run no DAG"));
    let other = refused(&LOG.replace("[9,1]", "[8,1]"));
    assert!(other.contains("a line of kind `times_subtask` is malformed"));
    let orphan = LOG.split_once('\n').map_or("", |(_, rest)| rest);
    assert!(refused(orphan).contains("serial line 1: a line of kind `times_dag`"));
}

#[test]
fn runs_of_one_graph_are_added() {
    let all = observed(&[log(9), log(12)]);
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
    let not_run = rows(&commits(LOG), &[]).unwrap_err();
    assert!(not_run.contains("has not run"), "{not_run}");
}

#[test]
fn what_is_of_one_of_several_files_or_commits_has_its_name() {
    let row = rows_with(9).remove(0).of_file("a.dag");
    let begin = "{\"kind\":\"proof\",\"file\":\"a.dag\",\"commit\":0";
    assert!(row.line().starts_with(begin));
    assert!(table(&[row]).contains("\na.dag: demo  "));
    let path = std::env::temp_dir().join(format!("witness-{}", std::process::id()));
    let two = commits(&format!("{LOG}{}", LOG.replace("commit\":0", "commit\":2")));
    let said = witness::write(&path, &two).unwrap();
    let (first, second) = (path.display(), format!("{}.2", path.display()));
    assert!(said.starts_with(&format!("{first} {second}: ")), "{said}");
    fs::remove_file(&path).and(fs::remove_file(second)).unwrap();
}

/// What stands in a file of WCETs, what is put in its place, the line and the reason of the refusal.
/// A line's end is `/`.
const WRONG: &str = "\
wcet 11 | wcet 0 | 7 | a WCET of 0
wcet 11 | wect 11 | 7 | this is no record
end/ |  | 7 | the file does not end by `end`
end/ | end/margin 3/ | 9 | more follows after `end`
end/ | dag 5 demo/end/ | 8 | this DAG stands here twice
end/ | wcet 1 0 a/end/ | 8 | this subtask stands here twice
dag 5 demo/ |  | 6 | a WCET before the first DAG";

#[test]
fn wcets_that_are_written_are_read_and_have_the_margin() {
    let text = wcets::text(&observed(&[log(9)]), 20);
    let end = "margin 20\ndag 5 demo\nwcet 11 0 a\nend\n";
    assert!(text.ends_with(end), "{text}");
    let path = std::env::temp_dir().join(format!("wcets-{}", std::process::id()));
    fs::write(&path, &text).unwrap();
    assert_eq!(wcets::read(&path), Ok(text.clone()));
    for row in WRONG.lines() {
        let row = row.replace('/', "\n");
        let [right, wrong, line, why] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        fs::write(&path, text.replace(right, wrong)).unwrap();
        let said = wcets::read(&path).unwrap_err();
        let expected = format!("{}:{line}: {why}", path.display());
        assert!(said.starts_with(&expected), "{said}");
    }
    fs::remove_file(&path).unwrap();
    let said = "line 7 of the WCETs: the DAG has no such subtask; observe it again: dag `d`";
    let told = wcets::translate(said, Path::new("own.wcets")).unwrap();
    let begin = "own.wcets:7: the DAG has no such";
    assert!(told.starts_with(begin), "{told}");
    let other = wcets::translate("line 7 of the file", Path::new("x"));
    assert_eq!(other, None);
}

#[test]
fn the_table_of_wcets_shows_figures_and_a_histogram() {
    let table = wcets::table(&observed(&[log(9)]), 20);
    let row = table.lines().nth(2).unwrap();
    let words: Vec<&str> = row.split_whitespace().collect();
    assert_eq!(words[..6], ["a", "3", "4", "ns", "5", "ns"], "{table}");
    assert!(row.ends_with("  █ █      █"), "{table}");
    assert_eq!(wcets::shown(999), "999 ns");
    assert_eq!(wcets::shown(1_500), "1.500 us");
}

#[test]
fn the_longest_waits_of_a_run_are_what_is_charged() {
    let log = r#"{"kind":"trace_begin","policy":"edf","preemption":"on","cores":1,"run":0}
{"kind":"trace_dag","dag":0,"name":"x","period_ns":100,"relative_deadline_ns":100,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,50]],"edges":[]}
{"kind":"trace","events":[[2,"released",0,0,0,-1],[2,"ready",0,0,0,0],[5,"start",0,0,0,0],[20,"finish",0,0,0,0],[20,"completed",0,0,0,-1]]}
{"kind":"trace","events":[[101,"released",0,0,1,-1],[101,"ready",0,0,1,0],[108,"start",0,0,1,0],[120,"finish",0,0,1,0],[120,"completed",0,0,1,-1]]}
{"kind":"trace_end","events":10,"lost":0,"complete":true}"#;
    let measured = overheads::measure(log).unwrap();
    let expected = Costs {
        dispatches: 2,
        owed_ns: 7,
        releases: 2,
        late_ns: 2,
    };
    assert_eq!(measured.0, expected);
    assert_eq!(measured.word(0), "overheads_ns=0,9,7");
    assert_eq!(measured.word(50), "overheads_ns=0,14,11");
    let nothing = overheads::measure("").unwrap_err();
    assert_eq!(nothing, "the guest has run nothing");
}
