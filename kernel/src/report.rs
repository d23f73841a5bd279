//! The report of a finished run: the [`Run`] for the app, the bytes its functions have left in the
//! heap, and their use of the stacks.
//!
//! Everything is computed from the journal. Nothing here is called while a run goes on, except
//! `latest`, by a panic. Reports without knowledge of the machine are in the front.
//!
//! # Memory left by a fault
//!
//! When a fault ends a function, everything the function owns is lost, because its destructors are
//! not called. Memory allocated by a DAG's functions during the run, and still in use after the run
//! itself was dropped, is therefore either lost in this way, or was handed over, for example to a
//! `static`.

use alloc::vec;
use core::fmt;
use core::sync::atomic::Ordering;

use executive::memory::heap;
use executive::run::{contexts, execution, stacks};
use front::json;
use sched_dag::DagId;
use sched_dag::engine::Run;
use sched_dag::journal::Event;

pub use front::report::{Distribution, Ns};

/// Returns the latest `most` events, a line each, the oldest first; none while the scheduler is at
/// work.
pub(crate) fn latest<const MOST: usize>() -> impl fmt::Display {
    fmt::from_fn(move |f| {
        let mut latest = [None; MOST];
        let first_core = execution::try_journal(|journal, first_core| {
            journal.copy_back(journal.written(), &mut latest);
            first_core
        });
        latest.iter().rev().flatten().try_for_each(|event| {
            let Event {
                time_ns,
                what,
                core,
                dag,
                job,
                subtask,
            } = event;
            let (core, dag) = (first_core.unwrap_or(0) + core.0, dag.0);
            write!(
                f,
                "  {time_ns:>12} ns  core {core} {what} dag {dag} job {job}"
            )?;
            subtask.map_or(Ok(()), |subtask| write!(f, " subtask {}", subtask.0))?;
            writeln!(f)
        })
    })
}

/// Prints a line for each DAG that had faults and has left memory in use.
pub(crate) fn tell_left(run: &Run) {
    let dags = run.task_set().dags();
    let mut left = vec![0; dags.len()];
    heap::take_owned(&mut left);
    for ((id, dag), bytes) in (0..).map(DagId).zip(dags).zip(left) {
        let faults = run.statistics(id).faults;
        if faults > 0 && bytes > 0 {
            let name = dag.name();
            crate::println!(
                "left: of what dag `{name}` has allocated, {bytes} bytes stay in use, after \
                 {faults} faults"
            );
            json::emit("left", |line| {
                line.text("dag_name", name)
                    .number("faults", faults)
                    .number("heap_bytes", bytes as u64);
            });
        }
    }
}

/// Prints a line for each subtask, if the use of stacks was measured.
pub(crate) fn tell_stacks(run: &Run) {
    let of_bytes = contexts::stack_bytes(run.task_set());
    let dags = run.task_set().dags();
    let subtasks = dags.iter().flat_map(|dag| {
        let subtasks = dag.subtasks().iter();
        subtasks.map(move |subtask| (dag.name(), subtask.name()))
    });
    for ((dag, subtask), used) in subtasks.zip(stacks::used()) {
        let used = used.load(Ordering::Relaxed);
        crate::println!("stack: `{subtask}` of `{dag}` used {used} of {of_bytes} bytes at most");
        json::emit("stack", |line| {
            line.text("dag_name", dag)
                .text("subtask_name", subtask)
                .number("used_bytes", used)
                .number("stack_bytes", of_bytes);
        });
    }
}
