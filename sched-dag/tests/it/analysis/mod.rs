//! The analysis against the scheduler: no observed response exceeds a bound.
//!
//! [`together`] holds bounds of random sets with all features against virtual time. The other tests
//! are worked examples, and the counterexamples to forms that look like bounds and are not.

mod abstraction;
mod certificates;
mod climb;
mod forged;
mod one_core;
mod proven;
mod random;
mod sharp;
mod simulate;
mod together;
mod waits;
mod witnesses;
mod worked;

use ::random::Random;
use sched_dag::analysis::{
    AnalysisResult, AnalysisSettings, NotProvenReason, Overheads, SchedulabilityTest,
    TableCondition, TableFault, TaskError, answer,
};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, OverrunPolicy, Policy, Preemption,
    SchedulerOptions, SubtaskId, verify,
};

use self::random::sample_with;
use simulate::{commit, responses, spec};

const FP: (Policy, Preemption) = (Policy::StaticPriority, Preemption::Enabled);
const DIAMOND: [(usize, usize); 4] = [(0, 1), (0, 2), (1, 3), (2, 3)];

pub(crate) fn settings((policy, preemption): (Policy, Preemption), cores: u32) -> AnalysisSettings {
    let scheduler = SchedulerOptions {
        policy,
        preemption,
        cores,
    };
    AnalysisSettings::new(scheduler, Overheads::default())
}

/// Commits DAGs of any shape, and analyses them.
fn answered(specs: &[DagSpec], settings: &AnalysisSettings) -> AnalysisResult {
    answer(&commit(specs, settings.policy, settings.cores), settings)
}

/// Does so with lists of cores, whose times follow from the WCETs with their charges, if they are
/// not stated.
fn listed(specs: &[DagSpec], lists: &[&str], settings: &AnalysisSettings) -> AnalysisResult {
    let options = CommitOptions::new(settings.policy, settings.cores)
        .with_construction(ConstructionPolicy::any_graph())
        .with_lists(lists);
    let mut task_set = verify(specs, &options)
        .expect("the lists are right")
        .task_set;
    if !lists.concat().contains('@') {
        task_set.charge_tables(settings);
    }
    answer(&task_set, settings)
}

/// Returns the bounds of all DAGs.
pub(crate) fn bounds(answer: &AnalysisResult) -> Vec<Option<u64>> {
    let bounds = answer.bounds.iter();
    bounds.map(|bound| Some((*bound)?.bound_ns)).collect()
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
    assert_eq!(
        (bound.bound_ns, bound.test),
        (15, SchedulabilityTest::NonPreemptive)
    );
}

#[test]
fn overlapping_jobs_take_more_cores() {
    // Two of the chain's jobs run for 8 of each 10: then two of four cores are left, on which
    // six subtasks of 3 take 9. An earlier form claimed 8.
    let mut wide = spec(100, 60, &[3; 6], &[], 1);
    wide.offset_ns = 20;
    let chain = spec(10, 30, &[6, 6, 6], &[(0, 1), (1, 2)], 0);
    let stacked = commit(&[chain, wide], FP.0, 4);
    let observed = responses(&stacked, (FP.0, FP.1, 4), 200, |instance| {
        if instance.dag.0 == 0 { 6 } else { 3 }
    });
    assert_eq!(observed[1], 9);
    let bound = bounds(&answer(&stacked, &settings(FP, 4)))[1];
    assert!(bound >= Some(9), "{bound:?}");
}

#[test]
fn delays_that_are_handed_on_count() {
    // Once a period of 1000 all four cores are busy for 5, and each time the second DAG's long
    // subtask falls behind by 5. Without slack it never catches up. An earlier form claimed 18.
    let with = |long_ns: u64| {
        let burst = spec(1000, 1000, &[5; 4], &[], 0);
        let behind = spec(10, 30, &[1, long_ns], &[(0, 1)], 1);
        let task_set = commit(&[burst, behind], FP.0, 4);
        let observed = responses(&task_set, (FP.0, FP.1, 4), 3500, |instance| {
            [[5; 4], [1, long_ns, 0, 0]][instance.dag.index()][instance.subtask.index()]
        });
        (observed[1], answer(&task_set, &settings(FP, 4)))
    };
    let (observed, full) = with(10);
    assert!(observed > 18 + 10, "{observed}");
    let failing = full.first_failing.unwrap();
    assert_eq!(
        (failing.dag.0, failing.reason),
        (1, NotProvenReason::NoBound)
    );
    assert!(with(9).1.is_proven());
}

