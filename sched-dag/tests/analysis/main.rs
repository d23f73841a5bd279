//! The analysis against the scheduler: no observed response exceeds a bound.
//!
//! [`kinds`] holds bounds of random sets of every kind against virtual time. The other tests
//! are worked examples, and the counterexamples to forms that look like bounds and are not.

mod forged;
mod kinds;
mod one_core;
mod random;
mod simulate;
mod witnesses;
mod worked;

use sched_dag::analysis::{Overheads, Reason, Settings, TaskError, Test, answer, fix_orders};
use sched_dag::{
    ClusterId, Clusters, CommitOptions, ConstructionPolicy, DagId, Order, Policy, Preemption,
    SubtaskId, verify,
};

use random::{Random, sample};
use simulate::{commit, responses, spec};

const FP: (Policy, Preemption) = (Policy::StaticPriority, Preemption::Enabled);
const DIAMOND: [(usize, usize); 4] = [(0, 1), (0, 2), (1, 3), (2, 3)];

fn settings((policy, preemption): (Policy, Preemption), cores: u32) -> Settings {
    Settings {
        policy,
        preemption,
        cores,
        overheads: Overheads::default(),
    }
}

fn number_from(variable: &str, default: u64) -> u64 {
    match std::env::var(variable) {
        Ok(text) => text.parse().expect("a whole number"),
        Err(_) => default,
    }
}

/// A DAG with a WCET of 0 gets no bound, and neither does what it may delay; where
/// others have one, they keep it.
#[test]
fn no_bound_rests_on_a_wcet_of_zero() {
    let mut bounds = 0_u64;
    for seed in 1..3_000 {
        let mut random = Random::new(seed);
        let mut sample = sample(&mut random);
        let dag = usize::try_from(random.within(0, sample.specs.len() as u64 - 1)).unwrap();
        let subtasks = &mut sample.specs[dag].subtasks;
        let subtask = random.within(0, subtasks.len() as u64 - 1);
        subtasks[usize::try_from(subtask).unwrap()].wcet_ns = Some(0);
        let Some(task_set) = sample.task_set() else {
            continue;
        };
        let answer = answer(&task_set, &sample.settings());
        let subtask = SubtaskId(u32::try_from(subtask).unwrap());
        let missing = Reason::Unknown(TaskError::MissingWcet { subtask });
        assert_eq!(answer.reasons[dag], Some(missing), "seed {seed}");
        let longest = task_set.dags().iter().map(|dag| dag.period_ns()).max();
        let platform = (sample.policy, sample.preemption, sample.cores);
        let observed = responses(&task_set, platform, 12 * longest.unwrap(), |instance| {
            let subtask = task_set.dag(instance.dag).subtask(instance.subtask);
            subtask.wcet_ns().unwrap()
        });
        for (bound, observed) in answer.bounds.iter().zip(observed) {
            bounds += u64::from(bound.is_some());
            assert!(
                bound.is_none_or(|bound| observed <= bound.bound_ns),
                "seed {seed}"
            );
        }
    }
    assert!(bounds > 200, "too few bounds say little: {bounds}");
}

#[test]
fn e2_and_e3_two_dags() {
    let specs = [
        spec(10, 10, &[1, 2, 2, 1], &DIAMOND, 0),
        spec(
            20,
            20,
            &[1, 3, 3, 3, 1],
            &[(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)],
            1,
        ),
    ];
    for (policy, expected) in [(Policy::StaticPriority, [4, 14]), (Policy::Edf, [8, 14])] {
        let task_set = commit(&specs, policy, 2);
        let answer = answer(&task_set, &settings((policy, Preemption::Enabled), 2));
        let bounds: Vec<u64> = answer
            .bounds
            .iter()
            .flatten()
            .map(|bound| bound.bound_ns)
            .collect();
        // Alone, the first DAG has two paths that cover it: 4, where Graham's bound is 5.
        assert_eq!(bounds, expected, "{policy:?}");
        let wcets = [vec![1, 2, 2, 1], vec![1, 3, 3, 3, 1]];
        let observed = responses(
            &task_set,
            (policy, Preemption::Enabled, 2),
            400,
            |instance| wcets[instance.dag.index()][instance.subtask.index()],
        );
        assert!(
            observed[0] <= bounds[0] && observed[1] <= bounds[1],
            "{observed:?}"
        );
    }
}

