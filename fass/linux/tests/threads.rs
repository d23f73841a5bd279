//! A run has as many threads as instances can have to be on at once.

mod support;

use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use fass::{SubtaskAttributes, finish_create_dags};
use linux::{Linux, Mechanism};
use support::{alone_on, every, ms};

/// Counts the program's threads.
fn threads() -> usize {
    fs::read_dir("/proc/self/task")
        .expect("Linux has it")
        .count()
}

/// Runs so many chains of so many subtasks on two cores, with or without budgets, and returns the number
/// of threads that the run adds.
fn added(mechanism: Mechanism, chains: usize, links: usize, has_budget: bool) -> usize {
    let alone = alone_on(|| Linux::sharing(2, mechanism).expect("two cores are asked for"));
    let (before, seen) = (threads(), Arc::new(AtomicUsize::new(0)));
    let chain = |number| {
        let dag = every(ms(100), &format!("chain{number}"));
        dag.jobs(2).in_flight(1);
        let link = |_| {
            let seen = Arc::clone(&seen);
            let attributes = SubtaskAttributes::default();
            let attributes = match has_budget {
                true => attributes.budget(ms(1_000)),
                false => attributes,
            };
            dag.register_untyped_subtask(move |_| seen.store(threads(), Relaxed), attributes)
        };
        let subtasks: Vec<_> = (0..links).map(link).collect();
        for pair in subtasks.windows(2) {
            dag.precede(&pair[0], &pair[1]);
        }
        dag
    };
    let dags: Vec<_> = (0..chains).map(chain).collect();
    finish_create_dags(&dags).expect("chains are sound");
    drop(alone.machine.run().expect("DAGs are committed"));
    seen.load(Relaxed) - before
}

#[test]
fn a_run_has_a_thread_for_each_core_and_each_instance_that_can_be_suspended_or_lost() {
    // Each run has another thread, which releases jobs.
    for mechanism in [Mechanism::Poll, Mechanism::Normal] {
        assert_eq!(added(mechanism, 1, 1_000, false), 2 + 1);
        // On both cores a budget may be exceeded, but a chain of one has a single instance.
        assert_eq!(added(mechanism, 3, 1, true), 2 + 3 + 1);
        assert_eq!(added(mechanism, 1, 10, true), 2 + 2 + 1);
    }
    let fifo = alone_on(|| Linux::sharing(1, Mechanism::Fifo).expect("there is a processor"));
    if !fifo.machine.is_preemptive() {
        return println!("skipped: {:?}", fifo.machine.warnings());
    }
    drop(fifo);
    assert_eq!(added(Mechanism::Fifo, 4, 50, false), 2 + 4 + 1);
}
