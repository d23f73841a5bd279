//! A distribution of times by its order statistics.
//!
//! A [`Distribution`] has its values in ascending order, each with the number of its samples. The
//! values are either exact, or come from the *buckets* of a [`Histogram`]: then each value is the
//! upper end of a bucket, and no sample in the bucket is larger. Ranks are nearest ranks: the value
//! for a number of thousandths is the smallest one that at least so large a part of the samples
//! does not exceed.
//!
//! A [`Histogram`] counts values in *buckets*, in a fixed amount of memory. Values below 2^b are
//! exact; above, each doubling of the value is divided into 2^b buckets of equal width. So a bucket
//! is at most 1/2^b of its values wide, except for the last. A percentile is the largest value of
//! its bucket, or the maximum if smaller: never too small, and below 2^40 too large by that part at
//! most, with b = 5 by 3.2 %. The count, the minimum and the maximum are exact. Values from 2^40
//! on, 18 minutes in nanoseconds, share the last bucket, represented by the maximum.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use crate::order::sorted;

/// The samples of one quantity, in nanoseconds.
///
/// ```
/// use sched_dag::law::Distribution;
///
/// let latencies = Distribution::new([30, 10, 20, 40]);
/// assert_eq!((latencies.count(), latencies.min(), latencies.max()), (4, 10, 40));
/// assert_eq!((latencies.median(), latencies.p99()), (20, 40));
/// assert_eq!(Distribution::new([]).max(), 0);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Distribution {
    count: u64,
    min_ns: Option<u64>,
    /// In ascending order, each value with the number of its samples.
    values: Vec<(u64, u64)>,
}

impl Distribution {
    /// Makes a distribution of samples, given in any order.
    pub fn new(samples_ns: impl IntoIterator<Item = u64>) -> Self {
        let samples = samples_ns.into_iter().map(|ns| (ns, 1));
        Self::counted(u64::MAX, samples.collect())
    }

    /// Makes a distribution of counted samples, in any order: values, and the number of samples for
    /// each, none larger than the value. `min_ns` is the smallest sample.
    ///
    /// ```
    /// use sched_dag::law::Distribution;
    ///
    /// let latencies = Distribution::counted(9, vec![(15, 1), (11, 2)]);
    /// assert_eq!((latencies.min(), latencies.median(), latencies.max()), (9, 11, 15));
    /// ```
    pub fn counted(min_ns: u64, values: Vec<(u64, u64)>) -> Self {
        let mut values = sorted(&values);
        values.dedup_by(|later, before| {
            let is_same = later.0 == before.0;
            before.1 += if is_same { later.1 } else { 0 };
            is_same
        });
        Self {
            count: values.iter().map(|(_, count)| count).sum(),
            min_ns: values.first().map(|&(first_ns, _)| min_ns.min(first_ns)),
            values,
        }
    }

    /// Adds the samples of another distribution.
    ///
    /// ```
    /// use sched_dag::law::Distribution;
    ///
    /// let mut latencies = Distribution::new([10, 20]);
    /// latencies.add(&Distribution::new([20, 30]));
    /// assert_eq!(latencies, Distribution::new([10, 20, 20, 30]));
    /// ```
    pub fn add(&mut self, other: &Self) {
        let min_ns = [self.min_ns, other.min_ns].into_iter().flatten().min();
        let values = self.values().chain(other.values()).collect();
        *self = Self::counted(min_ns.unwrap_or(0), values);
    }

    /// Returns the number of samples.
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Returns the values in ascending order, each with the number of its samples. The last value
    /// is the largest sample.
    ///
    /// ```
    /// use sched_dag::law::Distribution;
    ///
    /// let latencies = Distribution::new([20, 10, 20]);
    /// assert!(latencies.values().eq([(10, 1), (20, 2)]));
    /// ```
    pub fn values(&self) -> impl Iterator<Item = (u64, u64)> + Clone {
        self.values.iter().copied()
    }

