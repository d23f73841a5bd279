//! The trace checker: what happened in a run, held against the model's rules.
//!
//! A guest that is booted with `trace=dump` prints the trace of each run on its
//! serial port, as `docs/trace-format.md` says. From that alone, and sharing
//! nothing with the scheduler but the numbers of things, [`check`] replays the
//! run and finds every breach of
//!
//! - R1 and R4 (`jobs`): releases, completions, deadlines;
//! - R2 and R3 (`joins`): AND-joins and the completion boundary;
//! - R5 (`dispatch`): who runs, within a stated *bound*, because a decision
//!   takes effect after an interrupt;
//! - one life (`history`) and one core (`cores`): what no machine may do.
//!
//! It also computes the [`figures`]. [`read()`] takes a log apart, [`model`] is
//! what it finds, `view` puts that in order, [`command`] is the subcommand
//! and [`report`] what it prints. [`viewer`] draws a run instead of judging it.
//!
//! It guarantees that a trace of the scheduler in virtual time has no breach at
//! a bound of 0. It does not find what leaves no event: that values went astray,
//! or that a rule was broken before the events that are left, if some were lost.
//! An instance that has not finished when the trace ends breaks no rule, unless
//! the run says that it is complete.

pub mod bound;
pub mod breach;
pub mod command;
mod cores;
mod dispatch;
pub mod figures;
mod history;
mod jobs;
mod joins;
pub mod model;
mod read;
pub mod report;
#[cfg(test)]
mod tests;
mod view;
pub mod viewer;

use breach::Breach;
use figures::Figures;
use model::Run;
use view::View;

pub use command::{CHECK_TRACE, check_trace};
pub use read::read;
pub use viewer::{TRACE, trace};

/// What a run's trace shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Findings {
    /// The breaches by time.
    pub breaches: Vec<Breach>,
    /// The figures.
    pub figures: Figures,
}

/// Holds a run against the rules. Nothing waits longer than `bound_ns` for what
/// it is owed; 0 is for virtual time.
#[must_use]
pub fn check(run: &Run, bound_ns: u64) -> Findings {
    let mut breaches = Vec::new();
    let view = View::new(run, &mut breaches);
    jobs::judge(&view, bound_ns, &mut breaches);
    let finish_to_ready = joins::judge(&view, bound_ns, &mut breaches);
    cores::judge(&view, &mut breaches);
    let waits = dispatch::judge(&view, bound_ns, &mut breaches);
    breaches.sort_by_key(|breach| (breach.time_ns, breach.rule));
    Findings {
        breaches,
        figures: figures::compute(&view, finish_to_ready, waits),
    }
}