#[test]
fn e4_blocking_is_observed_beyond_the_published_bound() {
    let fork: Vec<(usize, usize)> = (1..6).flat_map(|v| [(0, v), (v, 6)]).collect();
    let wcets = [vec![1, 3, 3, 1], vec![1, 4, 4, 4, 4, 4, 1]];
    let mut high = spec(100, 100, &wcets[0], &DIAMOND, 0);
    high.offset_ns = 2;
    let specs = [high, spec(100, 100, &wcets[1], &fork, 1)];
    let kind = (Policy::StaticPriority, Preemption::Disabled);
    let task_set = commit(&specs, kind.0, 2);
    let observed = responses(&task_set, (kind.0, kind.1, 2), 100, |instance| {
        wcets[instance.dag.index()][instance.subtask.index()]
    });
    assert_eq!(observed[0], 11);
    let bound = answer(&task_set, &settings(kind, 2)).bounds[0].unwrap();
    assert_eq!((bound.bound_ns, bound.test), (15, Test::NonPreemptive));
}

#[test]
fn pipelined_counterexamples_are_real_and_not_accepted() {
    // An earlier form claimed 8 for the second DAG.
    let mut wide = spec(100, 60, &[3; 6], &[], 1);
    wide.offset_ns = 20;
    let chain = spec(10, 30, &[6, 6, 6], &[(0, 1), (1, 2)], 0);
    let stacked = commit(&[chain, wide], FP.0, 4);
    let observed = responses(&stacked, (FP.0, FP.1, 4), 200, |instance| {
        if instance.dag.0 == 0 { 6 } else { 3 }
    });
    assert_eq!(observed[1], 9);
    let bounds = answer(&stacked, &settings(FP, 4)).bounds;
    assert!(
        bounds[1].is_some_and(|bound| bound.bound_ns >= 9),
        "{bounds:?}"
    );

    // 18 claimed; each burst leaves the second DAG 5 further behind.
    let burst = spec(1000, 1000, &[5; 4], &[], 0);
    let full = spec(10, 30, &[1, 10], &[(0, 1)], 1);
    let behind = commit(&[burst, full], FP.0, 4);
    let observed = responses(&behind, (FP.0, FP.1, 4), 3500, |instance| {
        if instance.dag.0 == 0 {
            5
        } else {
            [1, 10][instance.subtask.index()]
        }
    });
    assert!(observed[1] > 18 + 10, "{observed:?}");
    let failing = answer(&behind, &settings(FP, 4)).first_failing.unwrap();
    assert_eq!((failing.dag.0, failing.reason), (1, Reason::NoBound));
}

#[test]
fn reasons_name_the_first_failing_dag() {
    let light = spec(100, 100, &[1], &[], 0);
    let reason = |specs: &[sched_dag::DagSpec], cores| {
        let task_set = commit(specs, FP.0, cores);
        answer(&task_set, &settings(FP, cores)).first_failing
    };
    assert_eq!(reason(std::slice::from_ref(&light), 1), None);

    let mut unknown = spec(100, 100, &[1], &[], 1);
    unknown.subtasks[0].wcet_ns = None;
    let missing = reason(&[light.clone(), unknown], 1).unwrap();
    assert_eq!(missing.dag.0, 1);
    assert!(matches!(missing.reason, Reason::Unknown(_)), "{missing}");

    let heavy = spec(100, 100, &[60, 50], &[], 1);
    let overload = reason(&[light.clone(), heavy], 1).unwrap();
    assert_eq!((overload.dag.0, overload.reason), (1, Reason::Overload));

    let mut narrow = spec(10, 40, &[8, 8], &[(0, 1)], 1);
    narrow.in_flight = Some(1);
    let too_few = reason(&[light.clone(), narrow], 2).unwrap();
    assert_eq!(too_few.reason, Reason::InFlightTooFew { in_flight: 1 });

    let wide = spec(100, 20, &[10, 10, 10], &[], 1);
    let no_bound = reason(&[light.clone(), light, wide], 1).unwrap();
    assert_eq!((no_bound.dag.0, no_bound.reason), (2, Reason::NoBound));
}

#[test]
fn a_dag_without_wcets_leaves_those_that_it_cannot_delay_proven() {
    let urgent = spec(100, 100, &[10], &[], 0);
    let mut unknown = spec(100, 100, &[10], &[], 1);
    unknown.subtasks[0].wcet_ns = None;
    let lax = spec(100, 100, &[10], &[], 2);
    let specs = [urgent, unknown, lax];
    let reasons = |kind: (Policy, Preemption)| {
        let task_set = commit(&specs, kind.0, 1);
        let answer = answer(&task_set, &settings(kind, 1));
        for (bound, reason) in answer.bounds.iter().zip(&answer.reasons) {
            assert_ne!(bound.is_some(), reason.is_some());
        }
        let first = answer.first_failing.expect("one is unknown");
        assert_eq!((first.dag.0, Some(first.reason)), (1, answer.reasons[1]));
        answer.reasons
    };
    let delayed = Some(Reason::DelayedBy { dag: DagId(1) });
    let preemptive = reasons(FP);
    assert_eq!((preemptive[0], preemptive[2]), (None, delayed));
    // It may hold a core that the urgent one waits for.
    let blocked = reasons((Policy::StaticPriority, Preemption::Disabled));
    assert_eq!((blocked[0], blocked[2]), (delayed, delayed));
    let edf = reasons((Policy::Edf, Preemption::Enabled));
    assert_eq!((edf[0], edf[2]), (delayed, delayed));
}

