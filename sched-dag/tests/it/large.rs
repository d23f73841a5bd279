//! Large commits and runs: no recursion, no quadratic loop.

use sched_dag::journal::{Event, EventKind};
use sched_dag::law::{self, JudgeOptions, RunRecord};
use sched_dag::lifecycle::Request;
use sched_dag::{
    CommitOptions, CoreId, DagFault, DagId, DagSpec, Journal, Policy, SKIPS_A_STEP, SKIPS_EVERY_NS,
    SubtaskSpec, verify,
};

use crate::support::{PREEMPTIVE, Spec, commit, cores, dag, run, scheduler};

const LARGE: usize = 200_000;

fn large(edges: &[(usize, usize)]) -> DagSpec {
    let spec = dag(1_000_000, 1_000_000, 1, &[], edges);
    spec.with(|spec| spec.subtasks = vec![SubtaskSpec::default(); LARGE])
}

#[test]
fn a_long_chain_is_committed_and_run() {
    let chain: Vec<_> = (1..LARGE).map(|to| (to - 1, to)).collect();
    run(&[large(&chain)], PREEMPTIVE, 1).must_be("200000 completed 0.0 Met");
}

#[test]
fn a_wide_fork_is_committed_and_run() {
    let fork = (1..LARGE - 1).flat_map(|branch| [(0, branch), (branch, LARGE - 1)]);
    // 199,998 branches on 300 cores take 667 rounds.
    run(&[large(&fork.collect::<Vec<_>>())], cores(300), 1).must_be("669 completed 0.0 Met");
}

#[test]
fn a_huge_cycle_or_knot_is_refused_in_bounded_time() {
    let ring = (0..LARGE).map(|from| (from, (from + 1) % LARGE));
    // Every subtask precedes the next three, around: no cycle is short.
    let knot = (0..LARGE).flat_map(|from| (1..4).map(move |step| (from, (from + step) % LARGE)));
    for (edges, length) in [
        (ring.collect(), Some(LARGE)),
        (knot.collect::<Vec<_>>(), None),
    ] {
        let options = CommitOptions::new(Policy::Edf, 1);
        let rejected = verify(&[large(&edges)], &options).expect_err("a cycle");
        let cycles = rejected.faults().iter().filter_map(|fault| match fault {
            DagFault::Cycle { hops, .. } => Some(hops.len()),
            _ => None,
        });
        let cycles: Vec<usize> = cycles.collect();
        assert_eq!(cycles.len(), 1);
        assert!(length.is_none_or(|length| cycles == [length]));
    }
}

/// C2, P2: however many jobs wait, no step tells of more than so many.
#[test]
fn a_long_backlog_is_skipped_in_short_steps() {
    const JOBS: u64 = 100_000;
    for request in [Request::Pause(DagId(0)), Request::Close(DagId(0))] {
        let overloaded = dag(10, 10, JOBS, &[0], &[]).with(|spec| spec.in_flight = Some(1));
        let mut scheduler = scheduler(&[overloaded.clone(), overloaded], cores(1));
        scheduler.log.journal = Journal::growing();
        scheduler.hear([EventKind::Skipped]);
        let mut now_ns = 10 * JOBS;
        let _ = scheduler.at(now_ns).dispatch();
        scheduler.at(now_ns).serve(request);
        scheduler.at(now_ns).serve(Request::Close(DagId(1)));
        // The first one of each DAG comes besides.
        let (mut most, mut skips, mut notices) = (SKIPS_A_STEP + 2, 0, Vec::new());
        loop {
            let _ = scheduler.at(now_ns).dispatch();
            scheduler.log.exchange_notices(&mut notices);
            assert!((1..=most).contains(&notices.len()), "{}", notices.len());
            (most, skips) = (SKIPS_A_STEP, skips + notices.len() as u64);
            let Some(next_ns) = scheduler.next_event_ns() else {
                break;
            };
            assert!(!scheduler.is_finished() && next_ns == now_ns + SKIPS_EVERY_NS);
            now_ns = next_ns;
        }
        assert_eq!(skips, 2 * (JOBS - 1));
        assert_eq!(scheduler.statistics(DagId(0)).skips, JOBS - 1);
        let events = scheduler.log.journal.events();
        let found = law::violations(scheduler.task_set(), JudgeOptions::whole(u64::MAX), events);
        assert_eq!(found, []);
    }
}

/// After an overload a record of each job that waits may not fit.
#[test]
fn times_that_memory_cannot_hold_are_none() {
    const JOBS: u64 = 1 << 50;
    let endless = dag(1, 1, 1, &[0], &[]).with(|spec| spec.jobs = Some(JOBS));
    let task_set = commit(&[endless], PREEMPTIVE);
    let skipped = |job| Event {
        time_ns: JOBS,
        what: EventKind::Skipped,
        core: CoreId(0),
        dag: DagId(0),
        job,
        subtask: None,
    };
    let record = |last| {
        let events = [0, last].map(skipped);
        RunRecord::of_events(&task_set, true, events.into_iter())
    };
    assert!(record(7).is_some_and(|record| record.jobs(DagId(0)).len() == 8));
    assert!(record(JOBS - 1).is_none());
}
