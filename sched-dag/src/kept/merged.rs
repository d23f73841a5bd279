//! The journals of all clusters of a run as one.
//!
//! Each is in the order in which its scheduler learnt of things, and stays so: of the next
//! events of two, the earlier one goes first. Nothing in one depends on another, since each
//! DAG and each core is in one cluster; so any order between them tells the same run.

use alloc::vec::Vec;

use super::Journal;
use crate::ids::ClusterId;
use crate::journal::Event;

impl Journal {
    /// Takes over what another cluster's journal of the same run holds, which counts its cores
    /// from the cluster's first one. If there is no memory for both, that counts as lost.
    #[inline(never)]
    pub fn absorb(&mut self, other: Self, cluster: ClusterId, first_core: u32) {
        let mut merged = Vec::new();
        let both = self.events.len() + other.events.len();
        if merged.try_reserve_exact(both).is_err() {
            self.lost += other.written();
            self.is_complete = false;
            return;
        }
        let theirs = other.words();
        let mut theirs = theirs
            .map(|words| Event::on_core_from(*words, first_core))
            .peekable();
        for words in self.words() {
            while let Some(earlier) = theirs.next_if(|theirs| theirs[0] < words[0]) {
                merged.push(earlier);
            }
            merged.push(*words);
        }
        merged.extend(theirs);
        self.events = merged;
        self.oldest = 0;
        self.lost += other.lost;
        self.is_complete &= other.is_complete;
        match (&mut self.tally, other.tally) {
            (Some(ours), Some(theirs)) => ours.adopt(theirs, cluster),
            // A cluster that has lost nothing has counted nothing yet.
            (none, theirs) => *none = none.take().or(theirs),
        }
    }
}
