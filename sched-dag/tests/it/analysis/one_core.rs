//! The tests of one core are exact: in virtual time their worst case comes.

use random::Random;
use sched_dag::analysis::{AnalysisResult, NotProvenReason, SchedulabilityTest, answer};
use sched_dag::{DagSpec, Policy, Preemption, TaskSet};

use super::simulate::{commit, responses, spec};
use super::{FP, answered, bounds, settings};

const EDF: (Policy, Preemption) = (Policy::Edf, Preemption::Enabled);
const NON_PREEMPTIVE_FP: (Policy, Preemption) = (Policy::StaticPriority, Preemption::Disabled);
const NON_PREEMPTIVE_EDF: (Policy, Preemption) = (Policy::Edf, Preemption::Disabled);

/// Draws DAGs of one subtask that are all released at once, and again after 120, and that are no
/// overload in the long run; answers, and observes the longest responses.
fn one_set(random: &mut Random, policy: Policy) -> (TaskSet, AnalysisResult, Vec<u64>) {
    const PERIODS: [u64; 10] = [4, 5, 6, 8, 10, 12, 20, 30, 60, 120];
    let count = random.within(2..=5);
    let (mut most, mut left) = (random.within(2..=8), 120);
    let specs: Vec<DagSpec> = (0..count)
        .filter_map(|priority| {
            let period = random.one_of(&PERIODS);
            most += period / 10;
            most = most.min(period * left / 120);
            let wcet = (most > 0).then(|| random.within(1..=most))?;
            left -= wcet * 120 / period;
            let latest = period * random.within(1..=3);
            let deadline = random.within(wcet..=latest);
            Some(spec(period, deadline, &[wcet], &[], priority))
        })
        .collect();
    let task_set = commit(&specs, policy, 1);
    let kind = (policy, Preemption::Enabled);
    let answer = answer(&task_set, &settings(kind, 1));
    let seen = responses(&task_set, (kind.0, kind.1, 1), 720, |instance| {
        let subtask = task_set.dag(instance.dag).subtask(instance.subtask);
        subtask.wcet_ns().expect("given")
    });
    (task_set, answer, seen)
}

#[test]
fn static_priorities_on_one_core_have_their_exact_response_times() {
    let (mut sets, mut below, mut overlapping) = (0, 0, 0);
    for seed in 1.. {
        let (task_set, answer, seen) = one_set(&mut Random::new(seed), FP.0);
        if !answer.is_proven() {
            continue;
        }
        let bounds = answer.bounds.iter().flatten();
        let bounds: Vec<u64> = bounds.map(|bound| bound.bound_ns).collect();
        assert_eq!(bounds, seen, "seed {seed}: {task_set:#?}");
        let periods = task_set.dags().iter().map(|dag| dag.period_ns());
        overlapping += u64::from(periods.zip(bounds).any(|(period, bound)| bound > period));
        let tests = answer.bounds.iter().flatten().map(|bound| bound.test);
        below += u64::from(
            tests
                .filter(|&test| test == SchedulabilityTest::OneCore)
                .count()
                > 0,
        );
        sets += 1;
        if sets == 1_000 {
            break;
        }
    }
    assert!(below > 800 && overlapping > 100, "{below}, {overlapping}");
}

#[test]
fn edf_on_one_core_is_proven_just_if_nothing_is_late() {
    let mut proven = 0;
    for seed in 1..=1_000 {
        let (task_set, answer, seen) = one_set(&mut Random::new(seed), Policy::Edf);
        let deadlines = task_set.dags().iter().map(|dag| dag.relative_deadline_ns());
        let is_met = deadlines.zip(seen).all(|(deadline, seen)| seen <= deadline);
        assert_eq!(answer.is_proven(), is_met, "seed {seed}: {task_set:#?}");
        proven += u64::from(is_met);
    }
    assert!((500..900).contains(&proven), "{proven}");
}

#[test]
fn what_a_carry_in_would_count_twice_is_proven() {
    // 4.2 of 10 ms, 43.5 of 100 and 0.1 of 100, in units of 0.1 ms.
    let dags = [(100, 42), (1000, 435), (1000, 1)];
    let specs = (0..).zip(dags);
    let specs =
        specs.map(|(priority, (period, wcet))| spec(period, period, &[wcet], &[], priority));
    let answer = answered(&specs.collect::<Vec<_>>(), &settings(FP, 1));
    assert_eq!(bounds(&answer), [Some(42), Some(771), Some(772)]);
}

