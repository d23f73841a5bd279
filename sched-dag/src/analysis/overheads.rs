//! Overheads: the time added to executions by the platform.
//!
//! The tests know execution times only. Measured costs of the platform are charged to the WCET of
//! each subtask, once for each of its segments:
//!
//! - two context switches, into the instance and out of the instance;
//! - one dispatch, the scheduler's own work at the instance's start or finish;
//! - where instances can be preempted, one inter-processor interrupt. An instance preempts at most
//!   one other, when it becomes ready, so the preempting instance pays. Its second switch is the
//!   switch back to the preempted instance.
//!
//! An entry of a table may [move](Overheads::of_a_move_ns) a member to an idle core, where the
//! member goes on at once. No instance is charged for a move; the bounds in `lent_cores` have a
//! term instead.
//!
//! These charges are for a step in which few instances become ready. Each instance that becomes
//! ready makes its step longer by `ready`, and any instance may be delayed; `workload` has this
//! term of the bounds.
//!
//! A *device* interrupts one core, and its driver keeps the device from interrupting again too
//! soon. No instance is charged for device interrupts; `workload` has their term, too.
//!
//! Not covered: timer interrupts, caches refilled after a preemption, bus contention. Measure WCETs
//! with all of them included. `docs/proving.md` gives the argument for the charges, and names its
//! unproven step.

use alloc::string::{String, ToString};

use crate::law::MeasuredCosts;
use crate::policy::Preemption;
use crate::task_set::Dag;

/// Defines the terms of [`Overheads`], each with the number of times a segment is charged: always,
/// and in addition where instances can be preempted. The last number says how often a move takes
/// the term.
macro_rules! overheads {
    ($(
        $(#[doc = $doc:literal])+
        $term:ident = $word:literal, segment $always:literal + $preemptive:literal, move $moved:literal;
    )+) => {
        // A recording has the sum for a segment and the sum for a move, and a reader takes the
        // latter as part of the former.
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

            /// Makes overheads from the numbers of their terms.
            pub const fn of_terms_ns([$($term),+]: [u64; Self::WORDS.len()]) -> Self {
                Self { $($term),+ }
            }

            /// Returns the numbers of the terms.
            pub const fn terms_ns(&self) -> [u64; Self::WORDS.len()] {
                [$(self.$term),+]
            }

            /// Returns the numbers as text, separated by commas.
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
    /// The time added to a step for each instance becoming ready, in nanoseconds.
    ready_ns = "readiness", segment 0 + 0, move 0;
    /// The longest interrupt of a device, with all work of its core for the device, in nanoseconds;
    /// 0: no device.
    device_ns = "device interrupt", segment 0 + 0, move 0;
    /// The least time between the beginnings of two such interrupts, in nanoseconds.
    device_distance_ns = "device distance", segment 0 + 0, move 0;
}

/// The origin of overheads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum OverheadSource {
    /// Stated by someone; 0 if nobody states them.
    #[default]
    Stated,
    /// The longest costs measured, with a margin.
    Measured {
        /// The number of instances dispatched during the measurement.
        dispatches: u64,
        /// The margin, in hundredths.
        margin_percent: u32,
    },
}

impl Overheads {
    /// Returns the charges for measured costs, with a margin in per cent.
    ///
    /// - *Dispatch*: the lateness of an instance's release plus once the longest time owed, the
    ///   time before the instance's first instruction.
    /// - *Interrupt*, where instances are preempted: once more the longest time owed, the time
    ///   before the next instruction of the preempted instance. An instance preempts at most one
    ///   other, when it becomes ready, so every resumption has a payer. The payer is more urgent
    ///   than the preempted instance, so a bound counts the charge there as interference.
    /// - *Ready*, if `at_once` instances became ready in one of the steps: the longest time owed
    ///   divided by `at_once`, because none of them can have taken more. With `at_once` 0 the term
    ///   is 0: costs measured in a run of the DAGs themselves include their longest steps.
    ///
    /// Work of the platform interrupting a running instance, such as a timer's or another core's,
    /// counts within the observed time of the interrupted call.
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
            // The longest time owed contains all other costs.
            ..Self::NONE
        }
    }

    /// Returns the charge of each segment, or `None` on overflow.
    pub fn of_an_instance_ns(&self, preemption: Preemption) -> Option<u64> {
        self.sum_ns(usize::from(preemption == Preemption::Enabled))
    }

    fn sum_ns(&self, column: usize) -> Option<u64> {
        let mut terms = self.terms_ns().into_iter().zip(Self::TIMES);
        terms.try_fold(0_u64, |sum, (ns, times)| {
            sum.checked_add(ns.checked_mul(times[column])?)
        })
    }

    /// Returns the time needed to go on with an instance on another core of its group, after an
    /// entry of a table has taken its core.
    pub fn of_a_move_ns(&self, preemption: Preemption) -> u64 {
        match preemption {
            Preemption::Enabled => self.sum_ns(2).unwrap_or(u64::MAX),
            Preemption::Disabled => 0,
        }
    }

    /// Returns the most time the device's interrupts keep its core, within a time in nanoseconds.
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

    /// Returns the overheads in a cluster of these DAGs, whose subtasks may enter sections of
    /// locks, on a machine of `cores` cores in all.
    ///
    /// An instance given a core may find another instance there inside a section: once at its
    /// start, and once when it goes on after a preemption, paid for by the preempting instance. An
    /// instance preempted while waiting for a section gives up its turn and waits anew.
    /// `docs/proving.md` has the argument.
    pub fn among(self, dags: &mut dyn Iterator<Item = &Dag>, cores: u32) -> Self {
        let (mut longest_ns, mut longest_wait_ns) = (0, 0);
        for of in dags.flat_map(Dag::locks) {
            longest_ns = of.longest_ns.unwrap_or(u64::MAX).max(longest_ns);
            longest_wait_ns = of.longest_wait_ns(cores).max(longest_wait_ns);
        }
        let sections_ns = longest_ns.saturating_mul(2).saturating_add(longest_wait_ns);
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