#[test]
fn each_dag_without_a_bound_has_its_reason_and_the_surest_one_is_the_first() {
    let one = |priority| spec(100, 100, &[10], &[], priority);
    let wide = |priority| spec(100, 20, &[10, 10, 10], &[], priority);
    let heavy = spec(100, 100, &[60, 50], &[], 1);
    let long = spec(100, 10, &[6, 6], &[(0, 1)], 2);
    let mut unknown = one(1);
    unknown.subtasks[0].wcet_ns = None;
    let mut narrow = spec(10, 40, &[8, 8], &[(0, 1)], 1);
    narrow.in_flight = Some(1);

    let (no_bound, overload) = (
        Some(NotProvenReason::NoBound),
        Some(NotProvenReason::Overload),
    );
    let behind = |dag| Some(NotProvenReason::DelayedBy { dag: DagId(dag) });
    let too_few = Some(NotProvenReason::InFlightTooFew { in_flight: 1 });
    let too_long = Some(NotProvenReason::LengthBeyondDeadline { length_ns: 12 });
    let subtask = SubtaskId(0);
    let missing = Some(NotProvenReason::Unknown(TaskError::MissingWcet { subtask }));
    let around_unknown = [one(0), unknown, one(2)];
    let held_up = [behind(1), missing, behind(1)];
    let no_preemption = (Policy::StaticPriority, Preemption::Disabled);
    let edf = (Policy::Edf, Preemption::Enabled);

    let holds = |kind: (Policy, Preemption),
                 cores,
                 specs: &[DagSpec],
                 expected: &[Option<NotProvenReason>],
                 first: Option<usize>| {
        let answer = answered(specs, &settings(kind, cores));
        assert_eq!(answer.reasons, expected);
        for (bound, reason) in answer.bounds.iter().zip(expected) {
            assert_ne!(bound.is_some(), reason.is_some());
        }
        let failing = answer.first_failing.map(|it| (it.dag.index(), it.reason));
        assert_eq!(failing, first.and_then(|dag| Some((dag, expected[dag]?))));
    };
    holds(FP, 1, &[one(0)], &[None], None);
    holds(FP, 1, &[one(0), heavy], &[None, overload], Some(1));
    holds(FP, 2, &[one(0), narrow], &[None, too_few], Some(1));
    holds(
        FP,
        1,
        &[one(0), one(0), wide(1)],
        &[None, None, no_bound],
        Some(2),
    );
    // What is certain to fail comes first.
    let reasons = [no_bound, behind(0), too_long];
    holds(FP, 1, &[wide(0), one(1), long], &reasons, Some(2));
    holds(FP, 1, &around_unknown, &[None, missing, behind(1)], Some(1));
    // It may hold a core that the urgent one waits for.
    holds(no_preemption, 1, &around_unknown, &held_up, Some(1));
    holds(edf, 1, &around_unknown, &held_up, Some(1));
}

#[test]
fn what_becomes_ready_at_once_is_charged_whatever_its_rank() {
    let fork: Vec<(usize, usize)> = (1..=18).map(|branch| (0, branch)).collect();
    let one = |priority| spec(100, 100, &[10], &[], priority);
    let on = |policy, cores, last: DagSpec| {
        let mut with = settings((policy, Preemption::Enabled), cores);
        with.overheads.ready_ns = 1;
        bounds(&answered(&[one(0), last], &with))
    };
    // Two releases, and a window begins 2 before the first may be served.
    assert_eq!(on(Policy::StaticPriority, 1, one(1)), [Some(12), Some(22)]);
    assert_eq!(on(Policy::StaticPriority, 2, one(1)), [Some(12), Some(15)]);
    // Three, as the last one is two wide: 10 + 10 and 2 * 3 on two cores, besides the length.
    let pair = spec(100, 100, &[10, 10], &[], 1);
    assert_eq!(on(Policy::StaticPriority, 2, pair), [Some(13), Some(23)]);
    // The two that a fork makes ready beyond 16, in two jobs.
    let wide = spec(100, 100, &[1; 19], &fork, 1);
    assert_eq!(on(Policy::StaticPriority, 1, wide)[0], Some(12 + 2 * 2));
}

