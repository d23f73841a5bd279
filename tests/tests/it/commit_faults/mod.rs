//! Every existing fault is in `docs/errors.md`, with the commit's own text.
//!
//! `sched_dag::verify` itself finds the faults `fass` cannot be brought to report. A fault needing
//! 2^32 DAGs is not provoked, but made as a value.

mod cases;

use std::any::TypeId;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use cases::{CASES, GRAPHS, PERIOD, sound};
use fass::{WaitFault, finish_create_dags};
use harness::fault_page::{self, documented_faults, table};
use harness::markdown::page;
use lab::golden;
use sched_dag::analysis::{NotProvenReason, TaskError};
use sched_dag::{
    CommitOptions, DagFault, DagId, DagLabel, DagSpec, Policy, SubtaskSpec, TopicPort, verify,
};
use tool::system::workspace;

fn not_launched() -> fass::commit::CommitError {
    let machine = virtual_time::VirtualTime::new();
    finish_create_dags(&[starting("first")]).expect("the first plan is taken");
    refused(machine, starting("second")) // a machine takes one plan
}

fn wcets_refused() -> fass::commit::CommitError {
    let observed = "margin 20\ndag 1 lidar\nwcet 1200000 0 start\nend\n";
    let machine = virtual_time::VirtualTime::new().wcets(observed);
    refused(machine, starting("lidar")) // another graph has that hash
}

fn cluster_without_cores() -> fass::commit::CommitError {
    let machine = virtual_time::VirtualTime::new().cores(2).clusters(&[2, 0]);
    let dag = starting("lidar");
    dag.cluster(0);
    refused(machine, dag) // nothing can run in cluster 1
}

fn clusters_beyond_cores() -> fass::commit::CommitError {
    let machine = virtual_time::VirtualTime::new().cores(2).clusters(&[1, 2]);
    let dag = starting("lidar");
    dag.cluster(0);
    refused(machine, dag) // there are no 3 cores
}

fn no_cluster() -> fass::commit::CommitError {
    let machine = virtual_time::VirtualTime::new().cores(2).clusters(&[1, 1]);
    refused(machine, starting("lidar")) // it could run in either
}

fn affinities_overlap() -> fass::commit::CommitError {
    let _machine = virtual_time::VirtualTime::new().cores(2);
    let dags = ["lidar", "camera"].map(starting);
    dags[1].affinity(&[0]);
    finish_create_dags(&dags).expect_err("the other one may have core 0, too")
}

fn core_list() -> fass::commit::CommitError {
    let _machine = virtual_time::VirtualTime::new();
    let (dags, paper) = (
        [sound("lidar", "points")],
        fass::commit::ConstructionPolicy::paper(),
    );
    let refused = fass::commit::finish_create_dags_in_order(&dags, paper, &["core 0: lidar.read"]);
    refused.expect_err("a subtask is in no list")
}

fn not_assigned() -> fass::commit::CommitError {
    let machine = virtual_time::VirtualTime::new().cores(2).assign_clusters();
    let dag = fass::create_dag();
    dag.name("lidar").period(PERIOD).relative_deadline(PERIOD);
    for _ in 0..3 {
        let start = fass::SubtaskAttributes::default().wcet(PERIOD * 2 / 3);
        dag.register_untyped_subtask(|_job| (), start);
    }
    refused(machine, dag) // it needs 3 cores
}

fn not_fixed() -> fass::commit::CommitError {
    let machine = virtual_time::VirtualTime::new();
    machine.change(|terms| terms.certificate = Some("".into()));
    let dag = starting("lidar");
    dag.starts_paused();
    refused(machine, dag)
}

/// Makes a DAG of one subtask.
fn starting(name: &str) -> fass::Dag {
    let dag = fass::create_dag();
    dag.name(name).period(PERIOD).relative_deadline(PERIOD);
    dag.register_untyped_subtask(|_job| (), fass::SubtaskAttributes::named("start"));
    dag
}

/// Commits a DAG for a machine, and returns the machine's refusal.
fn refused(_machine: virtual_time::VirtualTime, dag: fass::Dag) -> fass::commit::CommitError {
    let any_graph = fass::commit::ConstructionPolicy::any_graph();
    fass::commit::finish_create_dags_with(&[dag], any_graph).expect_err("there is a fault")
}

