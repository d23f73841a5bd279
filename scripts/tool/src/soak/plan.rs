//! What a soak run consists of: parts, and the boots that make them up.
//!
//! A *part* is one policy, one overrun policy and one load, for a number of
//! rounds. All parts use the same rounds, so the same DAG sets, as far as they
//! go: their figures can be compared. A *boot* is a few rounds of a part, few
//! enough that the serial log stays small.

use std::fmt;
use std::time::Duration;

use crate::qemu::Mode;
use crate::trace::bound;

/// What to run, and on what.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The parts.
    pub parts: Vec<Part>,
    /// The cores of each guest.
    pub cores: u64,
    /// The seed of all that is random.
    pub seed: u64,
    /// What time means.
    pub mode: Mode,
    /// The guest time in which a round releases jobs.
    pub round: Duration,
    /// The rounds of one boot.
    pub rounds_a_boot: u64,
    /// The first round of each part.
    pub first: u64,
    /// For how long an instance may wait for what it is owed.
    pub bound_ns: u64,
    /// How many guests run at the same time.
    pub side_by_side: usize,
}

/// Rounds of the same kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The guest's word: `static` or `edf`.
    pub policy: &'static str,
    /// The load in percent of the cores.
    pub load: u64,
    /// The guest's word: `queue`, `skip` or `abort`.
    pub overrun: &'static str,
    /// The guest's word: `hold` or `compute`, what an instance does while it executes.
    pub work: &'static str,
    /// How many rounds.
    pub rounds: u64,
}

/// The words for the two policies.
pub(super) const POLICIES: [&str; 2] = ["static", "edf"];

/// The words for what an instance does while it executes.
const WORKS: [&str; 2] = ["hold", "compute"];

/// The words for the overrun policies.
pub(super) const OVERRUNS: [&str; 3] = ["queue", "skip", "abort"];

impl Part {
    /// Reports whether faults, pauses and clusters are drawn. Not where instances compute: there
    /// cores take turns, and the report of a fault is a longer turn than a wait may be.
    pub(super) fn has_trouble(&self) -> bool {
        self.work == WORKS[0]
    }
}

impl fmt::Display for Part {
    /// Writes it as it is written for `--only`: `edf-130-skip`, `edf-90-queue-compute`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = format!("{}-{}-{}", self.policy, self.load, self.overrun);
        if self.work != WORKS[0] {
            text = format!("{text}-{}", self.work);
        }
        f.pad(&text)
    }
}

/// Returns for how long an instance may wait for what it is owed if nobody says
/// otherwise: some decisions and a switch, and where time is real, what the host
/// does meanwhile.
pub(super) fn usual_bound_ns(mode: Mode) -> u64 {
    match mode {
        Mode::Deterministic => bound::COUNTED_NS,
        Mode::Kvm => 10_000_000,
        Mode::Threads => 1_000_000_000,
    }
}

/// A few rounds of a part, in one boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boot<'p> {
    /// The part.
    pub part: &'p Part,
    /// The first round.
    pub first: u64,
    /// How many rounds.
    pub rounds: u64,
}

/// How long a plan is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Length {
    /// Guest seconds at the load that the machine can bear, half a policy.
    pub seconds: u64,
    /// Guest seconds of overload for each overrun policy, half a policy.
    pub overload_seconds: u64,
    /// Guest time of a round, at least a millisecond.
    pub round: Duration,
    /// The rounds of one boot.
    pub rounds_a_boot: u64,
}

impl Length {
    /// Ten minutes, and one of overload for each overrun policy.
    pub const LONG: Length = Length {
        seconds: 600,
        overload_seconds: 60,
        round: Duration::from_secs(5),
        rounds_a_boot: 3,
    };

    /// Some seconds, for a test.
    pub const SHORT: Length = Length {
        seconds: 4,
        overload_seconds: 3,
        round: Duration::from_millis(500),
        rounds_a_boot: 4,
    };
}

