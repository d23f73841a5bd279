//! The times of a run of the evaluation, in one form for every kind of join.
//!
//! A workload has one source, N parallel subtasks and one join. In the DAG of `fork-join` the
//! scheduler joins them; in publish/subscribe form they are callbacks, and a synchronizer matches
//! stamps. In both forms, parallel subtask b executes its i-th job for the same time, which depends
//! on the seed, b and i alone ([`fork_join::ExecutionTimes`]).
//!
//! Some terms describe the joins of a run. Each parallel subtask publishes on its own topic.
//! *Index* i of a topic is the topic's i-th publication, from 0: the publication of job i. The
//! *last publication* of index i is the time at which the last topic has published index i: no join
//! of job i can come sooner. A join *covers* index i if all joined values have index i or a later
//! index.
//!
//! The paper's join latency compares the i-th join with the last publication of index i. If joins
//! are skipped, all later joins are compared with unrelated indices, so the latency grows with the
//! length of the run and never converges. [`RunSamples::cover_delays_ns`] avoids such trouble.
//! Neither figure says anything about joins that never happened: state the number of missing joins,
//! too.
//!
//! The library does not use the kernel, and figures computed from the times are exact.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

use alloc::vec::Vec;

/// The start and the end of an execution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExecutionSpan {
    /// The function's first instruction.
    pub start_ns: u64,
    /// The publication, for the source and the parallel subtasks. For a join, the function's last
    /// instruction.
    pub finish_ns: u64,
}

/// A completed join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompletedJoin {
    /// The time at which the set of joined values was complete.
    pub ready_ns: u64,
    /// The execution of the function that uses the values.
    pub span: ExecutionSpan,
}

/// The times of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunSamples {
    /// The source's execution, for each job.
    pub source: Vec<ExecutionSpan>,
    /// The execution of each parallel subtask for each job; the subtask publishes at the end.
    pub parallel: Vec<Vec<ExecutionSpan>>,
    /// The joins, in their order.
    pub joins: Vec<CompletedJoin>,
    /// The jobs whose values each join joined, one for each parallel subtask; the joins follow one
    /// another.
    pub indices: Vec<u64>,
    /// Messages dropped by queues before the synchronizer. If there are any, the i-th publication
    /// is not job i.
    pub lost_inputs: u64,
}

impl RunSamples {
    /// Returns the jobs whose values a join has joined.
    pub fn indices_of(&self, join: usize) -> &[u64] {
        let parallel = self.parallel.len();
        &self.indices[join * parallel..(join + 1) * parallel]
    }

    /// Returns the number of joins, of joins of one job, of joins across jobs, and of joins that
    /// never happened: one is expected for each index published by all topics.
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

    /// Returns the paper's join latency for each join: from the last publication of index i to the
    /// i-th join.
    pub fn join_latencies_ns(&self) -> Vec<u64> {
        self.delays_ns(0..self.joins.len())
    }

    /// Returns a delay for each index covered by a join: from the last publication of the index to
    /// the first join covering the index.
    pub fn cover_delays_ns(&self) -> Vec<u64> {
        self.delays_ns(self.covering_joins())
    }

    /// Returns the delay from the last publication of each index to the readiness of the join at
    /// the index's place in the list.
    fn delays_ns(&self, joins: impl IntoIterator<Item = usize>) -> Vec<u64> {
        let pairs = joins.into_iter().zip(self.last_publications_ns());
        pairs
            .map(|(join, published_ns)| self.joins[join].ready_ns.saturating_sub(published_ns))
            .collect()
    }

    /// Returns, for each covered index, the position of the first join covering the index. If no
    /// join covers an index, none covers a later index.
    pub fn covering_joins(&self) -> Vec<usize> {
        let mut first = 0;
        let indices = (0..).take(self.last_publications_ns().count());
        let covering = indices.map_while(|index| {
            let covers = |join: &usize| self.indices_of(*join).iter().all(|own| *own >= index);
            // A join that does not cover this index covers no later index either.
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
