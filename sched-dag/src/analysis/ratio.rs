//! Sums of fractions, exact where possible, else rounded up.
//!
//! Utilisations are sums of `volume / period`. Such a sum is kept as a reduced fraction, until
//! periods without common factors outgrow the fraction. From then on the sum is a multiple of
//! 2^-40, with each further term rounded up. Rounding up can only turn "fits" into "does not fit",
//! and only for a set within `n * 2^-40` of the limit.

use core::cmp::Ordering;

use crate::order::sort;

/// A non-negative rational number, or an upper approximation of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ratio {
    pub(super) numerator: u128,
    pub(super) denominator: u128,
}

/// The limit of numerators and denominators, so that a product of two of them and of a core count
/// fits into 128 bits.
const LIMIT: u128 = 1 << 48;

/// The denominator of an approximation.
const UNIT: u128 = 1 << 40;

impl Ratio {
    /// Returns `numerator / denominator`, rounded up if necessary, or `None` for a denominator of 0
    /// or a value of 2^8 or more that needs rounding.
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

/// Returns the greatest common divisor (Euclid), 0 only of 0 and 0.
pub(crate) fn greatest_common_divisor(mut one: u128, mut other: u128) -> u128 {
    while other != 0 {
        (one, other) = (other, one % other);
    }
    one
}

#[cfg(test)]
mod tests {
    use super::*;

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
