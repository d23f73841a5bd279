//! Native runs obey the rules: on threads, with real races between workers.
//!
//! Every body checks what R2 and R3 promise, with memory that is not synchronized by
//! anything but the scheduler (relaxed atomics, which the processor may reorder); and
//! every run is written down and held against R1 to R5.

#[path = "support/graphs.rs"]
mod graphs;

use std::sync::{Arc, Barrier};

use graphs::{chain, commit, fork_join, layered, runs_all, spec};
use native::{Closure, Setting};
use sched_dag::{DagSpec, Policy};

fn holds(specs: &[DagSpec]) {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for workers in 1..=3 {
            let setting = Setting { policy, workers };
            runs_all(specs, setting, &[]);
        }
    }
}

#[test]
fn a_chain_obeys_r1_to_r5() {
    holds(&[spec(64, &chain(64), 60)]);
}

#[test]
fn a_fork_join_obeys_r1_to_r5() {
    for parallel in [1, 2, 4, 6, 16] {
        holds(&[spec(parallel + 2, &fork_join(parallel), 150)]);
    }
}

#[test]
fn a_layered_graph_obeys_r1_to_r5() {
    holds(&[spec(8 * 30, &layered(30), 15)]);
}

#[test]
fn dags_side_by_side_obey_r1_to_r5() {
    holds(&[
        spec(8, &chain(8), 100),
        spec(6, &fork_join(4), 100),
        spec(24, &layered(3), 100),
        spec(5, &[], 100),
    ]);
}

#[test]
fn both_workers_work() {
    let setting = Setting {
        policy: Policy::StaticPriority,
        workers: 2,
    };
    let task_set = commit(&[spec(6, &fork_join(4), 20)], setting);
    // The branches meet in pairs, and a worker that does not work meets nobody. How many
    // instances each worker has is up to the host, which may hold one of them back.
    let meeting = Arc::new(Barrier::new(2));
    let body = |subtask| {
        let meeting = Arc::clone(&meeting);
        Box::new(move |_| {
            if (1..=4).contains(&subtask) {
                meeting.wait();
            }
        }) as Closure
    };
    let bodies = vec![(0..6).map(body).collect()];
    let recorded = native::run_recorded(task_set, bodies, setting);
    assert_eq!(recorded.violations, []);
    assert!(recorded.by_worker.iter().all(|&instances| instances > 0));
}

#[test]
#[should_panic(expected = "the third job")]
fn a_panic_ends_the_run_with_its_message() {
    let setting = Setting {
        policy: Policy::StaticPriority,
        workers: 2,
    };
    let task_set = commit(&[spec(2, &chain(2), 10)], setting);
    let bodies: Vec<Vec<Closure>> = vec![vec![
        Box::new(|_| ()),
        Box::new(|job| assert!(job != 2, "the third job")),
    ]];
    native::run(task_set, bodies, setting);
}

#[test]
#[should_panic(expected = "give each one a limit")]
fn a_dag_without_end_is_refused() {
    let setting = Setting {
        policy: Policy::StaticPriority,
        workers: 1,
    };
    let endless = DagSpec {
        jobs: None,
        ..spec(1, &[], 1)
    };
    native::run(
        commit(&[endless], setting),
        vec![vec![Box::new(|_| ())]],
        setting,
    );
}