#[test]
fn each_dag_without_a_bound_has_its_own_reason() {
    let wide = spec(100, 20, &[10, 10, 10], &[], 0);
    let behind_it = spec(100, 100, &[1], &[], 1);
    let long = spec(100, 10, &[6, 6], &[(0, 1)], 2);
    let task_set = commit(&[wide, behind_it, long], FP.0, 1);
    let answer = answer(&task_set, &settings(FP, 1));
    let length_ns = 12;
    let expected = [
        Some(Reason::NoBound),
        Some(Reason::DelayedBy { dag: DagId(0) }),
        Some(Reason::LengthBeyondDeadline { length_ns }),
    ];
    assert_eq!(answer.reasons, expected);
    // What is certain to fail comes first.
    assert_eq!(answer.first_failing.map(|failing| failing.dag.0), Some(2));
}

#[test]
fn overheads_are_charged_to_every_subtask() {
    let task_set = commit(&[spec(100, 100, &[10, 10], &[(0, 1)], 0)], FP.0, 2);
    let mut with = settings(FP, 2);
    with.overheads = Overheads {
        context_switch_ns: 2,
        dispatch_ns: 1,
        interrupt_ns: 3,
        ready_ns: 0,
    };
    assert_eq!(
        answer(&task_set, &with).bounds[0].unwrap().bound_ns,
        20 + 2 * 8
    );
}

#[test]
fn what_becomes_ready_at_once_is_charged_whatever_its_rank() {
    let fork: Vec<(usize, usize)> = (1..=18).map(|branch| (0, branch)).collect();
    let one = |priority| spec(100, 100, &[10], &[], priority);
    let on = |policy, cores, last: sched_dag::DagSpec| {
        let task_set = commit(&[one(0), last], policy, cores);
        let mut with = settings((policy, Preemption::Enabled), cores);
        with.overheads.ready_ns = 1;
        let bounds = answer(&task_set, &with).bounds;
        bounds
            .iter()
            .map(|bound| bound.map(|bound| bound.bound_ns))
            .collect::<Vec<_>>()
    };
    // Two releases, and a window begins 2 before the first may be served.
    assert_eq!(on(Policy::StaticPriority, 1, one(1)), [Some(12), Some(22)]);
    assert_eq!(on(Policy::StaticPriority, 2, one(1)), [Some(12), Some(15)]);
    // The two that a fork makes ready beyond 16, in two jobs.
    let wide = spec(100, 100, &[1; 19], &fork, 1);
    assert_eq!(on(Policy::StaticPriority, 1, wide)[0], Some(12 + 2 * 2));
}

#[test]
fn a_fixed_order_is_taken_where_it_proves_more() {
    let on = |cores, clusters: &[u32], order: Order, wcets: &[u64]| {
        let mut spec = spec(100, 100, wcets, &[], 0);
        spec.order = order;
        spec.cluster = (!clusters.is_empty()).then_some(ClusterId(0));
        // Under EDF, so that no priorities within the DAG help.
        let options = CommitOptions::new(Policy::Edf, cores)
            .with_construction(ConstructionPolicy::any_graph())
            .with_clusters(Clusters::Of(clusters.to_vec()));
        let mut task_set = verify(&[spec], &options).unwrap().task_set;
        let settings = settings((Policy::Edf, Preemption::Enabled), cores);
        fix_orders(&mut task_set, &settings);
        let added: usize = (0..)
            .map(SubtaskId)
            .take(wcets.len())
            .map(|subtask| task_set.dags()[0].successors(subtask).len())
            .sum();
        let bound = answer(&task_set, &settings).bounds[0].unwrap();
        (bound.bound_ns, added)
    };
    let bound = |order, wcets: &[u64]| on(2, &[], order, wcets);
    // Three of 2 after two of 3, on two cores: 3 + 2 + 2, in whatever order they are taken.
    let wcets = [3, 3, 2, 2, 2];
    assert_eq!(bound(Order::Free, &wcets), (8, 0));
    assert_eq!(bound(Order::Fixed, &wcets), (7, 3));
    // Made for the cores of its cluster, be there more on the machine.
    assert_eq!(on(8, &[2, 6], Order::Fixed, &wcets), (7, 3));
    // Here one job alone takes no longer anyway.
    assert_eq!(bound(Order::Fixed, &[5, 5]), (5, 0));
}