impl Plan {
    /// Makes the plan of a soak run: both policies at `load` percent, at `overload` percent
    /// with each overrun policy, and at `load` percent with instances that compute.
    #[must_use]
    pub fn new(length: Length, load: u64, overload: u64) -> Plan {
        let round_ms = u64::try_from(length.round.as_millis())
            .unwrap_or(u64::MAX)
            .max(1);
        let rounds = |seconds: u64| (seconds * 500).div_ceil(round_ms);
        let part = |policy, load, overrun, seconds| Part {
            policy,
            load,
            overrun,
            work: WORKS[0],
            rounds: rounds(seconds),
        };
        let mut parts: Vec<Part> = POLICIES
            .iter()
            .map(|policy| part(policy, load, OVERRUNS[0], length.seconds))
            .collect();
        for overrun in OVERRUNS {
            for policy in POLICIES {
                parts.push(part(policy, overload, overrun, length.overload_seconds));
            }
        }
        let seconds = length.overload_seconds;
        parts.extend(POLICIES.iter().map(|policy| Part {
            work: WORKS[1],
            ..part(policy, load, OVERRUNS[0], seconds)
        }));
        parts.retain(|part| part.rounds > 0);
        Plan {
            parts,
            cores: 4,
            seed: 1,
            mode: Mode::Deterministic,
            round: length.round,
            rounds_a_boot: length.rounds_a_boot,
            first: 0,
            bound_ns: usual_bound_ns(Mode::Deterministic),
            side_by_side: 1,
        }
    }

    /// Returns the boots, those of the first part first.
    pub fn boots(&self) -> impl Iterator<Item = Boot<'_>> {
        self.parts.iter().flat_map(move |part| {
            let end = self.first + part.rounds;
            let step = usize::try_from(self.rounds_a_boot)
                .unwrap_or(usize::MAX)
                .max(1);
            (self.first..end).step_by(step).map(move |first| Boot {
                part,
                first,
                rounds: self.rounds_a_boot.min(end - first),
            })
        })
    }

    /// Returns the number of all rounds.
    #[must_use]
    pub fn rounds(&self) -> u64 {
        self.parts.iter().map(|part| part.rounds).sum()
    }

    /// Returns the command that runs one round of a part again.
    #[must_use]
    pub fn command(&self, part: &Part, round: u64) -> String {
        let (seed, cores, mode) = (self.seed, self.cores, self.mode);
        format!(
            "./scripts/soak --only {part} --load {0} --overload {0} --first {round} --rounds 1 \
             --round-ms {1} --seed {seed} --cores {cores} --mode {mode} --bound-us {2}",
            part.load,
            self.round.as_millis(),
            self.bound_ns / 1000
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONG: &str = "static-90-queue 60, edf-90-queue 60, static-130-queue 6, edf-130-queue 6, \
                        static-130-skip 6, edf-130-skip 6, static-130-abort 6, edf-130-abort 6, \
                        static-90-queue-compute 6, edf-90-queue-compute 6";

    #[test]
    fn the_long_form_is_fourteen_minutes_the_short_one_sixteen_seconds() {
        let plan = Plan::new(Length::LONG, 90, 130);
        let parts = plan.parts.iter();
        let parts: Vec<_> = parts
            .map(|part| format!("{part} {}", part.rounds))
            .collect();
        assert_eq!(parts.join(", "), LONG);
        assert_eq!(plan.rounds() * plan.round.as_secs(), 840);
        let plan = Plan::new(Length::SHORT, 90, 130);
        assert_eq!(u128::from(plan.rounds()) * plan.round.as_millis(), 16_000);
    }

    #[test]
    fn boots_make_up_the_rounds() {
        let mut plan = Plan {
            first: 10,
            ..Plan::new(Length::SHORT, 90, 130)
        };
        plan.parts.truncate(1);
        plan.parts[0].rounds = 9;
        let boots: Vec<_> = plan.boots().map(|boot| (boot.first, boot.rounds)).collect();
        assert_eq!(boots, [(10, 4), (14, 4), (18, 1)]);
    }
}