/// A DAG that is held up releases its jobs late, one after the other, and each of them in a step that
/// may take as long as what it makes ready.
#[test]
fn what_falls_behind_is_charged_for_all_that_it_releases_late() {
    let fork: Vec<(usize, usize)> = (1..=18).map(|branch| (0, branch)).collect();
    let urgent = spec(10_000, 1_000, &[100], &[], 0);
    let hog = spec(10_000, 10_000, &[4_000, 4_000], &[], 1);
    let beside = |sources: usize, edges: &[(usize, usize)], overrun| {
        let mut last = spec(50, 50, &vec![1; sources], edges, 2);
        (last.overrun, last.in_flight) = (overrun, Some(1));
        let specs = [urgent.clone(), hog.clone(), last];
        let mut with = settings(FP, 2);
        with.overheads.ready_ns = 1;
        answered(&specs, &with)
    };
    let bound = |sources, edges: &[_], overrun| {
        let answer = beside(sources, edges, overrun);
        assert_eq!(answer.reasons[2], Some(NotProvenReason::NoBound));
        answer.bounds[0].ok_or(answer.reasons[0])
    };
    let backlog = Err(Some(NotProvenReason::BesideBacklog { dag: DagId(2) }));
    // There is no end to what may wait, but what a completion makes ready is charged up to 16.
    let many = |sources| bound(sources, &[], OverrunPolicy::Queue);
    assert_eq!(many(17), backlog);
    assert_eq!(many(16).map(|of| of.bound_ns), Ok(103 + 4 * 16));
    assert_eq!(bound(19, &fork, OverrunPolicy::Queue), backlog);
    // By period, and one more that may have been in flight, or that has waited for it.
    let both = |overrun| {
        [bound(17, &[], overrun), bound(19, &fork, overrun)].map(|of| of.map(|of| of.bound_ns))
    };
    let of_skips = [103 + 4 * 17, 103 + 3 + 4 * 2];
    assert_eq!(both(OverrunPolicy::Skip), of_skips.map(Ok));
    let of_aborts = [103 + 6 * 17, 103 + 4 + 5 * 2];
    assert_eq!(both(OverrunPolicy::Abort), of_aborts.map(Ok));
}

#[test]
fn overheads_next_to_a_table_count_in_each_bound() {
    let owner = spec(10, 10, &[3], &[], 0);
    let mut member = spec(20, 20, &[5], &[], 1);
    let both = |member: &DagSpec, ready_ns, interrupt_ns| {
        let mut with = settings(FP, 2);
        (with.overheads.ready_ns, with.overheads.interrupt_ns) = (ready_ns, interrupt_ns);
        bounds(&listed(
            &[owner.clone(), member.clone()],
            &["core 0: 0.0"],
            &with,
        ))
    };
    // It has both cores: one is always free, and a whole unit is halved and rounded up.
    assert_eq!(both(&member, 0, 0), [3, 6].map(Some));
    // The table moves it twice, as it may start 4 late; and of what the table takes each has half.
    assert_eq!(both(&member, 0, 1), [3 + 1, 5 + 1 + 2 + 2].map(Some));
    member.affinity = vec![0];
    assert_eq!(both(&member, 0, 0), [3, 5 + 3].map(Some));
    // Releases are 2 late, and so is the table: at 12 it may come for the second time in 14.
    assert_eq!(both(&member, 1, 0), [3 + 2, 5 + 2 * 3 + 3].map(Some));
}

/// Returns settings with a device that may keep a core for so long at such a distance.
fn with_device(of: AnalysisSettings, device_ns: u64, device_distance_ns: u64) -> AnalysisSettings {
    AnalysisSettings {
        overheads: Overheads {
            device_ns,
            device_distance_ns,
            ..of.overheads
        },
        ..of
    }
}