/// Returns faults excluded by the types of `fass`.
fn of_the_model() -> Vec<DagFault> {
    let one = CommitOptions::new(Policy::Edf, 1);
    let topic = |number: u32| TopicPort {
        topic: format!("points {number}"),
        type_id: TypeId::of::<u32>(),
        type_name: "u32",
        can_fan_out: true,
    };
    let with = |name: &str, edges: &[(usize, usize)], outputs: u32| DagSpec {
        edges: edges.to_vec(),
        subtasks: vec![SubtaskSpec {
            name: name.into(),
            outputs: (0..outputs).map(topic).collect(),
            ..SubtaskSpec::default()
        }],
        ..lidar()
    };
    // 2^32 of them take 1 TiB: only the value is made.
    let count = 1 << 32;
    let (id, name) = (DagId(0), "lidar".into());
    let dag = DagLabel { id, name };
    [
        faults(&[lidar()], &CommitOptions::new(Policy::Edf, 0)),
        faults(&[with("", &[(0, 1)], 0)], &one),
        faults(&[with("read", &[], 17)], &one),
        vec![DagFault::TooManyDags { count }],
        vec![DagFault::TooManySubtasks { dag, count }],
    ]
    .concat()
}

fn lidar() -> DagSpec {
    DagSpec {
        name: "lidar".into(),
        ..DagSpec::default()
    }
}

fn faults(dags: &[DagSpec], options: &CommitOptions) -> Vec<DagFault> {
    let rejected = verify(dags, options).expect_err("there is a fault");
    rejected.faults().to_vec()
}

#[test]
fn every_fault_is_found_and_said_as_documented() {
    let documented = documented_faults();
    let of_the_model = of_the_model().into_iter();
    let of_the_model = of_the_model.map(|fault| (fault.code().into(), fault.to_string()));
    let mut said: BTreeMap<String, String> = of_the_model.collect();
    for refused in [
        not_launched(),
        wcets_refused(),
        cluster_without_cores(),
        clusters_beyond_cores(),
        no_cluster(),
        affinities_overlap(),
        core_list(),
        not_assigned(),
        not_fixed(),
    ] {
        said.insert(refused.faults()[0].code().into(), refused.to_string());
    }

    let machine = virtual_time::VirtualTime::new();
    let _machine = machine.policy(fass::Policy::StaticPriority);
    let graphs = GRAPHS
        .lines()
        .map(|row| row.split_once(" = ").expect("a fault's name"));
    let graphs = graphs.map(|(code, text)| (code, vec![cases::dag(text)]));
    let others = CASES.iter().map(|(code, build)| (*code, build()));
    for (code, dags) in graphs.chain(others) {
        let refused = finish_create_dags(&dags).expect_err(code);
        let fault = refused.faults().iter().find(|fault| fault.code() == code);
        let fault = fault.unwrap_or_else(|| panic!("not {code}: {refused}"));
        said.insert(code.to_string(), fault.to_string());
    }
    for (code, text) in &said {
        fault_page::assert_is(code, &documented[code], text);
    }
    // The last one needs a program of its own: `commit_without_platform.rs`.
    let mut missing: Vec<&String> = documented.keys().collect();
    missing.retain(|code| !said.contains_key(*code));
    assert_eq!(missing, ["no_platform"], "the page has what nothing says");
}

#[test]
fn every_kind_of_fault_has_an_entry() {
    let documented: BTreeSet<String> = documented_faults().into_keys().collect();
    let tables = [sched_dag::DagFault::CODES, fass::commit::Fault::CODES];
    let mut codes: BTreeSet<String> = tables.concat().into_iter().map(String::from).collect();
    // Those of a DAG's parts are named where they are found, in the file of each part.
    let folders = ["fass/src/api", "fass/src/api/device"].map(|of| workspace().join(of));
    for part in (folders.iter()).flat_map(|of| fs::read_dir(of).expect("a folder of sources")) {
        // A folder has no codes but in its files.
        let part = fs::read_to_string(part.expect("it is there").path()).unwrap_or_default();
        for call in ["add(\"", "fault(\"", "refuse_waits(\"", "code: \""] {
            let found = part.split(call).skip(1);
            codes.extend(found.filter_map(|call| Some(call.split('"').next()?.to_string())));
        }
    }
    assert_eq!(documented, codes);
}

