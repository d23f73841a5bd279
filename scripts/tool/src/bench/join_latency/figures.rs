//! From raw times to metrics, and from samples to figures.
//!
//! *Publication* i of a topic is that of job i. The *last publication* of i is when
//! all parallel subtasks have published it. What the metrics mean and which of them
//! can be compared is told in `docs/evaluation.md`.

use join_latency::Samples;

/// The time between two releases, in nanoseconds.
pub(super) const PERIOD_NS: u64 = 25_000_000;

/// The names of the metrics.
pub(super) const METRICS: [&str; 4] = ["join_latency", "cover_delay", "join_to_start", "response"];

/// What one condition, or several of one kind, amount to.
#[derive(Clone, Debug, Default)]
pub(super) struct Figures {
    /// Jobs released.
    pub(super) jobs: usize,
    /// Joins that happened, of any kind.
    pub(super) joins: usize,
    pub(super) same_index: usize,
    pub(super) cross_index: usize,
    /// Joins that never happened: fewer than jobs.
    pub(super) missing: usize,
    /// Jobs that no join covers.
    pub(super) uncovered: usize,
    /// The samples of each metric, as (index, nanoseconds), in the order of
    /// [`METRICS`].
    pub(super) samples: [Vec<(usize, u64)>; METRICS.len()],
}

impl Figures {
    /// Computes the figures of one condition.
    pub(super) fn of(samples: &Samples) -> Self {
        let record = samples.record();
        let covering = record.covering_sets();
        let published = |join: usize| {
            let indices = &record.sets[join].indices;
            let topics = record.publications_ns.iter().zip(indices);
            topics
                .filter_map(|(times_ns, &index)| times_ns.get(index))
                .max()
                .copied()
        };
        let join_to_start = samples
            .joins
            .iter()
            .enumerate()
            .filter_map(|(join, joined)| {
                Some((join, joined.span.start_ns.saturating_sub(published(join)?)))
            });
        let response = covering.iter().enumerate().map(|(job, &join)| {
            let finish_ns = samples.joins[join].span.finish_ns;
            (job, finish_ns.saturating_sub(job as u64 * PERIOD_NS))
        });
        let numbered = |values_ns: Vec<u64>| values_ns.into_iter().enumerate().collect();
        let jobs = samples.source.len();
        Self {
            jobs,
            joins: record.sets.len(),
            same_index: record.same_index_sets(),
            cross_index: record.cross_index_sets(),
            missing: record.missing_joins(),
            uncovered: jobs - covering.len(),
            samples: [
                numbered(record.join_latencies_ns()),
                numbered(record.cover_delays_ns()),
                join_to_start.collect(),
                response.collect(),
            ],
        }
    }

    /// Adds another condition's figures of the same kind.
    pub(super) fn add(&mut self, other: Self) {
        self.jobs += other.jobs;
        self.joins += other.joins;
        self.same_index += other.same_index;
        self.cross_index += other.cross_index;
        self.missing += other.missing;
        self.uncovered += other.uncovered;
        for (own, others) in self.samples.iter_mut().zip(other.samples) {
            own.extend(others);
        }
    }

    /// Returns the distribution of a metric.
    pub(super) fn distribution(&self, metric: usize) -> Distribution {
        Distribution::new(self.samples[metric].iter().map(|(_, ns)| *ns))
    }

    /// Returns the joins per job.
    pub(super) fn joins_per_job(&self) -> f64 {
        self.joins as f64 / self.jobs.max(1) as f64
    }
}

/// Figures of one metric, all in nanoseconds; all 0 without samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Distribution {
    pub(super) count: usize,
    /// The middle sample: at least half of all are not larger.
    pub(super) median_ns: u64,
    /// The mean, rounded down.
    pub(super) mean_ns: u64,
    /// The sample that at least 99 % do not exceed.
    pub(super) p99_ns: u64,
    pub(super) max_ns: u64,
}

impl Distribution {
    fn new(samples_ns: impl Iterator<Item = u64>) -> Self {
        let mut sorted_ns: Vec<u64> = samples_ns.collect();
        sorted_ns.sort_unstable();
        let count = sorted_ns.len();
        // Nearest rank, as the guest's own figures.
        let at = |percent: usize| {
            let rank = (count * percent).div_ceil(100).max(1);
            sorted_ns.get(rank - 1).copied().unwrap_or(0)
        };
        let sum: u128 = sorted_ns.iter().map(|ns| u128::from(*ns)).sum();
        let mean = sum / u128::try_from(count.max(1)).unwrap_or(1);
        Self {
            count,
            median_ns: at(50),
            mean_ns: u64::try_from(mean).unwrap_or(u64::MAX),
            p99_ns: at(99),
            max_ns: at(100),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Distribution, Figures, PERIOD_NS};
    use join_latency::{Joined, Samples, Span};

    const fn span(start_ns: u64, finish_ns: u64) -> Span {
        Span {
            start_ns,
            finish_ns,
        }
    }

    /// Two parallel subtasks, three jobs; the only join has jobs 1 and 2.
    fn samples() -> Samples {
        let second = PERIOD_NS + 10;
        let third = 2 * PERIOD_NS + 10;
        Samples {
            source: vec![
                span(0, 1),
                span(PERIOD_NS, PERIOD_NS + 1),
                span(third, third + 1),
            ],
            parallel: vec![
                vec![span(1, 5), span(second, second + 5), span(third, third + 5)],
                vec![span(1, 9), span(second, second + 9), span(third, third + 9)],
            ],
            joins: vec![Joined {
                ready_ns: third + 20,
                span: span(third + 21, third + 30),
            }],
            indices: vec![1, 2],
            lost_inputs: 0,
        }
    }

    #[test]
    fn metrics_are_what_they_are_defined_to_be() {
        let figures = Figures::of(&samples());
        assert_eq!(
            (figures.joins, figures.same_index, figures.cross_index),
            (1, 0, 1)
        );
        assert_eq!((figures.missing, figures.uncovered), (2, 1));
        let third = 2 * PERIOD_NS + 10;
        let expected = [
            vec![(0, third + 20 - 9)],
            vec![(0, third + 20 - 9), (1, third + 20 - (PERIOD_NS + 19))],
            vec![(0, 21 - 9)],
            vec![(0, third + 30), (1, third + 30 - PERIOD_NS)],
        ];
        assert_eq!(figures.samples, expected);
    }

    #[test]
    fn figures_of_several_runs_are_pooled() {
        let mut both = Figures::of(&samples());
        both.add(Figures::of(&samples()));
        assert_eq!((both.jobs, both.joins, both.missing), (6, 2, 4));
        assert_eq!(both.distribution(1).count, 4);
    }

    #[test]
    fn a_distribution_is_by_nearest_rank() {
        let distribution = Distribution::new([4, 1, 2, 10].into_iter());
        let expected = Distribution {
            count: 4,
            median_ns: 2,
            mean_ns: 4,
            p99_ns: 10,
            max_ns: 10,
        };
        assert_eq!(distribution, expected);
        assert_eq!(
            Distribution::new(std::iter::empty()),
            Distribution::default()
        );
    }
}
