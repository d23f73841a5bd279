//! What the joins of a run amount to.
//!
//! Some words. *Index* i of a topic is its i-th publication, from 0; in the workload
//! that is job i. The *last publication* of index i is when the last topic has
//! published it: no join of job i can come sooner. A set is *same-index* if all its
//! messages have one index, else *cross-index*. A set *covers* index i if all its
//! messages have index i or a later one.
//!
//! A [`Record`] is plain times, taken by [`workload`](crate::workload) in virtual time
//! or by a machine. What is computed from it is exact.
//!
//! The join latency as the paper defines it compares the i-th set with the last
//! publication of index i. If sets are skipped, all later ones are compared with
//! indices that they have nothing to do with, so that it grows with the length of
//! the run and never converges. [`Record::cover_delays_ns`] has no such trouble. Either
//! says nothing of joins that never happened: state [`Record::missing_joins`], too.

use alloc::vec::Vec;

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
    fn sets_are_counted_by_kind() {
        let record = record();
        assert_eq!(
            (record.same_index_sets(), record.cross_index_sets()),
            (1, 1)
        );
        assert_eq!(record.missing_joins(), 2);
    }

    #[test]
    fn the_papers_latency_compares_by_rank() {
        assert_eq!(record().join_latencies_ns(), [13 - 12, 44 - 20]);
    }

    #[test]
    fn an_index_is_covered_by_the_first_set_that_is_all_as_late() {
        assert_eq!(
            record().cover_delays_ns(),
            [13 - 12, 44 - 20, 44 - 35],
            "nothing covers index 3"
        );
        assert_eq!(record().covering_sets(), [0, 1, 1]);
    }

    #[test]
    fn an_empty_record_has_nothing_to_tell() {
        let record = Record::default();
        assert_eq!(record.missing_joins(), 0);
        assert_eq!(record.cover_delays_ns(), []);
    }
}