    /// Returns the smallest value that at least `thousandths` thousandths of the samples do not
    /// exceed (nearest rank); 0 without samples.
    ///
    /// ```
    /// use sched_dag::law::Distribution;
    ///
    /// let latencies = Distribution::new(1..=200);
    /// assert_eq!(latencies.per_mille(900), 180);
    /// ```
    pub fn per_mille(&self, thousandths: u64) -> u64 {
        let rank = u128::from(self.count) * u128::from(thousandths);
        let rank = rank.div_ceil(1000).max(1);
        let mut so_far = 0;
        let found = self.values().find(|&(_, count)| {
            so_far += u128::from(count);
            so_far >= rank
        });
        found.map_or(self.max(), |(ns, _)| ns)
    }

    /// Returns the smallest sample, or 0 without samples.
    pub fn min(&self) -> u64 {
        self.min_ns.unwrap_or(0)
    }

    /// Returns the middle sample, the lower one of two, or 0 without samples.
    pub fn median(&self) -> u64 {
        self.per_mille(500)
    }

    /// Returns the 99th percentile, or 0 without samples.
    pub fn p99(&self) -> u64 {
        self.per_mille(990)
    }

    /// Returns the largest sample, or 0 without samples.
    pub fn max(&self) -> u64 {
        self.values.last().map_or(0, |(ns, _)| *ns)
    }
}

/// From this power of two on, all values share one bucket.
const LAST_BIT: u32 = 40;

/// A histogram: the number of values in each bucket.
///
/// ```
/// use sched_dag::law::Histogram;
///
/// let mut times = Histogram::new(5);
/// (1..=1000).for_each(|time| times.add(time));
/// let times = times.distribution();
/// assert_eq!((times.count(), times.min(), times.max()), (1000, 1, 1000));
/// // 500 is in the bucket from 496 to 503.
/// assert_eq!(times.per_mille(500), 503);
/// ```
#[derive(Clone, Debug)]
pub struct Histogram {
    /// The logarithm of the number of buckets in a doubling.
    bits: u32,
    counts: Box<[u32]>,
    count: u64,
    min: u64,
    max: u64,
}

impl Histogram {
    /// Makes an empty histogram with `2^bits` buckets in each doubling.
    ///
    /// # Panics
    ///
    /// If `bits` is more than 16.
    pub fn new(bits: u32) -> Self {
        Self {
            bits,
            counts: vec![0; Self::buckets(bits)].into_boxed_slice(),
            count: 0,
            min: u64::MAX,
            max: 0,
        }
    }

    /// Returns the size of a histogram in bytes.
    pub const fn size_of(bits: u32) -> usize {
        size_of::<Self>() + Self::buckets(bits) * size_of::<u32>()
    }

    const fn buckets(bits: u32) -> usize {
        assert!(
            bits <= 16,
            "a histogram of more than 2^16 buckets a doubling"
        );
        ((LAST_BIT - bits + 1) as usize) << bits
    }

    /// Counts a value.
    pub fn add(&mut self, value: u64) {
        let bucket = self.bucket(value);
        self.counts[bucket] = self.counts[bucket].saturating_add(1);
        self.count += 1;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
    }

    #[allow(clippy::cast_possible_truncation, reason = "buckets are few")]
    fn bucket(&self, value: u64) -> usize {
        let value = value.min((1 << LAST_BIT) - 1);
        // The binary logarithm of the bucket's width.
        let shift = (u64::BITS - value.leading_zeros()).saturating_sub(self.bits + 1);
        ((u64::from(shift) << self.bits) + (value >> shift)) as usize
    }

    /// Returns the largest value of a bucket.
    fn top(&self, bucket: usize) -> u64 {
        let bucket = bucket as u64;
        let shift = (bucket >> self.bits).saturating_sub(1);
        let first = (bucket - (shift << self.bits)) << shift;
        first + (1 << shift) - 1
    }