/// Units of the published examples, and DAGs of one subtask, the most urgent one first.
const MS: u64 = 1_000_000;

fn sequential(dags: &[[u64; 3]]) -> Vec<DagSpec> {
    let dags = (0..).zip(dags);
    let specs = dags.map(|(priority, &[wcet_ns, period_ns, deadline_ns])| {
        spec(period_ns, deadline_ns, &[wcet_ns], &[], priority)
    });
    specs.collect()
}

/// Answers for DAGs given by WCET, period and deadline in half milliseconds.
fn published(dags: &[[u64; 3]], kind: (Policy, Preemption), cores: u32) -> AnalysisResult {
    let dags: Vec<[u64; 3]> = dags
        .iter()
        .map(|dag| dag.map(|time| time * MS / 2))
        .collect();
    answered(&sequential(&dags), &settings(kind, cores))
}

/// The bounds in half milliseconds, rounded.
fn halves(answer: &AnalysisResult) -> Vec<Option<u64>> {
    let rounded = |bound: Option<u64>| bound.map(|bound_ns| (bound_ns + MS / 4) / (MS / 2));
    bounds(answer).into_iter().map(rounded).collect()
}

#[test]
fn published_examples_of_one_core_have_their_response_times() {
    // Davis, Burns, Bril and Lukkien 2007: 2, 3 and 3.5 ms.
    let can = published(&[[2, 5, 5], [2, 7, 7], [2, 7, 7]], NON_PREEMPTIVE_FP, 1);
    assert_eq!(halves(&can), [Some(4), Some(6), Some(7)]);
    // SchedCAT's tests of Guan and Yi: 8, 11, 3 and 1, 2, 6 ms.
    for (dags, [a, b, c]) in [
        ([[4, 18, 18], [6, 24, 24], [4, 8, 8]], [16, 22, 6]),
        ([[2, 8, 8], [2, 24, 24], [6, 32, 32]], [2, 4, 12]),
    ] {
        let found = published(&dags, EDF, 1);
        assert_eq!(halves(&found), [Some(a), Some(b), Some(c)]);
    }
    // Nasri and Brandenburg 2017, figure 1a: a run on one core is late, so none may be proven.
    let dags = [[4, 20, 20], [16, 60, 60], [26, 120, 120]];
    assert!(!published(&dags, NON_PREEMPTIVE_EDF, 1).is_proven());
}

#[test]
fn published_examples_of_two_cores_have_bounds() {
    // SchedCAT's tests of Guan et al. 2009: 1, 1, 4 and, as equations close at 16, 16 ms.
    let dags = |last_due| [[2, 8, 8], [2, 10, 10], [6, 18, 18], [18, 36, last_due]];
    let found = published(&dags(36), FP, 2);
    assert_eq!(bounds(&found), [1, 1, 4, 16].map(|ms| Some(ms * MS)));
    let found = published(&dags(30), FP, 2);
    assert_eq!(halves(&found), [Some(2), Some(2), Some(8), None]);
    let bound_ns = 16 * MS;
    let late = NotProvenReason::BoundBeyondDeadline { bound_ns };
    assert_eq!(found.reasons[3], Some(late));
    // As many sequential DAGs as cores: nobody ever waits.
    for kind in [FP, EDF, NON_PREEMPTIVE_FP, NON_PREEMPTIVE_EDF] {
        let found = published(&[[2, 8, 8], [2, 10, 2]], kind, 2);
        assert_eq!(bounds(&found), [Some(MS), Some(MS)]);
        let tests = found.bounds.iter().flatten().map(|bound| bound.test);
        let widths = tests.filter(|&test| test == SchedulabilityTest::Widths);
        // Alone the first one has its length as well.
        assert!(widths.count() > usize::from(kind != FP), "{kind:?}");
    }
    // One core less than they are wide: then the second one may wait.
    let found = published(&[[2, 8, 8], [2, 10, 2]], NON_PREEMPTIVE_EDF, 1);
    assert!(!found.is_proven());
}
