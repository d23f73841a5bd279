//! A distribution of times by its order statistics.
//!
//! It has its values in ascending order, each with how many there are of it. They are exact,
//! or they were counted in *buckets*, as a [`Histogram`](super::Histogram) does: then each
//! stands for its bucket's, none of which is larger. Ranks are nearest ranks: the value for
//! so many thousandths is the smallest one that at least these do not exceed.

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
    pub(super) count: u64,
    min_ns: Option<u64>,
    /// Ascending.
    values: Vec<(u64, u64)>,
}

impl Distribution {
    /// Orders the samples.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn new(samples_ns: impl IntoIterator<Item = u64>) -> Self {
        let samples = samples_ns.into_iter().map(|ns| (ns, 1));
        Self::counted(u64::MAX, samples.collect())
    }

    /// Takes samples that were counted, in any order: values, and how many samples each
    /// stands for, none of which is larger. The smallest of all is known besides.
    ///
    /// ```
    /// use sched_dag::law::Distribution;
    ///
    /// let latencies = Distribution::counted(9, vec![(15, 1), (11, 2)]);
    /// assert_eq!((latencies.min(), latencies.median(), latencies.max()), (9, 11, 15));
    /// ```
    #[must_use]
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

    /// Adds another one's samples.
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
    ///
    /// See [`Distribution`].
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Returns the values in ascending order, and how many samples each stands for. The last
    /// one is the largest sample.
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

    /// Returns the smallest value that at least so many thousandths of the samples do not
    /// exceed (nearest rank); 0 without samples.
    ///
    /// ```
    /// use sched_dag::law::Distribution;
    ///
    /// let latencies = Distribution::new(1..=200);
    /// assert_eq!(latencies.per_mille(900), 180);
    /// ```
    #[must_use]
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

    /// Returns the smallest sample, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn min(&self) -> u64 {
        self.min_ns.unwrap_or(0)
    }

    /// Returns the middle sample, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn median(&self) -> u64 {
        self.per_mille(500)
    }

    /// Returns the sample that 99 per cent do not exceed, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn p99(&self) -> u64 {
        self.per_mille(990)
    }

    /// Returns the largest sample, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn max(&self) -> u64 {
        self.values.last().map_or(0, |(ns, _)| *ns)
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
}
