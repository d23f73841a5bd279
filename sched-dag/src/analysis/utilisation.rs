//! Tests of whole sets by their utilisation: they bound no response time, but vouch for
//! deadlines.
//!
//! # Capacity-augmentation tests: global EDF and RM, implicit deadlines
//!
//! J. Li, J.-J. Chen, K. Agrawal, C. Lu, C. Gill, A. Saifullah, "Analysis of
//! Federated and Global Scheduling for Parallel Real-Time Tasks", ECRTS 2014,
//! doi:10.1109/ECRTS.2014.23. A set is schedulable if its total utilisation is
//! at most `m / b` and each length at most `D / b`, with
//!
//! - global EDF: `b = (3 - 2/m + sqrt(5 - 8/m + 4/m^2)) / 2`,
//! - global RM: `b = 2 + sqrt(3)`.
//!
//! Roots are avoided: `p/q >= b` exactly if `p/q` is right of the larger root
//! of the polynomial that `b` solves, which integers can tell:
//! `m p^2 - (3m - 2) p q + (m - 1) q^2 >= 0` and `2 m p >= (3m - 2) q` for EDF,
//! `p^2 - 4 p q + q^2 >= 0` and `p >= 2 q` for RM.
//!
//! Assumes: preemptive, `D = T` for every DAG; for RM priorities by period, one
//! a DAG. Linear in the number of DAGs, but accepts few sets.
//!
//! # Speed-up based tests: global EDF and DM, any deadlines
//!
//! V. Bonifaci, A. Marchetti-Spaccamela, S. Stiller, A. Wiese, "Feasibility
//! Analysis in the Sporadic DAG Task Model", ECRTS 2013,
//! doi:10.1109/ECRTS.2013.32:
//!
//! - EDF (Theorem 21): each length at most `D / 3` and the sum of
//!   `volume / min(T, D)` at most `(m + 1/2) / 3`;
//! - DM (Theorem 22): `D / 5` and `(m + 1/4) / 5`; if `D <= T` for every DAG
//!   (Theorem 23): `D / 4` and `(m + 1/3) / 4`.
//!
//! Assumes: preemptive; for DM priorities by relative deadline, one a DAG. The
//! theorems let jobs of one subtask run side by side; here a subtask is
//! sequential over its own jobs. With `D <= T` an accepted set never has two
//! jobs of a DAG at once, so that is the same; with `D > T` it is not proven
//! for this model, and the verdict at commit does not use it there.
//!
//! # Sums of fractions, exact where possible, else rounded up
//!
//! Utilisation tests compare `sum of volume / period` with a constant. The sum
//! is kept as a reduced fraction; periods without common factors may outgrow
//! it, and from then on it is a multiple of 2^-40, each further term rounded
//! up. Rounding up can only turn "accepted" into "not accepted", and only for a
//! set within `n * 2^-40` of the limit.

use core::cmp::Ordering;

use super::set::constrained;
use super::task::Task;
use crate::order::sort;

/// Tests global EDF. `None`: does not apply (a DAG has `D != T` or waits, or there are
/// no cores); `Some(false)`: not proven.
#[must_use]
pub fn gedf_capacity(tasks: &[&Task], cores: u32) -> Option<bool> {
    let m = i128::from(cores);
    accepts(tasks, cores, |p, q| {
        let square = m.checked_mul(p.checked_mul(p)?)?;
        let mixed = (3 * m - 2).checked_mul(p.checked_mul(q)?)?;
        let rest = (m - 1).checked_mul(q.checked_mul(q)?)?;
        let right_of_both = (2 * m).checked_mul(p)? >= (3 * m - 2).checked_mul(q)?;
        Some(square.checked_sub(mixed)?.checked_add(rest)? >= 0 && right_of_both)
    })
}

/// Tests global RM. `None`: does not apply (a DAG has `D != T` or waits, or there are no
/// cores); `Some(false)`: not proven.
#[must_use]
pub fn grm_capacity(tasks: &[&Task], cores: u32) -> Option<bool> {
    accepts(tasks, cores, |p, q| {
        let square = p.checked_mul(p)?;
        let mixed = p.checked_mul(q)?.checked_mul(4)?;
        let rest = q.checked_mul(q)?;
        Some(square.checked_sub(mixed)?.checked_add(rest)? >= 0 && p >= q.checked_mul(2)?)
    })
}

