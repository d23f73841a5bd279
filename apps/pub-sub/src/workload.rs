//! The paper's workload under a policy, in virtual time.
//!
//! Every period a source starts a job. Each of N parallel subtasks takes the jobs in
//! order, one at a time, on a core of its own: it starts a job when that has been
//! released and the job before is done, executes for a given time, and publishes on
//! its topic when it finishes. A synchronizer joins the N topics. Inputs of the
//! parallel subtasks are unbounded, and nothing else takes any time: publications,
//! the source and the synchronizer itself cost nothing. So what is seen is what the
//! policy does by its rules, which no implementation of it can better.
//!
//! The same execution times make the same publications. The result
//! depends on nothing but the arguments.
//!
//! Some words for what the joins of a run amount to. *Index* i of a topic is its i-th publication,
//! from 0; in the workload
//! that is job i. The *last publication* of index i is when the last topic has
//! published it: no join of job i can come sooner. A set is *same-index* if all its
//! messages have one index, else *cross-index*. A set *covers* index i if all its
//! messages have index i or a later one.
//!
//! A [`Record`] is plain times, taken by [`run`] or by a machine. Figures computed from it are
//! exact.
//!
//! The join latency as the paper defines it compares the i-th set with the last
//! publication of index i. If sets are skipped, all later ones are compared with
//! indices that they have nothing to do with, so that it grows with the length of
//! the run and never converges. [`Record::cover_delays_ns`] has no such trouble. Either
//! says nothing of joins that never happened: state [`Record::missing_joins`], too.

use alloc::vec;
use alloc::vec::Vec;

use crate::{Outlet, Set, Stamped, Synchronizer};

/// The time between two jobs in the paper's workload, in nanoseconds.
pub const PERIOD_NS: u64 = 25_000_000;

/// Which time a parallel subtask stamps its messages with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stamping {
    /// The job's release: the source's stamp is passed on, so that all messages of a
    /// job carry the same. [`ExactTime`](crate::ExactTime) needs this.
    Release,
    /// The publication: every parallel subtask stamps anew when it finishes. The
    /// paper joins these with [`ApproximateTime`](crate::ApproximateTime).
    Publication,
}

/// Runs `jobs` jobs through a synchronizer that holds nothing yet, which joins as
/// many parallel subtasks as it has topics. `execution_ns` is asked for the
/// execution time of each (parallel subtask, job) once: the parallel subtasks one
/// after the other, and for each the jobs in order.
///
/// Publications of the same instant arrive in the order of their topics.
///
/// ```
/// use pub_sub::ExactTime;
/// use pub_sub::workload::{self, Stamping};
///
/// let times_ns = |parallel: usize, _job: usize| [3_000_000, 40_000_000][parallel];
/// let mut exact = ExactTime::new(2, 100);
/// let record = workload::run(&mut exact, Stamping::Release, 10, times_ns);
/// assert_eq!(record.same_index_sets(), 10);
/// assert_eq!(record.cover_delays_ns(), [0; 10]);
/// ```
///
/// # Panics
///
/// If a time exceeds what 64 bits of nanoseconds hold.
pub fn run(
    synchronizer: &mut dyn Synchronizer<usize>,
    stamping: Stamping,
    jobs: usize,
    execution_ns: impl FnMut(usize, usize) -> u64,
) -> Record {
    let topics = synchronizer.topics();
    let mut record = Record {
        publications_ns: publications(topics, jobs, execution_ns),
        sets: Vec::new(),
    };
    // The next job that each topic publishes.
    let mut next = vec![0; topics];
    while let Some((ready_ns, topic)) = earliest(&record.publications_ns, &next) {
        let job = next[topic];
        next[topic] += 1;
        let stamp_ns = match stamping {
            Stamping::Release => release_ns(job),
            Stamping::Publication => ready_ns,
        };
        let message = Stamped {
            stamp_ns,
            message: job,
        };
        let sets = &mut record.sets;
        synchronizer.arrive(topic, message, &mut Ready { ready_ns, sets });
    }
    record
}

/// Returns when each parallel subtask publishes each job.
fn publications(
    topics: usize,
    jobs: usize,
    mut execution_ns: impl FnMut(usize, usize) -> u64,
) -> Vec<Vec<u64>> {
    let mut subtask = |topic| {
        let mut finish_ns: u64 = 0;
        let finishes_ns = (0..jobs).map(|job| {
            let start_ns = release_ns(job).max(finish_ns);
            let finished_ns = start_ns.checked_add(execution_ns(topic, job));
            finish_ns = finished_ns.expect(TOO_LATE);
            finish_ns
        });
        finishes_ns.collect()
    };
    (0..topics).map(&mut subtask).collect()
}

const TOO_LATE: &str = "the run ends after the last time that 64 bits hold; take fewer jobs";

fn release_ns(job: usize) -> u64 {
    let job = u64::try_from(job).ok();
    job.and_then(|job| job.checked_mul(PERIOD_NS))
        .expect(TOO_LATE)
}

/// Returns the earliest publication that is yet to come, and its topic.
fn earliest(publications_ns: &[Vec<u64>], next: &[usize]) -> Option<(u64, usize)> {
    let topics = publications_ns.iter().zip(next).enumerate();
    topics
        .filter_map(|(topic, (times_ns, &job))| Some((*times_ns.get(job)?, topic)))
        .min()
}

/// Writes down what comes out while one publication is handled.
struct Ready<'a> {
    ready_ns: u64,
    sets: &'a mut Vec<RecordedSet>,
}

