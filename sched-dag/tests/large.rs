//! Large commits and runs: no recursion, no quadratic loop.

mod support;

use sched_dag::{CommitOptions, DagSpec, Fault, Policy, SubtaskSpec, verify};
use support::{PREEMPTIVE, cores, run};

const LARGE: usize = 200_000;

fn large(edges: Vec<(usize, usize)>) -> DagSpec {
    DagSpec {
        period_ns: Some(1_000_000),
        relative_deadline_ns: Some(1_000_000),
        jobs: Some(1),
        subtasks: vec![SubtaskSpec::default(); LARGE],
        edges,
        ..DagSpec::default()
    }
}

#[test]
fn a_long_chain_is_committed_and_run() {
    let chain = large((1..LARGE).map(|to| (to - 1, to)).collect());
    run(&[chain], PREEMPTIVE, 1).must_be("200000 completed 0.0 Met");
}

#[test]
fn a_wide_fork_is_committed_and_run() {
    let fork = (1..LARGE - 1).flat_map(|branch| [(0, branch), (branch, LARGE - 1)]);
    // 199,998 branches on 300 cores take 667 rounds.
    run(&[large(fork.collect())], cores(300), 1).must_be("669 completed 0.0 Met");
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
        let rejected = verify(&[large(edges)], &options).expect_err("a cycle");
        let cycles = rejected.faults().iter().filter_map(|fault| match fault {
            Fault::Cycle { hops, .. } => Some(hops.len()),
            _ => None,
        });
        let cycles: Vec<usize> = cycles.collect();
        assert_eq!(cycles.len(), 1);
        assert!(length.is_none_or(|length| cycles == [length]));
    }
}
