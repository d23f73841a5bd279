//! Every fault of a commit: its code, and its text with offender and remedy.

mod attributes;
mod shape;
mod shared;
mod topics;

use std::any::{TypeId, type_name};

use sched_dag::{CommitOptions, DagSpec, Policy, Rejected, SubtaskSpec, TopicPort, verify};

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

/// Compares all faults, each as code and text.
#[track_caller]
fn assert_faults(specs: &[DagSpec], expected: &[(&str, &str)]) {
    let rejected = rejected(specs);
    let texts: Vec<String> = rejected.faults().iter().map(ToString::to_string).collect();
    let faults: Vec<(&str, &str)> = rejected
        .faults()
        .iter()
        .map(sched_dag::Fault::code)
        .zip(texts.iter().map(String::as_str))
        .collect();
    assert_eq!(faults, expected);
    assert_eq!(rejected.to_string(), texts.join("\n"));
}

/// Compares the only fault of `drive` after a change.
#[track_caller]
fn assert_fault(change: impl FnOnce(&mut DagSpec), code: &str, text: &str) {
    let mut spec = drive();
    change(&mut spec);
    assert_faults(&[spec], &[(code, text)]);
}
