//! A distribution by its order statistics.

use alloc::vec::Vec;

use sched_dag::law::Histogram;
use sched_dag::sorted_by_key;

use crate::text::json::Object;

/// The samples of one quantity, in nanoseconds.
///
/// ```no_run
/// use kernel::report::Distribution;
///
/// let latencies = Distribution::new([30, 10, 20, 40]);
/// assert_eq!((latencies.count(), latencies.min(), latencies.max()), (4, 10, 40));
/// assert_eq!((latencies.median(), latencies.p99()), (20, 40));
/// assert_eq!(Distribution::new([]).max(), 0);
/// ```
#[derive(Clone, Debug)]
pub struct Distribution {
    samples: Samples,
}

#[derive(Clone, Debug)]
enum Samples {
    /// All of them, in order.
    Sorted(Vec<u64>),
    /// How many there are, by value.
    Counted(Histogram),
}

impl Distribution {
    /// Orders the samples.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn new(samples_ns: impl IntoIterator<Item = u64>) -> Self {
        Self::of(samples_ns.into_iter().collect())
    }

    /// Orders them, by the sort that an image has.
    fn of(samples_ns: Vec<u64>) -> Self {
        let order = sorted_by_key(samples_ns.len(), |sample| samples_ns[sample]);
        let samples_ns = order.into_iter().map(|sample| samples_ns[sample]);
        Self {
            samples: Samples::Sorted(samples_ns.collect()),
        }
    }

    /// Takes samples that were counted.
    ///
    /// ```no_run
    /// use kernel::report::Distribution;
    /// use sched_dag::DagId;
    ///
    /// fn responses(run: &kernel::Run, dag: DagId) -> Option<Distribution> {
    ///     let times = &run.times()?.dag(dag).response_time;
    ///     Some(Distribution::counted(times.clone()))
    /// }
    /// ```
    #[must_use]
    pub const fn counted(samples_ns: Histogram) -> Self {
        Self {
            samples: Samples::Counted(samples_ns),
        }
    }

    /// Returns the number of samples.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.samples {
            Samples::Sorted(sorted_ns) => sorted_ns.len(),
            Samples::Counted(counted) => usize::try_from(counted.count()).unwrap_or(usize::MAX),
        }
    }

    /// Returns the smallest sample that at least `percent` per cent of the
    /// samples do not exceed (nearest rank); 0 without samples.
    ///
    /// ```no_run
    /// use kernel::report::Distribution;
    ///
    /// let latencies = Distribution::new(1..=200);
    /// assert_eq!(latencies.percentile(90), 180);
    /// ```
    #[must_use]
    pub fn percentile(&self, percent: usize) -> u64 {
        match &self.samples {
            Samples::Sorted(sorted_ns) => {
                let rank = (self.count() * percent).div_ceil(100).max(1);
                let sample = sorted_ns.get(rank - 1).or(sorted_ns.last());
                sample.copied().unwrap_or(0)
            }
            Samples::Counted(counted) if percent == 0 => counted.min(),
            Samples::Counted(counted) => counted.per_mille(percent as u64 * 10),
        }
    }

    /// Returns the smallest sample, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn min(&self) -> u64 {
        self.percentile(0)
    }

    /// Returns the middle sample, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn median(&self) -> u64 {
        self.percentile(50)
    }

    /// Returns the sample that 99 per cent do not exceed, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn p99(&self) -> u64 {
        self.percentile(99)
    }

    /// Returns the largest sample, or 0.
    ///
    /// See [`Distribution`].
    #[must_use]
    pub fn max(&self) -> u64 {
        self.percentile(100)
    }

    /// Writes the fields `min`, `median`, `p99` and `max` of a machine line.
    ///
    /// ```no_run
    /// use kernel::{json, report::Distribution};
    ///
    /// let latencies = Distribution::new([10, 20]);
    /// let line = json::line("latency", |line| {
    ///     line.object("ns", |object| latencies.describe(object));
    /// });
    /// assert_eq!(
    ///     line.to_string(),
    ///     r#"{"kind":"latency","ns":{"min":10,"median":10,"p99":20,"max":20}}"#
    /// );
    /// ```
    pub fn describe(&self, object: &mut Object<'_, '_>) {
        object
            .number("min", self.min())
            .number("median", self.median())
            .number("p99", self.p99())
            .number("max", self.max());
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
    }

    #[test]
    fn has_only_zeros_without_samples() {
        let none = Distribution::new([]);
        assert_eq!(
            (none.count(), none.min(), none.median(), none.max()),
            (0, 0, 0, 0)
        );
    }
}