impl Outlet<usize> for Ready<'_> {
    fn emitted(&mut self, set: Set<'_, usize>) {
        self.sets.push(RecordedSet {
            ready_ns: self.ready_ns,
            indices: set.map(|stamped| stamped.message).collect(),
        });
    }
}

/// When each topic published, and when which sets came out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// For each topic the time of each publication, ascending, all equally many.
    pub publications_ns: Vec<Vec<u64>>,
    /// The sets in the order in which they came out.
    pub sets: Vec<RecordedSet>,
}

/// A set that came out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedSet {
    /// When the sink's subscription had it, ready to be handled.
    pub ready_ns: u64,
    /// For each topic the index of its message. An index goes up from set to set.
    pub indices: Vec<usize>,
}

impl RecordedSet {
    /// Whether all messages have one index.
    #[must_use]
    pub fn is_same_index(&self) -> bool {
        self.indices.windows(2).all(|pair| pair[0] == pair[1])
    }

    fn covers(&self, index: usize) -> bool {
        self.indices.iter().all(|&own| own >= index)
    }
}

impl Record {
    /// Returns the number of same-index sets.
    #[must_use]
    pub fn same_index_sets(&self) -> usize {
        self.sets.iter().filter(|set| set.is_same_index()).count()
    }

    /// Returns the number of cross-index sets.
    #[must_use]
    pub fn cross_index_sets(&self) -> usize {
        self.sets.len() - self.same_index_sets()
    }

    /// Returns how many fewer sets than indices there are: the joins that never
    /// happened.
    #[must_use]
    pub fn missing_joins(&self) -> usize {
        let indices = self.last_publications_ns().count();
        indices.saturating_sub(self.sets.len())
    }

    /// Returns the join latency as the paper defines it, for each set: from the last
    /// publication of index i to the i-th set.
    #[must_use]
    pub fn join_latencies_ns(&self) -> Vec<u64> {
        let publications_ns = self.last_publications_ns();
        let pairs = publications_ns.zip(&self.sets);
        pairs
            .map(|(published_ns, set)| set.ready_ns.saturating_sub(published_ns))
            .collect()
    }

    /// Returns for each index that a set covers how long that took: from the last
    /// publication of the index to the first set that covers it.
    #[must_use]
    pub fn cover_delays_ns(&self) -> Vec<u64> {
        let covering = self.covering_sets().into_iter();
        let pairs = covering.zip(self.last_publications_ns());
        pairs
            .map(|(set, published_ns)| self.sets[set].ready_ns.saturating_sub(published_ns))
            .collect()
    }

    /// Returns for each index that a set covers the position of the first such set. If
    /// no set covers an index, none covers a later one.
    #[must_use]
    pub fn covering_sets(&self) -> Vec<usize> {
        let mut covering = Vec::new();
        let mut position = 0;
        for index in 0..self.last_publications_ns().count() {
            // What does not cover this index covers no later one.
            while self
                .sets
                .get(position)
                .is_some_and(|set| !set.covers(index))
            {
                position += 1;
            }
            if position == self.sets.len() {
                break;
            }
            covering.push(position);
        }
        covering
    }

    /// Returns the last publication of each index, by index.
    pub fn last_publications_ns(&self) -> impl Iterator<Item = u64> {
        let indices = self.publications_ns.iter().map(Vec::len).min();
        (0..indices.unwrap_or(0)).filter_map(|index| {
            let topics = self.publications_ns.iter();
            topics.map(|times_ns| times_ns[index]).max()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ExactTime;

    #[test]
    fn jobs_of_a_parallel_subtask_wait_for_each_other() {
        let times_ns = |_, job: usize| [60_000_000, 1_000_000, 1_000_000, 1][job];
        let publications_ns = publications(1, 4, times_ns);
        assert_eq!(
            publications_ns,
            [[60_000_000, 61_000_000, 62_000_000, 75_000_001]]
        );
    }

    #[test]
    fn a_set_is_ready_when_its_last_message_is_published() {
        let times_ns = |topic: usize, _| [9, 4][topic];
        let record = run(&mut ExactTime::new(2, 5), Stamping::Release, 2, times_ns);
        let ready_ns: Vec<_> = record.sets.iter().map(|set| set.ready_ns).collect();
        assert_eq!(ready_ns, [9, PERIOD_NS + 9]);
        assert_eq!((record.same_index_sets(), record.missing_joins()), (2, 0));
    }

    /// Two topics with four publications each; index 1 is skipped, and the second
    /// set mixes 2 and 3.
    fn record() -> Record {
        let set = |ready_ns, indices: [usize; 2]| RecordedSet {
            ready_ns,
            indices: indices.to_vec(),
        };
        Record {
            publications_ns: vec![vec![10, 20, 30, 40], vec![12, 19, 35, 60]],
            sets: vec![set(13, [0, 0]), set(44, [3, 2])],
        }
    }

    #[test]
    fn sets_are_counted_by_kind_and_their_latencies_compared_by_rank_and_by_cover() {
        let record = record();
        let sets = (record.same_index_sets(), record.cross_index_sets());
        assert_eq!((sets, record.missing_joins()), ((1, 1), 2));
        assert_eq!(record.join_latencies_ns(), [13 - 12, 44 - 20]);
        // Nothing covers index 3.
        assert_eq!(record.cover_delays_ns(), [13 - 12, 44 - 20, 44 - 35]);
        assert_eq!(record.covering_sets(), [0, 1, 1]);
        let empty = Record::default();
        assert_eq!(
            (empty.missing_joins(), empty.cover_delays_ns()),
            (0, vec![])
        );
    }
}
