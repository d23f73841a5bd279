//! The answer for DAGs whose subtasks wait, and for those next to them.

use std::slice;

use sched_dag::analysis::{
    DagBound, NotProvenReason, Overheads, SchedulabilityTest, bounds_by_test,
};
use sched_dag::{DagId, DagSpec, Policy, Preemption, Priority, Wait};

use super::simulate::{commit, spec};
use super::{DIAMOND, FP, answered, bounds, settings};

const EDF: (Policy, Preemption) = (Policy::Edf, Preemption::Enabled);

/// Lets a subtask wait, for so long at most, before a last segment.
fn waiting(mut spec: DagSpec, subtask: usize, limit_ns: u64, segment_ns: u64) -> DagSpec {
    spec.subtasks[subtask].waits.push(Wait {
        limit_ns,
        segment_ns: Some(segment_ns),
    });
    spec
}

#[test]
fn a_job_alone_has_the_least_bound_of_all_forms() {
    let one = waiting(spec(99, 99, &[1, 4, 5, 1], &DIAMOND, 0), 1, 4, 1);
    for kind in [FP, EDF, (Policy::StaticPriority, Preemption::Disabled)] {
        let on = |cores| bounds(&answered(slice::from_ref(&one), &settings(kind, cores)))[0];
        // On one core all of the work and the waits of the path.
        assert_eq!([1, 2, 4].map(on), [Some(15), Some(10), Some(10)]);
    }
}

#[test]
fn each_segment_is_charged() {
    let mut with = settings(FP, 2);
    with.overheads = Overheads {
        context_switch_ns: 2,
        dispatch_ns: 1,
        interrupt_ns: 3,
        ..Overheads::NONE
    };
    let twice = waiting(waiting(spec(100, 100, &[10], &[], 0), 0, 7, 3), 0, 5, 3);
    assert_eq!(
        bounds(&answered(slice::from_ref(&twice), &with)),
        [Some(22 + 3 * 8)]
    );
    // Any number of waits may end at once: two, of this job and of the one before.
    with.overheads.ready_ns = 1;
    assert_eq!(
        bounds(&answered(&[twice], &with)),
        [Some(22 + 3 * 8 + 1 + 2 * 2)]
    );
}

#[test]
fn longest_segments_block_and_each_wait_may_be_blocked() {
    let chain = [(0, 1), (1, 2)];
    let high = waiting(spec(100, 100, &[1, 2, 1], &chain, 0), 1, 0, 1);
    let low = waiting(spec(100, 100, &[3, 5, 2], &[], 1), 1, 9, 3);
    let kind = (Policy::StaticPriority, Preemption::Disabled);
    let answer = answered(&[high, low], &settings(kind, 2));
    let bound = answer.bounds[0].unwrap();
    let expected = (13, SchedulabilityTest::NonPreemptive);
    assert_eq!((bound.bound_ns, bound.test), expected);
}

#[test]
fn what_outranks_a_dag_that_waits_is_bounded_as_without_it() {
    let low = waiting(spec(50, 50, &[6], &[], 1), 0, 9, 3);
    let answer = answered(&[spec(20, 20, &[12], &[], 0), low], &settings(FP, 1));
    let tests = answer.bounds.iter().map(|bound| bound.unwrap().test);
    let expected = [SchedulabilityTest::Alone, SchedulabilityTest::Windows];
    assert_eq!(tests.collect::<Vec<_>>(), expected);
    // Two jobs of the other one fit into the window of all, and one into that of each segment.
    assert_eq!(bounds(&answer), [Some(12), Some(39)]);
}

#[test]
fn on_one_core_the_best_windows_of_segments_count() {
    const MS: u64 = 1_000_000;
    let high = spec(2 * MS, 2 * MS, &[MS], &[], 0);
    let low = |wcet_ns, segment_ns| {
        let low = spec(20 * MS, 20 * MS, &[wcet_ns], &[], 1);
        waiting(low, 0, 5 * MS, segment_ns)
    };
    // Of 20 ms in one window, 4 + 5 + 6; and two windows of 10 ms and 1 ns would take 17 ms.
    for (low, bound_ns) in [
        (low(5 * MS, 3 * MS), 15 * MS),
        (low(5 * MS + 1, 1), 16 * MS + 1),
    ] {
        let answer = answered(&[high.clone(), low], &settings(FP, 1));
        assert_eq!(bounds(&answer), [Some(MS), Some(bound_ns)]);
    }
}