#[test]
fn a_device_counts_in_each_window_and_is_not_divided_among_cores() {
    let on = |policy, cores, specs: &[DagSpec], [takes, distance]: [u64; 2]| {
        let with = with_device(
            settings((policy, Preemption::Enabled), cores),
            takes,
            distance,
        );
        bounds(&answered(specs, &with))
    };
    let two = [0, 1].map(|priority| spec(100, 100, &[10], &[], priority));
    // 3 interrupts within 13, and 6 within 26.
    assert_eq!(on(FP.0, 1, &two, [1, 5]), [Some(13), Some(26)]);
    assert_eq!(on(FP.0, 2, &two, [1, 5]), [Some(13), Some(19)]);
    // Two wide, the second one waits for the first: 10, and 6 within 26 on each core.
    let pair = [two[0].clone(), spec(100, 100, &[10, 10], &[], 1)];
    assert_eq!(on(FP.0, 2, &pair, [1, 5]), [Some(13), Some(26)]);
    // It comes twice within 340, however long the core is busy with more, and 4 times within 940.
    let by_demand = [
        spec(600, 340, &[300], &[], 0),
        spec(900, 900, &[300], &[], 1),
    ];
    let of_demand = |takes| on(Policy::Edf, 1, &by_demand, [takes, 300]);
    assert_eq!(of_demand(10), [Some(340), Some(900)]);
    assert_eq!(of_demand(11), [None, None]);
    // A table of one DAG is late by it, and so its member.
    let mut owned = [spec(20, 20, &[3], &[], 0), spec(40, 40, &[5], &[], 1)];
    owned[1].affinity = vec![0];
    let beside = |takes| {
        let with = with_device(settings(FP, 2), takes, 9);
        bounds(&listed(&owned, &["core 0: 0.0"], &with))
    };
    assert_eq!(beside(0), [Some(3), Some(8)]);
    assert_eq!(beside(1), [Some(4), Some(10)]);
}

/// Two DAGs of periods 10 and 20 on two cores; the second one's last subtask is nested.
#[test]
fn each_dag_of_a_table_has_its_bound_or_the_entry_that_fails() {
    let fast = spec(10, 10, &[2, 3], &[(0, 1)], 0);
    let slow = spec(20, 30, &[9, 4], &[(0, 1)], 0);
    let lists = ["core 0: 0.0 1.0 ( 0.0#1 )", "core 1: 0.1 0.1#1 1.1"];
    let on = |specs: &[DagSpec], lists: &[&str], kind| listed(specs, lists, &settings(kind, 2));
    let both = [fast.clone(), slow.clone()];
    for kind in [FP, (Policy::Edf, Preemption::Enabled)] {
        let answer = on(&both, &lists, kind);
        assert_eq!(bounds(&answer), [Some(5), Some(19)], "{answer:?}");
    }
    // Whatever keeps its core has nothing nested in it.
    let kept = on(&both, &lists, (Policy::Edf, Preemption::Disabled));
    let fails = |dag, job, subtask, condition| {
        let (dag, subtask) = (DagId(dag), SubtaskId(subtask));
        Some(NotProvenReason::NotRight(TableFault {
            dag,
            subtask,
            job,
            condition,
        }))
    };
    let at_first = fails(1, 0, 0, TableCondition::Kept);
    assert_eq!(kept.reasons, [at_first, at_first]);
    let stated = ["core 0: 0.0@0+2 1.0@2+11 ( 0.0#1@9+2 )", lists[1]];
    let times = ["0.1@2+3", "0.1#1@12+3", "1.1@15+4"];
    let early = [stated[0], &format!("core 1: {}", times.join(" "))];
    let at_first = fails(0, 1, 0, TableCondition::Released);
    assert_eq!(on(&both, &early, FP).reasons, [at_first, at_first]);
    // A bound of one DAG says nothing of the other's deadline.
    let mut late = both.clone();
    late[1].relative_deadline_ns = Some(18);
    let (subtask, bound_ns) = (SubtaskId(1), 19);
    let reason = NotProvenReason::LateInTable { subtask, bound_ns };
    assert_eq!(on(&late, &lists, FP).reasons, [None, Some(reason)]);
    // Jobs that find no room make all late.
    let mut overlapping = slow;
    let later = ["core 0: 0.0 1.1#-1 0.0#1", "core 1: 0.1 1.0 ( 0.1#1 )"];
    overlapping.subtasks[0].wcet_ns = Some(13);
    let in_time = [Some(5), Some(26)];
    overlapping.in_flight = Some(2);
    let both = [fast, overlapping];
    assert_eq!(bounds(&on(&both, &later, FP)), in_time);
    let few = both.clone().map(|spec| DagSpec {
        in_flight: Some(1),
        ..spec
    });
    let (in_flight, dag) = (1, DagId(1));
    assert_eq!(
        on(&few, &later, FP).reasons,
        [
            Some(NotProvenReason::DelayedBy { dag }),
            Some(NotProvenReason::InFlightTooFew { in_flight })
        ]
    );
    // Delays would be handed on.
    let with = with_device(settings(FP, 2), 1, 100);
    let uncovered = Some(NotProvenReason::TableOverheads);
    assert_eq!(listed(&both, &later, &with).reasons, [uncovered, uncovered]);
}

