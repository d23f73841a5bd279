//! What the platform adds to execution times.
//!
//! The tests know execution times only. Measured costs of the platform are
//! charged to the WCET of each subtask, once an instance:
//!
//! - two context switches, into the instance and out of it;
//! - one dispatch, the scheduler's own work at its start or finish;
//! - if instances can be preempted, one inter-processor interrupt: an instance
//!   preempts at most one other, when it becomes ready, so the one that
//!   preempts is charged. The switches back to the preempted instance are the
//!   preempting one's second switch.
//!
//! Not covered: timer interrupts, caches refilled after a preemption, bus
//! contention. Measure WCETs with these in them.

use crate::policy::Preemption;

/// Measured costs, each a worst case; all 0 by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct Overheads {
    /// One switch between two execution contexts, in nanoseconds.
    pub context_switch_ns: u64,
    /// One decision of the scheduler, locks included, in nanoseconds.
    pub dispatch_ns: u64,
    /// From the request for an inter-processor interrupt to the first
    /// instruction of its handler, in nanoseconds.
    pub interrupt_ns: u64,
}

impl Overheads {
    /// Returns what each instance is charged, or `None` if that overflows.
    #[must_use]
    pub fn of_an_instance_ns(&self, preemption: Preemption) -> Option<u64> {
        let switches = self.context_switch_ns.checked_mul(2)?;
        let always = switches.checked_add(self.dispatch_ns)?;
        match preemption {
            Preemption::Enabled => always.checked_add(self.interrupt_ns),
            Preemption::Disabled => Some(always),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Overheads, Preemption};

    #[test]
    fn only_preemption_costs_an_interrupt() {
        let overheads = Overheads {
            context_switch_ns: 100,
            dispatch_ns: 30,
            interrupt_ns: 7,
        };
        assert_eq!(overheads.of_an_instance_ns(Preemption::Enabled), Some(237));
        assert_eq!(overheads.of_an_instance_ns(Preemption::Disabled), Some(230));
        let absurd = Overheads {
            dispatch_ns: u64::MAX,
            ..overheads
        };
        assert_eq!(absurd.of_an_instance_ns(Preemption::Disabled), None);
    }
}
