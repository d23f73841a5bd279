//! Faults of numbers, and warnings about them; all faults at once.

use sched_dag::{CommitOptions, Policy, Priority, verify};

use crate::{assert_fault, assert_faults, codes, dag, drive, options, port, rejected};

#[test]
fn stacks_have_limits_and_a_wcet_the_relative_deadline() {
    for bytes in [0, (16 << 10) - 1, (1 << 20) + 1] {
        assert_fault(
            |spec| spec.subtasks[0].stack_bytes = Some(bytes),
            "stack_out_of_range",
            &format!("`camera`...{bytes} bytes...16384 to 1048576"),
        );
    }
    assert_fault(
        |spec| {
            spec.subtasks[1].wcet_ns = Some(20_000_001);
            spec.relative_deadline_ns = Some(20_000_000);
        },
        "wcet_exceeds_deadline",
        "`fuse`...20.000001ms...20ms",
    );
    assert_fault(
        |spec| spec.subtasks[1].wcet_ns = Some(51),
        "wcet_exceeds_deadline",
        "`fuse`...51ns...50ns",
    );
}

#[test]
fn times_and_counts_never_wrap() {
    assert_fault(
        |spec| spec.jobs = Some(u64::MAX / 100 + 1),
        "time_overflow",
        "last job of dag `drive`...; lower the number of jobs",
    );
    assert_fault(
        |spec| {
            spec.period_ns = Some(u64::MAX / 4);
            spec.relative_deadline_ns = Some(u64::MAX - 1);
            spec.jobs = Some(1);
            for subtask in &mut spec.subtasks {
                subtask.wcet_ns = Some(u64::MAX / 2);
            }
        },
        "time_overflow",
        "sum of the WCETs of dag `drive`",
    );
    assert_fault(
        |spec| {
            spec.period_ns = Some(1);
            spec.relative_deadline_ns = Some(u64::MAX / 2);
        },
        "too_many_instances",
        "27670116110564327424 instances...`drive` with 9223372036854775808 jobs",
    );
}

#[test]
fn all_faults_of_all_dags_are_reported_at_once() {
    let mut first = drive();
    first.period_ns = None;
    first.relative_deadline_ns = Some(0);
    first.subtasks[1].inputs[0] = port::<u8>("image");
    let second = dag("empty", vec![]);
    let rejected = rejected(&[first, second]);
    assert_eq!(
        codes(&rejected),
        [
            "missing_period",
            "zero_deadline",
            "type_mismatch",
            "no_subtasks"
        ]
    );
}

#[test]
fn priorities_are_given_to_all_subtasks_of_a_dag_or_to_none() {
    let mut spec = drive();
    spec.subtasks[1].priority = Some(Priority(3));
    assert_faults(
        &[spec.clone()],
        &[(
            "priorities_partly_given",
            "2 without priority: subtask `camera`, subtask `brake`;",
        )],
    );
    // Under EDF priorities play no part.
    assert!(verify(&[spec], &CommitOptions::new(Policy::Edf, 1)).is_ok());
}

#[test]
fn equal_priorities_and_a_wcet_of_0_are_warnings() {
    let mut spec = drive();
    for (subtask, priority) in spec.subtasks.iter_mut().zip([7, 2, 7]) {
        subtask.priority = Some(Priority(priority));
    }
    spec.subtasks[1].wcet_ns = Some(0);
    let verified = verify(&[spec], &options()).expect("only warnings");
    let texts: Vec<String> = verified.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(
        texts,
        [
            "subtask `fuse` of dag `drive` has a WCET of 0 ns; measure it, or leave the WCET out",
            "priority 7 is given 2 times: to subtask `camera` of dag `drive`, subtask `brake` of dag \
             `drive`; the order of registration decides between them",
        ]
    );
}
