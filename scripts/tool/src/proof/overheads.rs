//! What the platform's own work costs, measured in the journal of a run.
//!
//! An instance is *owed* a core as long as it should run by R5 and does not: from its
//! readiness, or from the finish of what preempted it, until its first (or next)
//! instruction. In theory that takes no time. On a machine it is all that the platform does
//! between two instances: the interrupt, the scheduler's step, the journal, the hand-off to
//! another core, the switch of contexts. So the longest time for which one was owed a core
//! is what each of these moments costs at most, however its parts share it. What comes
//! before a readiness is the release's lateness, from the nominal to the actual release.
//!
//! Charged to an instance (`sched_dag::analysis::Overheads`, two of its three numbers):
//!
//! - as *dispatch*, the lateness of its release and once the longest time owed: that passes
//!   before its own first instruction;
//! - as *interrupt*, where instances are preempted, once more the longest time owed: before
//!   the next instruction of the one that it has preempted. It has preempted one at most,
//!   when it became ready, and so each resumption has one that pays for it. That one is
//!   more urgent than what it preempts, so a bound counts it as interference there.
//!
//! Work of the platform that interrupts a running instance, a timer's or another core's, is
//! within that call's time, as it is observed.

use std::collections::BTreeSet;

use sched_dag::journal::What;

use crate::json::Object;
use crate::trace;
use crate::trace::model::Run;

/// What was measured, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// How many instances were dispatched.
    pub dispatches: usize,
    /// The longest time for which one was owed a core.
    pub owed_ns: u64,
    /// How many jobs were released.
    pub releases: usize,
    /// The longest time from the nominal to the actual release.
    pub late_ns: u64,
}

/// Measures the runs of a guest.
///
/// # Errors
///
/// In words: the log has no trace, or a damaged one.
pub fn measure(log: &str) -> Result<Measured, String> {
    let runs = trace::read(log).map_err(|malformed| {
        let (line, reason) = (malformed.line, malformed.reason);
        format!("serial line {line}: {reason}")
    })?;
    let measured = runs.iter().map(of_run).reduce(|one, other| Measured {
        dispatches: one.dispatches + other.dispatches,
        owed_ns: one.owed_ns.max(other.owed_ns),
        releases: one.releases + other.releases,
        late_ns: one.late_ns.max(other.late_ns),
    });
    measured.ok_or_else(|| "the guest has run nothing".into())
}

fn of_run(run: &Run) -> Measured {
    let figures = trace::check(run, u64::MAX).figures;
    let queued = run.events.iter();
    let queued = queued.filter(|event| event.what == What::Queued);
    let queued: BTreeSet<_> = queued.map(|event| (event.dag, event.job)).collect();
    let released = run.events.iter();
    let released = released.filter(|event| event.what == What::Released);
    let late_ns = released.clone().filter_map(|event| {
        let model = run.task_set.dag(event.dag);
        // A sporadic job's nominal release is its signal, which the step has seen; one that
        // was queued waited for an older job.
        let is_due = !model.is_sporadic() && !queued.contains(&(event.dag, event.job));
        is_due.then(|| event.time_ns.saturating_sub(model.grid_ns(event.job)))
    });
    Measured {
        dispatches: figures.instances,
        owed_ns: figures.longest_inversion_ns,
        late_ns: late_ns.max().unwrap_or(0),
        releases: released.count(),
    }
}

impl Measured {
    /// Returns the guest's word for what is charged, with a margin in hundredths.
    #[must_use]
    pub fn word(&self, margin_percent: u64) -> String {
        let with_margin = |ns: u64| ns.saturating_mul(100 + margin_percent).div_ceil(100);
        let (owed_ns, late_ns) = (with_margin(self.owed_ns), with_margin(self.late_ns));
        format!(
            "overheads_ns=0,{},{owed_ns}",
            owed_ns.saturating_add(late_ns)
        )
    }

    /// Returns what was measured and is charged, for people.
    #[must_use]
    pub fn text(&self, margin_percent: u64) -> String {
        let Measured {
            dispatches,
            owed_ns,
            releases,
            late_ns,
        } = self;
        format!(
            "\noverheads measured: at most {owed_ns} ns until one of {dispatches} instances had its \
             core, and {late_ns} ns until one of {releases} releases was made; with a margin of \
             {margin_percent} %: {}\n",
            self.word(margin_percent)
        )
    }

    /// Returns the same as a machine line.
    #[must_use]
    pub fn line(&self, margin_percent: u64) -> String {
        Object::new()
            .text("kind", "overheads")
            .number("dispatches", self.dispatches as u64)
            .number("owed_ns", self.owed_ns)
            .number("releases", self.releases as u64)
            .number("late_ns", self.late_ns)
            .number("margin_percent", margin_percent)
            .end()
    }
}

#[cfg(test)]
mod tests {
    use super::{Measured, measure};

    #[test]
    fn the_longest_waits_of_a_run_are_what_is_charged() {
        let log = "{\"kind\":\"trace_begin\",\"policy\":\"edf\",\"preemption\":\"on\",\"cores\":1,\"run\":0}\n\
            {\"kind\":\"trace_dag\",\"dag\":0,\"name\":\"x\",\"period_ns\":100,\"relative_deadline_ns\":100,\
             \"offset_ns\":0,\"in_flight\":1,\"overrun\":\"queue\",\"subtasks\":[[\"a\",0,0,50]],\"edges\":[]}\n\
            {\"kind\":\"trace\",\"events\":[[2,\"released\",0,0,0,-1],[2,\"ready\",0,0,0,0],\
             [5,\"start\",0,0,0,0],[20,\"finish\",0,0,0,0],[20,\"completed\",0,0,0,-1],\
             [101,\"released\",0,0,1,-1],[101,\"ready\",0,0,1,0],[108,\"start\",0,0,1,0],\
             [120,\"finish\",0,0,1,0],[120,\"completed\",0,0,1,-1]]}\n\
            {\"kind\":\"trace_end\",\"events\":10,\"lost\":0,\"complete\":true}\n";
        let measured = measure(log).unwrap();
        let expected = Measured {
            dispatches: 2,
            owed_ns: 7,
            releases: 2,
            late_ns: 2,
        };
        assert_eq!(measured, expected);
        assert_eq!(measured.word(0), "overheads_ns=0,9,7");
        assert_eq!(measured.word(50), "overheads_ns=0,14,11");
        assert_eq!(measure("").unwrap_err(), "the guest has run nothing");
    }
}
