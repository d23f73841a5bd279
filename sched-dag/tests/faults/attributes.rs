//! Faults of numbers, and warnings about them; all faults at once.

use sched_dag::{CommitOptions, Policy, Priority, verify};

use crate::{assert_fault, assert_faults, dag, drive, options, port, rejected};

#[test]
fn periods_deadlines_and_counts() {
    assert_fault(
        |spec| spec.period_ns = None,
        "missing_period",
        "dag `drive` has no period; register its source as a periodic subtask",
    );
    assert_fault(
        |spec| spec.period_ns = Some(0),
        "zero_period",
        "dag `drive` has a period of 0; give it at least 1 ns",
    );
    assert_fault(
        |spec| spec.relative_deadline_ns = None,
        "missing_deadline",
        "dag `drive` has no relative deadline; register its sink as a sink subtask with one",
    );
    assert_fault(
        |spec| spec.relative_deadline_ns = Some(0),
        "zero_deadline",
        "dag `drive` has a relative deadline of 0; give it at least 1 ns",
    );
    for bytes in [0, (16 << 10) - 1, (1 << 20) + 1] {
        assert_fault(
            |spec| spec.subtasks[0].stack_bytes = Some(bytes),
            "stack_out_of_range",
            &format!(
                "subtask `camera` of dag `drive` states a stack of {bytes} bytes; give it 16384 to \
                 1048576, or leave it out"
            ),
        );
    }
    assert_fault(
        |spec| spec.jobs = Some(0),
        "zero_jobs",
        "dag `drive` has a limit of 0 jobs; give at least 1, or no limit",
    );
    assert_fault(
        |spec| spec.in_flight = Some(0),
        "zero_in_flight",
        "dag `drive` has room for 0 jobs in flight; give at least 1, or leave it out",
    );
    assert_fault(
        |spec| {
            spec.subtasks[1].wcet_ns = Some(20_000_001);
            spec.relative_deadline_ns = Some(20_000_000);
        },
        "wcet_exceeds_deadline",
        "subtask `fuse` of dag `drive` has a WCET of 20.000001ms, longer than the relative \
         deadline of 20ms; shorten it or extend the deadline",
    );
    assert_fault(
        |spec| spec.subtasks[1].wcet_ns = Some(51),
        "wcet_exceeds_deadline",
        "subtask `fuse` of dag `drive` has a WCET of 51ns, longer than the relative deadline of 50ns; \
         shorten it or extend the deadline",
    );
}

#[test]
fn times_and_counts_never_wrap() {
    assert_fault(
        |spec| spec.offset_ns = u64::MAX - 50,
        "time_overflow",
        "the deadline of the first job of dag `drive` exceeds 18446744073709551615 ns, the last time there \
         is; lower the offset or the relative deadline",
    );
    assert_fault(
        |spec| spec.jobs = Some(u64::MAX / 100 + 1),
        "time_overflow",
        "the deadline of the last job of dag `drive` exceeds 18446744073709551615 ns, the last time there \
         is; lower the number of jobs, the period or the offset",
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
        "the sum of the WCETs of dag `drive` exceeds 18446744073709551615 ns, the last time there is; lower \
         the WCETs",
    );
    assert_fault(
        |spec| spec.in_flight = Some(u32::MAX),
        "too_many_instances",
        "the jobs in flight need 12884901885 instances, more than the limit of 1048576, and dag `drive` with \
         4294967295 jobs in flight needs most; lower its in_flight or raise the instance limit",
    );
    assert_fault(
        |spec| {
            spec.period_ns = Some(1);
            spec.relative_deadline_ns = Some(u64::MAX / 2);
        },
        "too_many_instances",
        "the jobs in flight need 27670116110564327424 instances, more than the limit of 1048576, and dag \
         `drive` with 9223372036854775808 jobs in flight needs most; lower its in_flight or raise the \
         instance limit",
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
    let codes: Vec<&str> = rejected
        .faults()
        .iter()
        .map(sched_dag::Fault::code)
        .collect();
    assert_eq!(
        codes,
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
            "dag `drive` has subtasks with and 2 without priority: subtask `camera`, subtask `brake`; give \
             each a priority, or none",
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
