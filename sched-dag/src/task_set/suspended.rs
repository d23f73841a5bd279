//! How many instances of a DAG can be suspended at once: each keeps a stack.
//!
//! Only an instance that has started and may be preempted is suspended, and a subtask has one
//! started instance at a time (R2). Of one job no two started instances precede one another, so
//! there are as many at most as the graph is wide; and no wider than the number of chains that it
//! can be cut into (R. P. Dilworth, Annals of Mathematics 51, 1950). Chains are found greedily,
//! in one pass, which need not find the fewest.
//!
//! A job that is aborted, or cut by a fault that its DAG survives, makes room for the next one
//! while instances of it go on; then the jobs in flight are no limit.

use alloc::vec;

use super::{Dag, TaskSet};
use crate::policy::{OnFault, OverrunPolicy};

impl TaskSet {
    /// Returns the sum of [`Dag::most_suspended`].
    #[inline(never)]
    #[must_use]
    pub fn most_suspended(&self) -> usize {
        self.dags().iter().map(Dag::most_suspended).sum()
    }

    /// Returns the size of a stack that every subtask can run on, if those that state none need
    /// so many bytes.
    #[inline(never)]
    #[must_use]
    pub fn largest_stack_bytes(&self, unstated: u64) -> u64 {
        let subtasks = self.dags().iter().flat_map(Dag::subtasks);
        let bytes = subtasks.map(|subtask| subtask.stack_bytes().unwrap_or(unstated));
        bytes.max().unwrap_or(unstated)
    }
}

impl Dag {
    /// Returns a number of instances, of all jobs, that is never exceeded by those that are
    /// suspended at once where started instances may lose their cores.
    #[must_use]
    pub fn most_suspended(&self) -> usize {
        let may_be = self.subtasks.iter().filter(|of| !of.is_non_preemptive());
        let may_be = may_be.count();
        let is_left = self.overrun == OverrunPolicy::Abort || self.on_fault != OnFault::EndDag;
        match is_left {
            true => may_be,
            false => may_be.min(self.chains().saturating_mul(self.in_flight as usize)),
        }
    }

    /// Returns the number of chains that the graph is cut into: a subtask goes on with the chain
    /// of the first predecessor that no other has gone on with.
    fn chains(&self) -> usize {
        let mut is_continued = vec![false; self.subtasks.len()];
        let begins_one = |subtask: &&_| {
            let before = self.predecessors(**subtask).iter();
            let mut free = before.filter(|before| !is_continued[before.index()]);
            match free.next() {
                Some(before) => {
                    is_continued[before.index()] = true;
                    false
                }
                None => true,
            }
        };
        self.topological_order().iter().filter(begins_one).count()
    }
}
