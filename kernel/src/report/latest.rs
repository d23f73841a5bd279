//! The latest events of a run that goes on, for the report of a panic.

use core::fmt;

use sched_dag::journal::Event;

use executive::run::execution;

/// Returns the latest `most` events, a line each, the oldest first; none while the
/// scheduler is at work.
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
