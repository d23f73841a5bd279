//! Overheads: the time that the platform adds to executions.
//!
//! The tests know execution times only. Measured costs of the platform are
//! charged to the WCET of each subtask, once for each of its segments:
//!
//! - two context switches, into the instance and out of it;
//! - one dispatch, the scheduler's own work at its start or finish;
//! - if instances can be preempted, one inter-processor interrupt: an instance
//!   preempts at most one other, when it becomes ready, so the one that
//!   preempts is charged. The switches back to the preempted instance are the
//!   preempting one's second switch.
//!
//! An entry of a table may [move](Overheads::of_a_move_ns) a member to an idle core, which goes on
//! there at once. That is no charge of an instance, but a term of the bounds in `lent_cores`.
//!
//! These are of a step in which few instances become ready. For each one that does, `ready` is
//! what it adds to a step, whatever is then delayed: `workload` has that term of the bounds.
//!
//! A *device* interrupts one core, and its driver keeps it from interrupting again too soon. An
//! instance is charged nothing for that: `workload` has that term, too.
//!
//! Not covered: timer interrupts, caches refilled after a preemption, bus
//! contention. Measure WCETs with these in them. `docs/proving.md` has the argument for
//! the charges, and the step of it that is not proven.

use alloc::string::{String, ToString};

use crate::law::MeasuredCosts;
use crate::policy::Preemption;
use crate::task_set::Dag;