/// Applies the test, where `reaches(p, q)` tells whether `p/q >= b`, or `None`
/// on overflow, which counts as not proven.
fn accepts(
    tasks: &[&Task],
    cores: u32,
    reaches: impl Fn(i128, i128) -> Option<bool>,
) -> Option<bool> {
    let implicit = |task: &&Task| task.relative_deadline_ns() == task.period_ns();
    if cores == 0 || !tasks.iter().all(implicit) || tasks.iter().any(|task| task.has_waits()) {
        return None;
    }
    let reaches = |numerator: u128, denominator: u128| {
        let p = i128::try_from(numerator).ok()?;
        reaches(p, i128::try_from(denominator).ok()?)
    };
    // D / length >= b, as length / D rounded up.
    let short = tasks.iter().all(|task| {
        Ratio::new(task.length_ns().into(), task.relative_deadline_ns().into())
            .and_then(|ratio| reaches(ratio.denominator, ratio.numerator))
            .unwrap_or(false)
    });
    // m / U >= b.
    let utilisation = tasks
        .iter()
        .map(|task| (task.volume_ns(), task.period_ns()));
    let light = Ratio::sum(utilisation)
        .and_then(|sum| reaches(u128::from(cores) * sum.denominator, sum.numerator))
        .unwrap_or(false);
    Some(short && light)
}

/// Tests global EDF (Theorem 21); refuses DAGs that wait.
#[must_use]
pub fn bonifaci_edf(tasks: &[&Task], cores: u32) -> bool {
    is_light(tasks, 3, 2 * u128::from(cores) + 1, 6)
}

/// Tests global DM (Theorem 23 if `D <= T` for every DAG, else Theorem 22); refuses DAGs that wait.
#[must_use]
pub fn bonifaci_dm(tasks: &[&Task], cores: u32) -> bool {
    let m = u128::from(cores);
    if constrained(tasks, cores) {
        is_light(tasks, 4, 3 * m + 1, 12)
    } else {
        is_light(tasks, 5, 4 * m + 1, 20)
    }
}

fn is_light(tasks: &[&Task], part: u128, numerator: u128, denominator: u128) -> bool {
    let short = |task: &&Task| {
        part * u128::from(task.length_ns()) <= u128::from(task.relative_deadline_ns())
    };
    let density = |task: &&Task| {
        let shorter = task.period_ns().min(task.relative_deadline_ns());
        (task.volume_ns(), shorter)
    };
    let waits = |task: &&Task| task.has_waits();
    !tasks.iter().any(waits)
        && tasks.iter().all(short)
        && Ratio::sum(tasks.iter().map(density))
            .is_some_and(|sum| sum.at_most(numerator, denominator))
}

/// A non-negative rational number, or an upper approximation of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ratio {
    pub(super) numerator: u128,
    pub(super) denominator: u128,
}

/// Numerators and denominators stay below this, so that a product of two of
/// them and of a core count fits into 128 bits.
const LIMIT: u128 = 1 << 48;

/// The denominator of an approximation.
const UNIT: u128 = 1 << 40;

impl Ratio {
    /// Returns `numerator / denominator`, rounded up if it must be, or `None`
    /// for a denominator of 0 or a value of 2^8 or more that needs rounding.
    pub(super) fn new(numerator: u128, denominator: u128) -> Option<Self> {
        let divisor = greatest_common_divisor(numerator, denominator);
        Self {
            numerator: numerator.checked_div(divisor)?,
            denominator: denominator.checked_div(divisor)?,
        }
        .fitted()
    }

    /// Returns the sum of fractions, or `None` as [`new`](Self::new) does.
    pub(super) fn sum(fractions: impl Iterator<Item = (u64, u64)>) -> Option<Self> {
        let mut sum = Self {
            numerator: 0,
            denominator: 1,
        };
        for (numerator, denominator) in fractions {
            let term = Self::new(numerator.into(), denominator.into())?;
            // Both are below 2^48 (terms and sums alike), products below 2^96.
            sum = Self::new(
                sum.numerator * term.denominator + term.numerator * sum.denominator,
                sum.denominator * term.denominator,
            )?;
        }
        Some(sum)
    }

    /// Reports whether this is at most `numerator / denominator`, both below 2^64.
    pub(super) fn at_most(self, numerator: u128, denominator: u128) -> bool {
        self.numerator * denominator <= numerator * self.denominator
    }

    fn fitted(self) -> Option<Self> {
        if self.numerator < LIMIT && self.denominator < LIMIT && self.denominator > 0 {
            return Some(self);
        }
        let (whole, part) = (
            self.numerator.checked_div(self.denominator)?,
            self.numerator % self.denominator,
        );
        // Of the part only the first bits matter; shifting rounds it up.
        let shift = 80_u32.saturating_sub(self.denominator.leading_zeros());
        let scaled = ((part >> shift) + 1) * UNIT;
        let numerator = whole.checked_mul(UNIT)? + scaled.div_ceil(self.denominator >> shift);
        (numerator < LIMIT).then_some(Self {
            numerator,
            denominator: UNIT,
        })
    }
}

