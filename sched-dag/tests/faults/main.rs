//! Faults of a commit that differ from those of `docs/errors.md`, which shows one of each code
//! with its text: other limits, other offenders, several at once.

mod attributes;
mod shape;
mod topics;

use std::any::{TypeId, type_name};

use sched_dag::{CommitOptions, DagSpec, Fault, Policy, Rejected, SubtaskSpec, TopicPort, verify};

fn port<T: 'static>(topic: &str) -> TopicPort {
    TopicPort {
        topic: topic.to_owned(),
        type_id: TypeId::of::<T>(),
        type_name: type_name::<T>(),
        can_fan_out: true,
    }
}

fn subtask(name: &str, inputs: &[&str], outputs: &[&str]) -> SubtaskSpec {
    SubtaskSpec {
        name: name.to_owned(),
        inputs: inputs.iter().map(|topic| port::<u32>(topic)).collect(),
        outputs: outputs.iter().map(|topic| port::<u32>(topic)).collect(),
        ..SubtaskSpec::default()
    }
}

fn dag(name: &str, subtasks: Vec<SubtaskSpec>) -> DagSpec {
    DagSpec {
        name: name.to_owned(),
        period_ns: Some(100),
        relative_deadline_ns: Some(50),
        subtasks,
        ..DagSpec::default()
    }
}

/// camera -> fuse -> brake over the topics `image` and `obstacle`.
fn drive() -> DagSpec {
    dag(
        "drive",
        vec![
            subtask("camera", &[], &["image"]),
            subtask("fuse", &["image"], &["obstacle"]),
            subtask("brake", &["obstacle"], &[]),
        ],
    )
}

fn options() -> CommitOptions {
    CommitOptions::new(Policy::StaticPriority, 2)
}

#[track_caller]
fn rejected(specs: &[DagSpec]) -> Rejected {
    verify(specs, &options()).expect_err("the commit has a fault")
}

/// Compares all faults, each by its code and by what its text names, with `...` between.
#[track_caller]
fn assert_faults(specs: &[DagSpec], expected: &[(&str, &str)]) {
    let rejected = rejected(specs);
    assert_eq!(
        codes(&rejected),
        expected.iter().map(|(code, _)| *code).collect::<Vec<_>>()
    );
    let texts: Vec<String> = rejected.faults().iter().map(ToString::to_string).collect();
    for (text, (_, named)) in texts.iter().zip(expected) {
        let mut rest = text.as_str();
        for part in named.split("...") {
            let behind = rest.split_once(part).map(|(_, behind)| behind);
            rest = behind.unwrap_or_else(|| panic!("`{text}` does not name {named}"));
        }
    }
    assert_eq!(rejected.to_string(), texts.join("\n"));
}

fn codes(rejected: &Rejected) -> Vec<&'static str> {
    rejected.faults().iter().map(Fault::code).collect()
}

/// Compares the only fault of `drive` after a change.
#[track_caller]
fn assert_fault(change: impl FnOnce(&mut DagSpec), code: &str, named: &str) {
    let mut spec = drive();
    change(&mut spec);
    assert_faults(&[spec], &[(code, named)]);
}
