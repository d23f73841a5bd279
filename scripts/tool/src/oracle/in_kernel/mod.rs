//! Reference schedules on the bare machine: the kernel against the oracle.
//!
//! The app `replay` runs the cases, all that have the same number of cores in
//! one boot; what happened is in their traces, which are compared here. For every
//! instance start and finish have to be near the reference, the number of
//! preemptions equal; for every job the release and whether it missed equal, the
//! finish near. *Near* is within a tolerance, a fraction of a unit below a half,
//! so the order of what is a unit apart in the reference is compared, too.
//!
//! What is done about the difference between a model and a machine, and what
//! the tolerance is for:
//!
//! - *The kernel takes time*, microseconds for every decision and switch, more
//!   with more cores. That shifts starts, and is most of the tolerance. So that
//!   it does not add up along chains of instances, execution times include it: a
//!   unit of execution lasts up to the end of a unit of time (`replay::Scale`).
//! - *Events that coincide* in the model come one after the other on a machine,
//!   in an order that means nothing. A decision between two of them is right by
//!   the rules and still not the reference's: it would start an instance that
//!   the model does not, and without preemption that one keeps its core.
//!   The kernel therefore takes events less than a *window* apart for one
//!   instant (`Machine::set_coincidence`): it decides so much later, which is
//!   the other part of the tolerance. With a window of 0 it decides at once, as
//!   it does in apps; cases in which nothing coincides pass that way too.
//! - *Completions come before releases* of the same instant, and a finish at the
//!   deadline is no miss: execution ends a *guard* before the unit of time does.
//! - *Functions may compute* at the beginning of each unit of execution, and only then hold
//!   their cores (`replay::Computing`). Where cores take turns, all of them are through
//!   after half a unit, so that the schedule stays what it is.

mod boots;
mod command;
#[cfg(test)]
mod tests;

use std::time::Duration;

use replay::{Case, Scale};

use super::schedules::Deviation;
use crate::qemu::{Machine, Mode};

pub use boots::run;
pub(super) use command::command;
pub use command::texts_of_cases;

/// How cases are run and compared.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// What time means.
    pub mode: Mode,
    /// The board.
    pub machine: Machine,
    /// The length of a unit, in microseconds.
    pub unit_us: u64,
    /// How much before the end of a unit of time a unit of execution ends.
    pub guard_us: u64,
    /// Events less than this apart count as one instant.
    pub window_us: u64,
    /// How far a start or finish may be from the reference, in percent of a unit.
    pub tolerance_percent: u64,
    /// Whether cores really compute in each unit of execution.
    pub computes: bool,
}

/// What became of one case.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The case's name.
    pub name: String,
    /// Its number of cores.
    pub cores: u32,
    /// How near it came, or the first difference, in one line.
    pub outcome: Result<Deviation, String>,
}

impl Settings {
    /// Returns the settings for a unit: a guard of a 500th and a window of a
    /// 100th of it, and a tolerance of 2 %, deterministic, on a microvm.
    #[must_use]
    pub fn for_unit(unit_us: u64) -> Self {
        Self {
            mode: Mode::Deterministic,
            machine: Machine::Microvm,
            unit_us,
            guard_us: unit_us / 500,
            window_us: unit_us / 100,
            tolerance_percent: 2,
            computes: false,
        }
    }

    /// Lets cores compute. As events then wait for others' turns, guard and window are a
    /// 40th of a unit, and the tolerance is 5 %.
    #[must_use]
    pub fn computing(self) -> Self {
        Self {
            guard_us: self.unit_us / 40,
            window_us: self.unit_us / 40,
            tolerance_percent: 5,
            computes: true,
            ..self
        }
    }

    fn scale(&self) -> Scale {
        Scale {
            unit_ns: self.unit_us.saturating_mul(1000),
            guard_ns: self.guard_us.saturating_mul(1000),
        }
    }

    fn tolerance_ns(&self) -> u64 {
        self.unit_us.saturating_mul(10 * self.tolerance_percent)
    }

    /// Returns how long a boot with these cases may take in wall time.
    fn limit(&self, cases: &[&Case]) -> Duration {
        const FOR_BOOT: Duration = Duration::from_secs(120);
        const FOR_CASE: Duration = Duration::from_secs(5);
        let count = u32::try_from(cases.len()).unwrap_or(u32::MAX);
        let finishes = |case: &&Case| case.instances.values().map(|times| times.finish_ns).max();
        let units = cases.iter().filter_map(finishes);
        let real = match self.mode {
            Mode::Deterministic => Duration::ZERO,
            Mode::Kvm | Mode::Threads => Duration::from_micros(self.unit_us)
                .saturating_mul(u32::try_from(units.sum::<u64>()).unwrap_or(u32::MAX)),
        };
        FOR_BOOT + FOR_CASE.saturating_mul(count) + real.saturating_mul(2)
    }
}
