//! What an approximate synchronizer can be told.

use alloc::vec;
use alloc::vec::Vec;
use core::num::NonZeroUsize;

/// The parameters of [`ApproximateTime`](super::ApproximateTime).
///
/// ```
/// use core::num::NonZeroUsize;
/// use pub_sub::Parameters;
///
/// let queue_size = NonZeroUsize::new(10).expect("not 0");
/// let parameters = Parameters::new(3, queue_size)
///     .max_interval_ns(30_000_000)
///     .lower_bound_ns(0, 25_000_000);
/// ```
#[derive(Clone, Debug)]
pub struct Parameters {
    pub(super) queue_size: NonZeroUsize,
    /// `None` for no limit.
    pub(super) max_interval_ns: Option<u64>,
    pub(super) age_penalty: AgePenalty,
    /// One a topic.
    pub(super) lower_bounds_ns: Vec<u64>,
}

impl Parameters {
    /// Starts with the defaults: no longest interval, an age penalty of 0.1, lower
    /// bounds of 0. At most `queue_size` messages of a topic are held between
    /// arrivals.
    ///
    /// # Panics
    ///
    /// If `topics` is 0.
    #[must_use]
    pub fn new(topics: usize, queue_size: NonZeroUsize) -> Self {
        assert!(
            topics > 0,
            "a synchronizer needs a topic; give it at least 1"
        );
        Self {
            queue_size,
            max_interval_ns: None,
            age_penalty: AgePenalty::default(),
            lower_bounds_ns: vec![0; topics],
        }
    }

    /// Limits how far the earliest and the latest stamp of a first candidate may be
    /// apart, itself included. Later candidates are not tested: they are better.
    #[must_use]
    pub fn max_interval_ns(mut self, max_interval_ns: u64) -> Self {
        self.max_interval_ns = Some(max_interval_ns);
        self
    }

    /// Sets how much a later set has to be better by.
    #[must_use]
    pub fn age_penalty(mut self, age_penalty: AgePenalty) -> Self {
        self.age_penalty = age_penalty;
        self
    }

    /// Promises that two successive stamps of a topic are at least this far apart,
    /// so that a set may be proved best without waiting for the next message. It is
    /// believed: a promise that is not kept changes which sets come out.
    ///
    /// # Panics
    ///
    /// If there is no such topic.
    #[must_use]
    pub fn lower_bound_ns(mut self, topic: usize, lower_bound_ns: u64) -> Self {
        let topics = self.lower_bounds_ns.len();
        assert!(
            topic < topics,
            "there is no topic {topic}; there are {topics}, counted from 0"
        );
        self.lower_bounds_ns[topic] = lower_bound_ns;
        self
    }
}

/// How much an older set is preferred to a newer one: a factor on the time by which
/// the newer one ends later. It is normally 1 or more; a smaller one prefers newer
/// sets.
///
/// The original multiplies by a floating-point 1 + p and rounds toward zero. Here
/// the factor is the exact value of such a number, M / 2^K, and the product is
/// exact too. A floating-point product would be wrong where it ties.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AgePenalty {
    /// M, from 1 to [`MOST_FACTOR`](Self::MOST_FACTOR).
    factor: i64,
    /// K, up to [`MOST_SHIFT`](Self::MOST_SHIFT).
    shift: u32,
}

impl AgePenalty {
    /// The largest M. Differences of stamps have at most 65 bits, with which the
    /// product stays below 2^127.
    pub const MOST_FACTOR: u64 = (1 << 62) - 1;

    /// The largest K.
    pub const MOST_SHIFT: u32 = 127;

    /// Returns the penalty whose factor 1 + p is `factor / 2^shift`, or `None` if
    /// one of them is out of range: M from 1 to [`MOST_FACTOR`](Self::MOST_FACTOR),
    /// K from 0 to [`MOST_SHIFT`](Self::MOST_SHIFT).
    ///
    /// ```
    /// use pub_sub::AgePenalty;
    /// assert!(AgePenalty::from_factor(3, 1).is_some(), "1 + 0.5");
    /// assert!(AgePenalty::from_factor(0, 1).is_none());
    /// ```
    #[must_use]
    pub const fn from_factor(factor: u64, shift: u32) -> Option<Self> {
        if factor == 0 || factor > Self::MOST_FACTOR || shift > Self::MOST_SHIFT {
            return None;
        }
        let factor = factor.cast_signed();
        Some(Self { factor, shift })
    }

    /// Multiplies a difference by the factor, rounded toward zero.
    pub(super) fn scaled(self, difference_ns: i128) -> i128 {
        let magnitude = (difference_ns.abs() * i128::from(self.factor)) >> self.shift;
        magnitude * difference_ns.signum()
    }
}

/// 0.1: the factor is the double nearest to 1.1.
impl Default for AgePenalty {
    fn default() -> Self {
        Self {
            factor: 2_476_979_795_053_773,
            shift: 51,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::AgePenalty;

    #[test]
    fn products_are_exact_and_round_toward_zero() {
        let half = AgePenalty::from_factor(3, 1).unwrap();
        assert_eq!((half.scaled(3), half.scaled(-3)), (4, -4));
        let tenth = AgePenalty::default();
        assert_eq!((tenth.scaled(10), tenth.scaled(-10)), (11, -11));
        assert_eq!(tenth.scaled(0), 0);
    }

    #[test]
    fn the_default_is_the_double_1_1() {
        let factor = AgePenalty::default().factor as f64 / 2f64.powi(51);
        assert_eq!(factor, 1.0 + 0.1);
    }

    #[test]
    fn the_largest_product_fits() {
        let most = AgePenalty::from_factor(AgePenalty::MOST_FACTOR, 0).unwrap();
        let difference_ns = i128::from(u64::MAX) * 2;
        assert!(most.scaled(difference_ns) > 0);
        assert!(most.scaled(-difference_ns) < 0);
        assert_eq!(AgePenalty::from_factor(1 << 62, 0), None);
        assert_eq!(AgePenalty::from_factor(1, 128), None);
    }
}