/// A member needs a rank of its own, and an end of what the table takes.
#[test]
fn members_beside_a_table_need_static_priorities() {
    let specs = [0, 1].map(|priority| spec(20, 20, &[4], &[], priority));
    let on = |kind| listed(&specs, &["core 0: 0.0"], &settings(kind, 1));
    assert_eq!(bounds(&on(FP)), [Some(4), Some(8)]);
    // One has no other to win over.
    let edf = on((Policy::Edf, Preemption::Enabled));
    assert_eq!(bounds(&edf), [Some(4), Some(8)]);
    let kept = on((Policy::Edf, Preemption::Disabled));
    assert_eq!(kept.reasons, [Some(NotProvenReason::BesideTable); 2]);
    let mut unknown = specs.clone();
    unknown[0].subtasks[0].wcet_ns = None;
    let answer = listed(&unknown, &["core 0: 0.0"], &settings(FP, 1));
    assert_eq!(
        answer.reasons[1],
        Some(NotProvenReason::DelayedBy { dag: DagId(0) })
    );
}

#[test]
fn more_of_a_device_makes_no_bound_shorter_and_too_much_leaves_none() {
    // With each of these whatever was before is the less.
    const DEVICES: [[u64; 2]; 7] = [
        [1, 200],
        [1, 50],
        [2, 50],
        [7, 30],
        [29, 30],
        [30, 30],
        [1, 0],
    ];
    let mut proven = [0; DEVICES.len()];
    for number in 0..2_000 {
        let sample = sample_with(0, &mut Random::new(number));
        let Some(task_set) = sample.task_set() else {
            continue;
        };
        let mut before = answer(&task_set, &sample.settings());
        // Without interrupts their distance says nothing.
        let none = with_device(sample.settings(), 0, number % 3);
        assert_eq!(answer(&task_set, &none), before);
        for ([takes, distance], proven) in DEVICES.into_iter().zip(&mut proven) {
            let after = answer(&task_set, &with_device(sample.settings(), takes, distance));
            let all = |of: &AnalysisResult| {
                let sinks = of.sinks_ns.iter().flatten().copied();
                let all = bounds(of).into_iter().chain(sinks);
                all.map(|ns| ns.unwrap_or(u64::MAX)).collect::<Vec<_>>()
            };
            let (less, more) = (all(&before), all(&after));
            let is_more = less.iter().zip(&more).all(|(less, more)| less <= more);
            assert!(
                is_more,
                "{number}, {takes} of {distance}: {sample:?} {before:?} {after:?}"
            );
            *proven += after.bounds.iter().flatten().count();
            before = after;
        }
    }
    let [first, .., most, full, without_distance] = proven;
    assert!(first > 1_000 && most > 0, "{proven:?}");
    assert_eq!([full, without_distance], [0, 0]);
}
