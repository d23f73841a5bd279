//! The trace checker: what happened in a run, held against the model's rules.
//!
//! A [record](crate::record) has the model that was run, and its journal: a [`Run`]. The judge is
//! [`sched_dag::law`], which judges all runs, within a stated *bound*, because a decision
//! takes effect after an interrupt.
//!
//! Here are besides: the [`figures`], from `view`, which puts a run in the order of
//! time; `chains`, how long effects take from DAG to DAG; [`command`], the subcommand, and [`report`], what it prints; and [`viewer`],
//! which draws a run instead of judging it.
//!
//! If events were lost, they were the oldest, and only what came after the instant of the
//! first one that is left is judged. An instance that has not finished when the trace
//! ends breaks no rule, unless the run says that it is complete.

mod chains;
pub mod command;
pub mod figures;
pub mod report;
#[cfg(test)]
mod tests;
mod view;
pub mod viewer;

use sched_dag::law::{self, Violation};

use crate::record::{Record, Run};
use figures::Figures;
use view::View;

pub use command::{CHECK_TRACE, check_trace};
pub use viewer::{TRACE, trace};

/// What a run's trace shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Findings {
    /// The breaches by time.
    pub breaches: Vec<Violation>,
    /// The figures.
    pub figures: Figures,
}

/// Reads the runs of the record that stands in a log.
///
/// # Errors
///
/// In words: what is wrong with it.
pub fn read(log: &str) -> Result<Vec<Run>, String> {
    Record::of_log(log).map(|record| record.runs)
}

/// Holds a run against the rules. Nothing waits longer than `bound_ns` for what
/// it is owed; 0 is for virtual time.
#[must_use]
pub fn check(run: &Run, bound_ns: u64) -> Findings {
    let (view, terms) = (View::new(run), run.terms(bound_ns));
    let verdict = law::judge(&run.task_set, terms, view.in_the_order_of_the_log());
    let by_time = view.events.iter().copied();
    let dispatch = law::judge_dispatch(&run.task_set, &run.options, terms, by_time);
    let mut breaches = verdict.violations;
    breaches.extend(dispatch.violations);
    breaches.sort_by_key(|breach| (breach.time_ns(), breach.rule()));
    Findings {
        breaches,
        figures: figures::compute(&view, verdict.finish_to_ready_max_ns, dispatch.waits),
    }
}