/// Returns the greatest common divisor (Euclid), 0 only of 0 and 0.
/// Sorts positions by their fractions, the largest first; equal ones stay in their order.
pub(super) fn sort_largest_first(positions: &mut [usize], of: impl Fn(usize) -> (u64, u64)) {
    let wide = |position: usize| {
        let (numerator, denominator) = of(position);
        (u128::from(numerator), u128::from(denominator))
    };
    sort(positions, &mut |one, other| -> Ordering {
        let (one, other) = (wide(one), wide(other));
        (other.0 * one.1).cmp(&(one.0 * other.1))
    });
}

fn greatest_common_divisor(mut one: u128, mut other: u128) -> u128 {
    while other != 0 {
        (one, other) = (other, one % other);
    }
    one
}

#[cfg(test)]
mod tests {
    use super::{Ratio, *};

    fn copies(count: usize) -> Vec<Task> {
        let diamond = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let one = Task::new(9, 9, vec![1, 2, 2, 1], &diamond).unwrap();
        vec![one; count]
    }

    #[test]
    fn e7_two_copies_pass_three_do_not() {
        for (count, expected) in [(1, true), (2, true), (3, false)] {
            let copies = copies(count);
            let tasks: Vec<&Task> = copies.iter().collect();
            assert_eq!(gedf_capacity(&tasks, 4), Some(expected));
        }
    }

    #[test]
    fn one_core_edf_is_exact() {
        let chains = [3, 3, 3].map(|period| Task::new(period, period, vec![1], &[]).unwrap());
        let tasks: Vec<&Task> = chains.iter().collect();
        assert_eq!(gedf_capacity(&tasks, 1), Some(true));
        assert_eq!(
            gedf_capacity(&[tasks[0], tasks[1], tasks[2], tasks[0]], 1),
            Some(false)
        );
    }

    #[test]
    fn rate_monotonic_needs_a_factor_of_two_plus_root_three() {
        // 2 + sqrt(3) = 3.7320...
        let single = |wcet, period| Task::new(period, period, vec![wcet], &[]).unwrap();
        assert_eq!(grm_capacity(&[&single(1000, 3733)], 1), Some(true));
        assert_eq!(grm_capacity(&[&single(1000, 3732)], 1), Some(false));
        let constrained = Task::new(10, 9, vec![1], &[]).unwrap();
        assert_eq!(grm_capacity(&[&constrained], 1), None);
    }

    #[test]
    fn limits_are_inclusive() {
        // m = 1: EDF accepts density 1/2 and length D/3 exactly.
        let task =
            |wcets: Vec<u64>, period, deadline| Task::new(period, deadline, wcets, &[]).unwrap();
        assert!(bonifaci_edf(&[&task(vec![2, 1], 6, 6)], 1));
        assert!(!bonifaci_edf(&[&task(vec![2, 2], 6, 6)], 1));
        assert!(!bonifaci_edf(&[&task(vec![3], 6, 6)], 1));
        // DM, m = 1: density 1/3 with D <= T, 1/4 otherwise.
        assert!(bonifaci_dm(&[&task(vec![2, 2], 12, 12)], 1));
        assert!(!bonifaci_dm(&[&task(vec![2, 2], 12, 13)], 1));
        assert!(bonifaci_dm(&[&task(vec![2, 1], 12, 13)], 1));
    }

    #[test]
    fn sums_are_exact_or_slightly_above() {
        let thirds = Ratio::sum([(1, 3), (1, 3), (1, 3)].into_iter()).unwrap();
        assert!(thirds.at_most(1, 1) && !thirds.at_most(99, 100));
        let primes = [1_000_003, 1_000_033, 1_000_037, 999_983, 999_979];
        let sum = Ratio::sum(primes.map(|period| (period - 1, period)).into_iter()).unwrap();
        assert!(!sum.at_most(4_999_994, 1_000_000));
        assert!(sum.at_most(5, 1));
        let huge = Ratio::sum([(u64::MAX - 1, u64::MAX), (1, 3)].into_iter()).unwrap();
        assert!(!huge.at_most(4, 3 + 1) && huge.at_most(1_333_334, 1_000_000));
        assert_eq!(Ratio::sum([(1, 0)].into_iter()), None);
    }
}
