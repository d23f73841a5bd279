//! The times of a run of the evaluation, the same whatever joined.
//!
//! One source, N parallel subtasks, one join. By the DAG of `fork-join` the scheduler joins them;
//! in publish/subscribe form they are callbacks, and a synchronizer matches stamps. Whatever is
//! joined, parallel subtask b executes its i-th job for the same time, which depends on the seed, b
//! and i alone ([`fork_join::ExecutionTimes`]).
//!
//! Some words for what the joins of a run amount to. A parallel subtask publishes on a topic of its
//! own. *Index* i of a topic is its i-th publication, from 0: that of job i. The *last publication*
//! of index i is when the last topic has published it: no join of job i can come sooner. A join
//! *covers* index i if all that it joins has index i or a later one.
//!
//! The join latency as the paper defines it compares the i-th join with the last publication of
//! index i. If joins are skipped, all later ones are compared with indices that they have nothing
//! to do with, so that it grows with the length of the run and never converges.
//! [`RunSamples::cover_delays_ns`] has no such trouble. Either says nothing of joins that never
//! happened: state these, too.
//!
//! Nothing here knows the kernel, and figures computed from the times are exact.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

use alloc::vec::Vec;

/// From when to when something executed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExecutionSpan {
    /// The function's first instruction.
    pub start_ns: u64,
    /// For the source and the parallel subtasks: the publication. For a join: the
    /// function's last instruction.
    pub finish_ns: u64,
}

/// A join that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompletedJoin {
    /// When all that is joined had been put together.
    pub ready_ns: u64,
    /// When the function that uses it executed.
    pub span: ExecutionSpan,
}

/// The times of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunSamples {
    /// For each job the source's execution.
    pub source: Vec<ExecutionSpan>,
    /// For each parallel subtask and job its execution; it publishes at the end.
    pub parallel: Vec<Vec<ExecutionSpan>>,
    /// The joins in their order.
    pub joins: Vec<CompletedJoin>,
    /// For each join the jobs whose values it joined, one a parallel subtask; all
    /// joins one after the other.
    pub indices: Vec<u64>,
    /// Messages that queues before the synchronizer dropped. More than 0 means that
    /// the i-th publication is not job i.
    pub lost_inputs: u64,
}

impl RunSamples {
    /// Returns the jobs whose values a join has joined.
    pub fn indices_of(&self, join: usize) -> &[u64] {
        let parallel = self.parallel.len();
        &self.indices[join * parallel..(join + 1) * parallel]
    }

    /// Returns how many joins there are, how many of them are of one job and how many across jobs,
    /// and how many never happened: one for each index that all topics have published.
    pub fn counts(&self) -> [usize; 4] {
        let joins = self.joins.len();
        let is_of_one = |join: &usize| {
            let indices = self.indices_of(*join);
            indices.windows(2).all(|pair| pair[0] == pair[1])
        };
        let of_one = (0..joins).filter(is_of_one).count();
        let indices = self.last_publications_ns().count();
        [joins, of_one, joins - of_one, indices.saturating_sub(joins)]
    }

    /// Returns the join latency as the paper defines it, for each join: from the last publication
    /// of index i to the i-th join.
    pub fn join_latencies_ns(&self) -> Vec<u64> {
        self.delays_ns(0..self.joins.len())
    }

    /// Returns for each index that a join covers how long that took: from the last publication of
    /// the index to the first join that covers it.
    pub fn cover_delays_ns(&self) -> Vec<u64> {
        self.delays_ns(self.covering_joins())
    }

    /// Returns how long each join was ready after the last publication of the index at its place
    /// in the list.
    fn delays_ns(&self, joins: impl IntoIterator<Item = usize>) -> Vec<u64> {
        let pairs = joins.into_iter().zip(self.last_publications_ns());
        pairs
            .map(|(join, published_ns)| self.joins[join].ready_ns.saturating_sub(published_ns))
            .collect()
    }

    /// Returns for each index that a join covers the position of the first such join. If no join
    /// covers an index, none covers a later one.
    pub fn covering_joins(&self) -> Vec<usize> {
        let mut first = 0;
        let indices = (0..).take(self.last_publications_ns().count());
        let covering = indices.map_while(|index| {
            let covers = |join: &usize| self.indices_of(*join).iter().all(|own| *own >= index);
            // A join that does not cover this index covers no later one.
            first = (first..self.joins.len()).find(covers)?;
            Some(first)
        });
        covering.collect()
    }

    /// Returns the last publication of each index, by index.
    fn last_publications_ns(&self) -> impl Iterator<Item = u64> {
        let indices = self.parallel.iter().map(Vec::len).min();
        (0..indices.unwrap_or(0)).filter_map(|index| {
            let topics = self.parallel.iter();
            topics.map(|spans| spans[index].finish_ns).max()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two topics with four publications each; index 1 is skipped, and the second join mixes 2
    /// and 3.
    fn samples() -> RunSamples {
        let spans = |times_ns: [u64; 4]| {
            let span = |finish_ns| ExecutionSpan {
                start_ns: 0,
                finish_ns,
            };
            times_ns.map(span).to_vec()
        };
        let joined = |ready_ns| CompletedJoin {
            ready_ns,
            span: ExecutionSpan::default(),
        };
        RunSamples {
            parallel: vec![spans([10, 20, 30, 40]), spans([12, 19, 35, 60])],
            joins: vec![joined(13), joined(44)],
            indices: vec![0, 0, 3, 2],
            ..RunSamples::default()
        }
    }

    #[test]
    fn joins_are_counted_by_kind_and_their_latencies_compared_by_rank_and_by_cover() {
        let samples = samples();
        assert_eq!(samples.counts(), [2, 1, 1, 2]);
        assert_eq!(samples.join_latencies_ns(), [13 - 12, 44 - 20]);
        // Nothing covers index 3.
        assert_eq!(samples.cover_delays_ns(), [13 - 12, 44 - 20, 44 - 35]);
        assert_eq!(samples.covering_joins(), [0, 1, 1]);
        let none = RunSamples::default();
        assert_eq!((none.counts(), none.cover_delays_ns()), ([0; 4], vec![]));
    }
}