#[test]
fn a_window_begins_behind_what_keeps_the_core() {
    let keeping = |mut spec: DagSpec| {
        spec.subtasks[0].non_preemptive = true;
        spec
    };
    let high = spec(8, 8, &[2], &[], 0);
    let chain = keeping(spec(60, 60, &[6, 4], &[(0, 1)], 1));
    let middle = waiting(chain.clone(), 1, 3, 3);
    let low = keeping(spec(90, 90, &[4], &[], 2));
    let on = |specs: &[DagSpec]| {
        let settings = settings(FP, 1);
        let by_test = bounds_by_test(&commit(specs, settings.policy, 1), &settings);
        let is_it = |bound: &&DagBound| bound.test == SchedulabilityTest::Windows;
        Some(by_test[1].iter().find(is_it)?.bound_ns)
    };
    // The first subtask may keep `high` waiting before the last segment is eligible: not 19.
    assert_eq!(on(&[high.clone(), middle.clone()]), Some(21));
    // Below it 4 may block both before and after the wait; a wait of no time lets nothing in.
    let all = [high.clone(), middle.clone(), low.clone()];
    assert_eq!(on(&all), Some(29));
    // The equations of paths give less, and count.
    assert_eq!(bounds(&answered(&all, &settings(FP, 1)))[1], Some(25));
    let at_once = waiting(chain, 1, 0, 3);
    assert_eq!(on(&[high.clone(), at_once, low.clone()]), Some(20));
    // Of a DAG above that waits a job may be carried in.
    let above = waiting(spec(6, 6, &[2], &[], 0), 0, 3, 1);
    let below = answered(&[above, spec(50, 50, &[3], &[], 1)], &settings(FP, 1));
    assert_eq!(bounds(&below), [Some(5), Some(7)]);
    // Each other DAG has to be above or below, and no priorities of a DAG interleave with these.
    let mut mixed = spec(90, 90, &[1, 1], &[], 0);
    mixed.subtasks[1].priority = Some(Priority(2));
    let waits = waiting(spec(60, 60, &[7], &[], 1), 0, 3, 1);
    let test = |other: &DagSpec| {
        let specs = [other.clone(), waits.clone()];
        answered(&specs, &settings(FP, 1)).bounds[1].map(|bound| bound.test)
    };
    assert_eq!(test(&high), Some(SchedulabilityTest::Windows));
    assert_eq!(test(&mixed), Some(SchedulabilityTest::FixedPriority));
}

#[test]
fn each_dag_without_a_bound_has_its_reason() {
    let reason = |specs: &[DagSpec], kind, cores| {
        let answer = answered(specs, &settings(kind, cores));
        (answer.reasons.last().copied().flatten(), answer)
    };
    let long = waiting(spec(10, 40, &[2], &[], 0), 0, 20, 1);
    let beyond = NotProvenReason::SpanBeyondLimit {
        span_ns: 22,
        limit_ns: 10,
    };
    assert_eq!(reason(&[long], FP, 4).0, Some(beyond));

    let high = spec(20, 20, &[12], &[], 0);
    let late = waiting(spec(30, 90, &[4], &[], 1), 0, 5, 1);
    let by_period = Some(NotProvenReason::NoBoundByPeriod);
    assert_eq!(reason(&[high.clone(), late.clone()], FP, 1).0, by_period);
    // What it may delay is held to its period, too.
    let last = spec(30, 90, &[4], &[], 2);
    let behind = Some(NotProvenReason::DelayedBy { dag: DagId(1) });
    assert_eq!(reason(&[high, late, last], FP, 1).0, behind);

    let chain = spec(10, 30, &[6, 6, 6], &[(0, 1), (1, 2)], 0);
    let below = waiting(spec(100, 100, &[2], &[], 1), 0, 20, 1);
    let (why, answer) = reason(&[chain, below], FP, 4);
    assert_eq!((why, bounds(&answer)[0]), (by_period, Some(21)));
}

#[test]
fn tests_of_whole_sets_are_not_asked() {
    // Nearly all of one core, which only its demand proves; and light DAGs that only their
    // capacity proves.
    let full = [spec(6, 6, &[3], &[], 0), spec(9, 9, &[4], &[], 0)];
    let settings = settings(EDF, 1);
    assert!(answered(&full, &settings).is_proven());
    let [first, second] = full;
    let with_wait = [first, waiting(second, 0, 0, 1)];
    assert!(!answered(&with_wait, &settings).is_proven());
}

#[test]
fn what_overlaps_is_named_where_no_dag_has_a_bound() {
    let named = |specs: &[DagSpec], kind| {
        let answer = answered(specs, &settings(kind, 4));
        let is_unknown = |bound: &Option<_>| bound.is_none();
        assert_eq!(answer.is_proven(), !answer.bounds.iter().any(is_unknown));
        let failing = answer.first_failing.unwrap();
        (failing.dag.0, failing.reason, answer.reasons)
    };
    // Each would count the other's jobs, and only the second one takes longer than it may.
    let fine = spec(3, 3, &[1], &[], 0);
    let late = waiting(spec(3, 3, &[2], &[], 0), 0, 4, 1);
    let (span_ns, limit_ns) = (6, 3);
    let beyond = NotProvenReason::SpanBeyondLimit { span_ns, limit_ns };
    let delayed = NotProvenReason::DelayedBy { dag: DagId(1) };
    assert_eq!(
        named(&[fine, late], EDF),
        (1, beyond, vec![Some(delayed), Some(beyond)])
    );
    // Jobs of the first one overlap and are in time, but the equations of waits do not count them.
    let overlapping = DagSpec {
        in_flight: Some(4),
        ..spec(5, 20, &[3, 3], &[(0, 1)], 0)
    };
    let waits = waiting(spec(100, 100, &[2], &[], 1), 0, 4, 1);
    let no_bound = NotProvenReason::NoBoundByPeriod;
    assert_eq!(
        named(&[overlapping, waits], FP),
        (1, no_bound, vec![None, Some(no_bound)])
    );
}
