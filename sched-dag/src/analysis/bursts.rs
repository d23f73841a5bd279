//! Bursts: what steps take in which many instances become ready, whatever their ranks.
//!
//! Each instance is charged for a step in which few instances become ready (`overheads`).
//! For each of them it is longer by `ready` at most, and as long as it lasts it may keep the
//! cores from any instance, a more urgent one too. So in a window of length `L` each core loses,
//! beyond the charges, no more than
//!
//! `E(L) = sum over all DAGs on them of ((L + late + carry) / T + 1) burst` (floor)
//!
//! with two bursts a job: `ready` for each source, with `carry = 0`, and `ready` for all that
//! one completion makes ready beyond [`WIDE`], with `carry = D`, until which jobs complete. Steps follow one another, and each loss counts in one of them. A release that waits
//! for steps before its own is late, at most by `late = charge + E(late)` with `late = 0` on
//! the right.
//!
//! In the equations all cores are busy for so long. What DAGs execute (`workload`) is not more
//! for it. A DAG without bound counts as if it kept up.

use alloc::vec::Vec;

use super::answer::Settings;
use super::workload::Piece;
use crate::ids::SubtaskId;
use crate::task_set::Dag;

/// The most that one completion makes ready, for which each instance is charged already.
const WIDE: usize = 16;

/// The most evaluations of a sum, which then counts as endless.
const STEP_LIMIT: u32 = 1024;

/// The bursts of the DAGs that share cores.
#[derive(Clone, Debug, Default)]
pub(super) struct Bursts {
    /// How late a release is at most.
    pub(super) late_ns: u64,
    /// `T`, `carry` and `burst`.
    repeated: Vec<[u128; 3]>,
}

impl Bursts {
    /// Returns those of DAGs, be they analysable or not.
    pub(super) fn of<'a>(dags: impl Iterator<Item = &'a Dag>, settings: &Settings) -> Self {
        let mut bursts = Self::default();
        if settings.overheads.ready_ns == 0 {
            return bursts;
        }
        for dag in dags {
            let ids = (0..).map(SubtaskId).take(dag.subtasks().len());
            let beyond = ids.map(|id| dag.successors(id).len().saturating_sub(WIDE));
            let period = u128::from(dag.period_ns());
            let deadline = u128::from(dag.relative_deadline_ns());
            for (carry, count) in [(0, dag.sources().len()), (deadline, beyond.sum())] {
                let takes = count as u128 * u128::from(settings.overheads.ready_ns);
                let same = |other: &&mut [u128; 3]| other[..2] == [period, carry];
                match bursts.repeated.iter_mut().find(same) {
                    Some(other) => other[2] += takes,
                    None => bursts.repeated.push([period, carry, takes]),
                }
            }
        }
        bursts.repeated.retain(|burst| burst[2] > 0);
        let charge_ns = settings.overheads.of_an_instance_ns(settings.preemption);
        let late_ns = charge_ns.and_then(|charge_ns| bursts.after(charge_ns));
        bursts.late_ns = late_ns.unwrap_or(u64::MAX);
        bursts
    }

    pub(super) fn are_none(&self) -> bool {
        self.repeated.is_empty()
    }

    /// Returns `E` of a window.
    pub(super) fn during(&self, window_ns: u128) -> u128 {
        let time = window_ns.saturating_add(self.late_ns.into());
        let takes = |&[period, carry, burst]: &[u128; 3]| {
            ((time.saturating_add(carry)) / period + 1).saturating_mul(burst)
        };
        let takes = self.repeated.iter().map(takes);
        takes.fold(0, u128::saturating_add)
    }

    /// Returns what so many cores lose in a window.
    pub(super) fn on(&self, cores: usize, window_ns: u64) -> Piece {
        let time = u128::from(window_ns) + u128::from(self.late_ns);
        let spans = self.repeated.iter();
        let spans = spans.map(|[period, carry, _]| period - (time + carry) % period);
        Piece {
            value: self.during(window_ns.into()).saturating_mul(cores as u128),
            slope: 0,
            span: spans.min(),
        }
    }

    /// Returns the time after which so much time is left besides the losses.
    pub(super) fn after(&self, time_ns: u64) -> Option<u64> {
        let mut window_ns = time_ns;
        for _ in 0..STEP_LIMIT {
            let lost_ns = u64::try_from(self.during(window_ns.into())).ok()?;
            match time_ns.checked_add(lost_ns)? {
                same if same == window_ns => return Some(window_ns),
                longer => window_ns = longer,
            }
        }
        None
    }
}