    /// Returns the distribution. Its values are the largest values of the non-empty buckets; the
    /// last is the maximum.
    pub fn distribution(&self) -> Distribution {
        let counts = self.counts.iter().copied().enumerate();
        let filled = counts.filter(|(_, count)| *count > 0);
        let values = filled.map(|(bucket, count)| match bucket + 1 == self.counts.len() {
            true => (self.max, count.into()),
            false => (self.top(bucket).min(self.max), count.into()),
        });
        let mut distribution = Distribution::counted(self.min, values.collect());
        // The counters of buckets saturate, so their sum may be too small.
        distribution.count = self.count;
        distribution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_the_nearest_rank() {
        let hundred = Distribution::new((1..=100).rev());
        assert_eq!((hundred.min(), hundred.median()), (1, 50));
        assert_eq!((hundred.p99(), hundred.max()), (99, 100));
        let three = Distribution::new([30, 10, 20]);
        assert_eq!(
            (three.min(), three.median(), three.p99(), three.max()),
            (10, 20, 30, 30)
        );
        assert_eq!((three.per_mille(0), three.per_mille(2000)), (10, 30));
    }

    #[test]
    fn has_only_zeros_without_samples_and_adds_none() {
        let none = Distribution::default();
        assert_eq!(none, Distribution::new([]));
        assert_eq!(
            (none.count(), none.min(), none.median(), none.max()),
            (0, 0, 0, 0)
        );
        let counted = Distribution::counted(4, vec![(7, 2)]);
        for [mut first, second] in [[none.clone(), counted.clone()], [counted.clone(), none]] {
            first.add(&second);
            assert_eq!(first, counted);
        }
    }

    #[test]
    fn a_value_is_in_one_bucket_and_that_is_as_wide_as_stated() {
        for bits in [0, 3, 5] {
            let histogram = Histogram::new(bits);
            let values = (0..2000)
                .chain((11..LAST_BIT).flat_map(|bit| {
                    [(1 << bit) - 1, 1 << bit, (1 << bit) + 1, (1 << bit) * 3 / 2]
                }));
            for value in values {
                let bucket = histogram.bucket(value);
                let top = histogram.top(bucket);
                let below = bucket.checked_sub(1).map(|before| histogram.top(before));
                assert!(value <= top && below.is_none_or(|below| below < value));
                assert!(top - value <= value >> bits, "{value} {top}");
            }
            assert!(histogram.bucket(u64::MAX) < histogram.counts.len());
        }
    }

    #[test]
    fn percentiles_are_those_of_the_sorted_values_and_a_bucket_at_most() {
        let mut histogram = Histogram::new(5);
        let mut values: Vec<u64> = (0..5000u64).map(|n| n * n * 7 % 1_000_003).collect();
        values.iter().for_each(|&value| histogram.add(value));
        let distribution = histogram.distribution();
        values.sort_unstable();
        for (thousandths, rank) in [(1, 5), (500, 2500), (990, 4950), (999, 4995), (1000, 5000)] {
            let exact = values[rank - 1];
            let found = distribution.per_mille(thousandths);
            assert!(exact <= found && found - exact <= exact >> 5);
        }
        let (min, max) = (values[0], values[4999]);
        assert_eq!((distribution.min(), distribution.max()), (min, max));
    }

    #[test]
    fn buckets_have_all_values_and_end_with_the_maximum() {
        let mut histogram = Histogram::new(2);
        let none = histogram.distribution();
        assert_eq!((none.min(), none.per_mille(500)), (0, 0));
        for value in [3, 3, 9, 1 << 50] {
            histogram.add(value);
        }
        let buckets: Vec<_> = histogram.distribution().values().collect();
        assert_eq!(buckets, [(3, 2), (9, 1), (1 << 50, 1)]);
        // Beyond the last bucket, too.
        let mut beyond = Histogram::new(5);
        beyond.add(u64::MAX);
        assert_eq!(beyond.distribution().per_mille(500), u64::MAX);
    }
}
