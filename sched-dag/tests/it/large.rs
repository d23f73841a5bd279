//! Large commits and runs: no recursion, no quadratic loop.

use sched_dag::{CommitOptions, DagFault, DagSpec, Policy, SubtaskSpec, verify};

use crate::support::{PREEMPTIVE, Spec, cores, dag, run};

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
