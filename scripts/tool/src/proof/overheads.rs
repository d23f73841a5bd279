//! What the platform's own work costs, measured in the journal of a run.
//!
//! `sched_dag::law::Costs` says what is measured, `sched_dag::analysis::Overheads::measured` what is
//! charged for it.

use sched_dag::analysis::Overheads;
use sched_dag::law::Costs;

use crate::json::Object;
use crate::record::Run;
use crate::trace;

/// What was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measured(pub Costs);

/// Measures the runs of a guest.
///
/// # Errors
///
/// In words: the log has no trace, or a damaged one.
pub fn measure(runs: &[Run]) -> Result<Measured, String> {
    let costs = runs.iter().map(of_run).reduce(|one, other| Costs {
        dispatches: one.dispatches + other.dispatches,
        owed_ns: one.owed_ns.max(other.owed_ns),
        releases: one.releases + other.releases,
        late_ns: one.late_ns.max(other.late_ns),
    });
    costs
        .map(Measured)
        .ok_or_else(|| "the guest has run nothing".into())
}

fn of_run(run: &Run) -> Costs {
    let figures = trace::check(run, u64::MAX).figures;
    Costs {
        dispatches: figures.instances as u64,
        owed_ns: figures.longest_inversion_ns,
        ..Costs::of_releases(&run.task_set, run.events.iter().copied())
    }
}

impl Measured {
    /// Returns the guest's word for what is charged, with a margin in hundredths.
    #[must_use]
    pub fn word(&self, margin_percent: u64) -> String {
        let margin_percent = u32::try_from(margin_percent).unwrap_or(u32::MAX);
        let Overheads {
            context_switch_ns,
            dispatch_ns,
            interrupt_ns,
            ..
        } = Overheads::measured(&self.0, margin_percent, 0);
        format!("overheads_ns={context_switch_ns},{dispatch_ns},{interrupt_ns}")
    }

    /// Returns what was measured and is charged, for people.
    #[must_use]
    pub fn text(&self, margin_percent: u64) -> String {
        format!(
            "\noverheads measured: {}; with a margin of {margin_percent} %: {}\n",
            self.0,
            self.word(margin_percent)
        )
    }

    /// Returns the same as a machine line.
    #[must_use]
    pub fn line(&self, margin_percent: u64) -> String {
        Object::new()
            .text("kind", "overheads")
            .number("dispatches", self.0.dispatches)
            .number("owed_ns", self.0.owed_ns)
            .number("releases", self.0.releases)
            .number("late_ns", self.0.late_ns)
            .number("margin_percent", margin_percent)
            .end()
    }
}