#[test]
fn every_fault_of_a_wait_is_listed() {
    must_list("| panic | what is behind it |", WaitFault::TEXTS);
}

#[test]
fn every_text_ends_in_a_remedy() {
    for (fault, text) in documented_faults() {
        let has_remedy = text.contains("; ");
        assert!(has_remedy, "no remedy after a semicolon: {fault}: {text}");
    }
}

#[test]
fn every_reason_of_a_platform_is_listed() {
    let documented = table("| text | platform |");
    let sources = sources(&[
        "kernel/executive/src/run/execution/mod.rs",
        "kernel/executive/src/run/execution/port.rs",
        "fass/virtual-time/src/platform.rs",
        "fass/linux/src/platform.rs",
        "sched-dag/src/lifecycle/mailboxes.rs",
    ]);
    // The last file has one, of two platforms, and names no error.
    let reasons = sources.matches("LaunchError::new(").count() + 1;
    assert_eq!(reasons, documented.len(), "{documented:?}");
    all_are_in(&documented, &sources);
}

#[test]
fn every_panic_of_a_wrong_program_is_one() {
    let documented = table("| text | remedy |");
    assert!(documented.len() >= 5, "{documented:?}");
    let sources = sources(&[
        "fass/src/api/dag.rs",
        "fass/src/api/subtask.rs",
        "fass/src/api/signal.rs",
        "fass/src/api/uses.rs",
        "fass/src/api/wire.rs",
        "fass/virtual-time/src/platform.rs",
    ]);
    all_are_in(&documented, &sources);
}

#[test]
fn every_warning_is_listed() {
    let documented = table("| warning | cause | remedy |");
    let codes = sched_dag::Warning::CODES.iter();
    let codes: Vec<String> = codes.map(|code| format!("`{code}`")).collect();
    assert_eq!(documented, codes);
}

#[test]
fn every_reason_against_a_proof_is_listed() {
    let machine = virtual_time::VirtualTime::new();
    let commit = finish_create_dags(&[starting("lidar")]).expect("the DAG is sound");
    let unproven = commit.answers()[0].verdict.unproven();
    let missing = unproven.expect("it has no WCET").to_string();
    drop(machine);
    let missing = missing.replace("`start`", "{}");
    let overflows = [TaskError::VolumeOverflow, TaskError::WaitsOverflow];
    let [volume, waits] = overflows.map(|error| error.to_string());
    // The first one has the text of an error of a task, of which a commit finds others before.
    let [_, reasons @ ..] = NotProvenReason::TEXTS else {
        panic!("there are reasons")
    };
    let all = [&[&*missing], reasons, &[&*volume, &*waits]].concat();
    must_list("| text | what to do |", &all);
}

/// Compares the first column of a table with texts, with `...` for the parts in braces.
fn must_list(head: &str, texts: &[&str]) {
    let documented = table(head);
    assert_eq!(documented.len(), texts.len());
    for (documented, text) in documented.iter().zip(texts) {
        let parts = text.split('{');
        let parts = parts.map(|part| part.split_once('}').map_or(part, |(_, rest)| rest));
        let said = parts.collect::<Vec<_>>().join("...");
        golden::assert_is("docs/errors.md", head, documented, &said);
    }
}

/// Returns sources as a single text, with lines joined at a backslash inside a text.
fn sources(files: &[&str]) -> String {
    let sources: String = files.iter().map(|file| page(file)).collect();
    let lines = sources.split("\\\n").enumerate();
    let joined = lines.map(|(index, line)| match index {
        0 => line,
        _ => line.trim_start(),
    });
    joined.collect()
}

/// Checks that each part of documented texts is in the sources.
fn all_are_in(documented: &[String], sources: &str) {
    for text in documented {
        for part in text.split("...") {
            let part = part.trim();
            assert!(sources.contains(part), "nobody says `{part}`");
        }
    }
}
