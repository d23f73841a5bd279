//! From raw times to metrics, and from samples to figures.
//!
//! *Publication* i of a topic is that of job i. The *last publication* of i is when
//! all parallel subtasks have published it. What the metrics mean and which of them
//! can be compared is told in `docs/evaluation.md`.

use join_latency::Samples;
use sched_dag::law::Distribution;

/// The time between two releases, in nanoseconds.
pub(super) const PERIOD_NS: u64 = 25_000_000;

/// The names of the metrics.
pub(super) const METRICS: [&str; 4] = ["join_latency", "cover_delay", "join_to_start", "response"];

/// The names of the counts: jobs released, joins of any kind that happened, those of values of one
/// job and of several, joins that never happened (fewer than jobs), and jobs that no join covers.
pub(super) const COUNTS: [&str; 6] = [
    "jobs",
    "joins",
    "same_index",
    "cross_index",
    "missing",
    "uncovered",
];

/// What one condition, or several of one kind, amount to.
#[derive(Clone, Debug, Default)]
pub(super) struct Figures {
    /// In the order of [`COUNTS`].
    pub(super) counts: [usize; COUNTS.len()],
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
        let joins = samples.joins.iter().enumerate();
        let join_to_start = joins.filter_map(|(join, joined)| {
            Some((join, joined.span.start_ns.saturating_sub(published(join)?)))
        });
        let response = covering.iter().enumerate().map(|(job, &join)| {
            let finish_ns = samples.joins[join].span.finish_ns;
            (job, finish_ns.saturating_sub(job as u64 * PERIOD_NS))
        });
        let numbered = |values_ns: Vec<u64>| values_ns.into_iter().enumerate().collect();
        let jobs = samples.source.len();
        Self {
            counts: [
                jobs,
                record.sets.len(),
                record.same_index_sets(),
                record.cross_index_sets(),
                record.missing_joins(),
                jobs - covering.len(),
            ],
            samples: [
                numbered(record.join_latencies_ns()),
                numbered(record.cover_delays_ns()),
                join_to_start.collect(),
                response.collect(),
            ],
        }
    }

    /// Adds another condition's figures of the same kind.
    pub(super) fn add(&mut self, other: &Self) {
        for (own, others) in self.counts.iter_mut().zip(other.counts) {
            *own += others;
        }
        for (own, others) in self.samples.iter_mut().zip(&other.samples) {
            own.extend(others);
        }
    }

    /// Returns the distribution of a metric, by nearest rank as the guest's own.
    pub(super) fn distribution(&self, metric: usize) -> Distribution {
        let samples = self.samples[metric].iter();
        Distribution::new(samples.map(|(_, ns)| *ns))
    }

    /// Returns the mean of a metric in nanoseconds, rounded down; 0 without samples.
    pub(super) fn mean_ns(&self, metric: usize) -> u128 {
        let samples = &self.samples[metric];
        let sum: u128 = samples.iter().map(|(_, ns)| u128::from(*ns)).sum();
        sum / samples.len().max(1) as u128
    }

    /// Returns the joins per job.
    pub(super) fn joins_per_job(&self) -> f64 {
        let [jobs, joins, ..] = self.counts;
        joins as f64 / jobs.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::{Figures, PERIOD_NS};
    use join_latency::{Joined, Samples, Span};

    /// Two parallel subtasks, three jobs; the only join has jobs 1 and 2.
    fn samples() -> Samples {
        let [first, second, third] = [0, PERIOD_NS + 10, 2 * PERIOD_NS + 10];
        let span = |start_ns, finish_ns| Span {
            start_ns,
            finish_ns,
        };
        let taking = |ns| [1, second, third].map(|start_ns| span(start_ns, start_ns + ns));
        Samples {
            source: [first, PERIOD_NS, third].map(|ns| span(ns, ns + 1)).into(),
            parallel: vec![taking(5).into(), taking(9).into()],
            joins: vec![Joined {
                ready_ns: third + 20,
                span: span(third + 21, third + 30),
            }],
            indices: vec![1, 2],
            lost_inputs: 0,
        }
    }

    #[test]
    fn metrics_are_what_they_are_defined_to_be_and_pooled() {
        let figures = Figures::of(&samples());
        assert_eq!(figures.counts, [3, 1, 0, 1, 2, 1]);
        let third = 2 * PERIOD_NS + 10;
        let expected = [
            vec![(0, third + 20 - 10)],
            vec![(0, third + 20 - 10), (1, third + 20 - (PERIOD_NS + 19))],
            vec![(0, 21 - 9)],
            vec![(0, third + 30), (1, third + 30 - PERIOD_NS)],
        ];
        assert_eq!(figures.samples, expected);
        let mut both = figures.clone();
        both.add(&figures);
        assert_eq!(both.counts, [6, 2, 0, 2, 4, 2]);
        assert_eq!((both.distribution(1).count(), both.mean_ns(2)), (4, 12));
    }
}