/// Makes the terms: what each is of, and how often a segment is charged it, in any case and besides
/// where instances can be preempted; and how often a move takes it.
macro_rules! overheads {
    ($(
        $(#[doc = $doc:literal])+
        $term:ident = $word:literal, segment $always:literal + $preemptive:literal, move $moved:literal;
    )+) => {
        // Of a recording, which has the sums of a segment and of a move, the latter is read as a
        // part of the former.
        $(const _: () = assert!($moved <= $always + $preemptive, $word);)+

        /// Measured costs, each a worst case; all 0 by default.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
        pub struct Overheads {
            $($(#[doc = $doc])+ pub $term: u64,)+
        }

        impl Overheads {
            /// The names of the terms, in the order of the numbers that state them.
            pub const WORDS: &[&str] = &[$($word),+];

            const TIMES: &[[u64; 3]] = &[$([$always, $always + $preemptive, $moved]),+];

            /// No overheads.
            pub const NONE: Self = Self { $($term: 0),+ };

            /// Makes them of the numbers that state them.
            pub const fn of_terms_ns([$($term),+]: [u64; Self::WORDS.len()]) -> Self {
                Self { $($term),+ }
            }

            /// Returns the numbers that state them.
            pub const fn terms_ns(&self) -> [u64; Self::WORDS.len()] {
                [$(self.$term),+]
            }

            /// Returns these as text, with commas between.
            pub fn stated(&self) -> String {
                self.terms_ns().map(|ns| ns.to_string()).join(",")
            }
        }
    };
}

overheads! {
    /// One switch between two execution contexts, in nanoseconds.
    context_switch_ns = "context switch", segment 2 + 0, move 2;
    /// One decision of the scheduler, locks included, in nanoseconds.
    dispatch_ns = "dispatch", segment 1 + 0, move 0;
    /// From the request for an inter-processor interrupt to the first
    /// instruction of its handler, in nanoseconds.
    interrupt_ns = "interrupt", segment 0 + 1, move 1;
    /// By how much a step is longer for each instance that becomes ready in it, in
    /// nanoseconds.
    ready_ns = "readiness", segment 0 + 0, move 0;
    /// The longest interrupt of a device, with all that its core does for it, in nanoseconds; 0:
    /// there is no device.
    device_ns = "device interrupt", segment 0 + 0, move 0;
    /// The least time between the beginnings of two such interrupts, in nanoseconds.
    device_distance_ns = "device distance", segment 0 + 0, move 0;
}

/// Where overheads are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum OverheadSource {
    /// Someone states them, or nobody: then they are 0.
    #[default]
    Stated,
    /// They are the longest that were measured, and a margin.
    Measured {
        /// How many instances were dispatched meanwhile.
        dispatches: u64,
        /// The margin, in hundredths.
        margin_percent: u32,
    },
}

impl Overheads {
    /// Returns the charges for costs that were measured, with a margin in per cent.
    ///
    /// - As *dispatch*, the lateness of an instance's release and once the longest time owed:
    ///   that passes before its own first instruction.
    /// - As *interrupt*, where instances are preempted, once more the longest time owed: before
    ///   the next instruction of the one that it has preempted. It has preempted one at most,
    ///   when it became ready, and so each resumption has one that pays for it. That one is
    ///   more urgent than what it preempts, so a bound counts it as interference there.
    /// - As *ready*, where in one of the steps `at_once` instances became ready, that part of the
    ///   longest time owed: what each of them took cannot be more. With 0 nothing is: where
    ///   the costs are of a run of the DAGs themselves, they include their longest steps.
    ///
    /// Work of the platform that interrupts a running instance, a timer's or another core's, is
    /// within that call's time, as it is observed.
    #[must_use]
    pub const fn measured(costs: &MeasuredCosts, margin_percent: u32, at_once: u64) -> Self {
        let percent = 100 + margin_percent as u64;
        let owed_ns = costs.owed_ns.saturating_mul(percent).div_ceil(100);
        let late_ns = costs.late_ns.saturating_mul(percent).div_ceil(100);
        Self {
            dispatch_ns: owed_ns.saturating_add(late_ns),
            interrupt_ns: owed_ns,
            ready_ns: match at_once {
                0 => 0,
                _ => owed_ns.div_ceil(at_once),
            },
            // The longest time owed has all others in it.
            ..Self::NONE
        }
    }

    /// Returns the charge of each segment, or `None` if that overflows.
    pub fn of_an_instance_ns(&self, preemption: Preemption) -> Option<u64> {
        self.sum_ns(usize::from(preemption == Preemption::Enabled))
    }

    fn sum_ns(&self, column: usize) -> Option<u64> {
        let mut terms = self.terms_ns().into_iter().zip(Self::TIMES);
        terms.try_fold(0_u64, |sum, (ns, times)| {
            sum.checked_add(ns.checked_mul(times[column])?)
        })
    }

    /// Returns how long it takes to go on with an instance on another core of its group, since an
    /// entry of a table takes its core.
    pub fn of_a_move_ns(&self, preemption: Preemption) -> u64 {
        match preemption {
            Preemption::Enabled => self.sum_ns(2).unwrap_or(u64::MAX),
            Preemption::Disabled => 0,
        }
    }

    /// Returns how long the device's interrupts keep its core at most, within a time.
    pub const fn of_device_ns(&self, within_ns: u64) -> u64 {
        match within_ns.checked_div(self.device_distance_ns) {
            Some(whole) => whole.saturating_add(1).saturating_mul(self.device_ns),
            None => self.device_ns,
        }
    }

    /// Reports whether the device leaves its core some time.
    pub const fn device_leaves_time(&self) -> bool {
        self.device_ns == 0 || self.device_ns < self.device_distance_ns
    }

    /// Returns them in a cluster with these DAGs, whose subtasks may enter sections of locks, on a
    /// machine of so many cores in all.
    ///
    /// An instance that is given a core may find another one there that is in a section: once at
    /// its start and, paid for by the one that has preempted it, once when it goes on. If it is
    /// preempted while it waits for a section, it waits for its turn anew. `docs/proving.md` has the
    /// argument.
    pub fn among(self, dags: &mut dyn Iterator<Item = &Dag>, cores: u32) -> Self {
        let (mut longest_ns, mut turn_ns) = (0, 0);
        for of in dags.flat_map(Dag::locks) {
            longest_ns = of.longest_ns.unwrap_or(u64::MAX).max(longest_ns);
            turn_ns = of.turn_ns(cores).max(turn_ns);
        }
        let sections_ns = longest_ns.saturating_mul(2).saturating_add(turn_ns);
        Self {
            interrupt_ns: self.interrupt_ns.saturating_add(sections_ns),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{MeasuredCosts, Overheads, Preemption};

    #[test]
    fn only_preemption_costs_an_interrupt() {
        let overheads = Overheads {
            context_switch_ns: 100,
            dispatch_ns: 30,
            interrupt_ns: 7,
            ..Overheads::default()
        };
        assert_eq!(overheads.of_an_instance_ns(Preemption::Enabled), Some(237));
        assert_eq!(overheads.of_an_instance_ns(Preemption::Disabled), Some(230));
        let absurd = Overheads {
            dispatch_ns: u64::MAX,
            ..overheads
        };
        assert_eq!(absurd.of_an_instance_ns(Preemption::Disabled), None);
    }

    #[test]
    fn a_device_takes_its_time_and_leaves_some() {
        let of = |device_ns, device_distance_ns| Overheads {
            device_ns,
            device_distance_ns,
            ..Overheads::NONE
        };
        let charged = [0, 99, 100, 250].map(|within_ns| of(4, 100).of_device_ns(within_ns));
        assert_eq!(charged, [4, 4, 8, 12]);
        let devices = [(0, 0), (4, 5), (4, 4), (4, 0)];
        let leave_time = devices.map(|of_device| of(of_device.0, of_device.1).device_leaves_time());
        assert_eq!(leave_time, [true, true, false, false]);
    }

    #[test]
    fn what_was_measured_is_charged_with_its_margin() {
        let costs = MeasuredCosts {
            owed_ns: 7,
            late_ns: 2,
            ..MeasuredCosts::default()
        };
        let charged = |margin, at_once| Overheads::measured(&costs, margin, at_once).stated();
        assert_eq!(charged(0, 0), "0,9,7,0,0,0");
        assert_eq!(charged(50, 10), "0,14,11,2,0,0");
    }
}
