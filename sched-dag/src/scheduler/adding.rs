//! Adding DAGs to those that are scheduled, and removing them.
//!
//! A machine learns something new while it works. The rules, whose tests in
//! `tests/adding.rs` bear their numbers:
//!
//! - **A1, prepared before.** The scheduler of all DAGs is made, and its memory taken, while the
//!   present one goes on. The *switch* moves the state over. It allocates nothing, and costs a
//!   step for each DAG, each subtask, each slot and each core.
//! - **A2, its own time.** The time of an added DAG begins at the instant t of the switch: its
//!   job k is due at t + O + kT, a sporadic one at t + O at the earliest.
//! - **A3, the others.** To them nothing happens at the switch: jobs in flight, releases that
//!   wait, progress, cores, counters, numbers and the grid go on. From t on the schedule is that of a commit of
//!   all DAGs at time 0, the added ones with the offset t + O. So a bound that holds for such a
//!   commit holds here, whenever the switch comes.
//! - **A4, order.** Added DAGs have the numbers after those that are there, and their subtasks the
//!   priorities that are stated, or come after all that there are.
//! - **A5, removal.** A DAG is removed by closing it (C1 to C5); once it is over, its functions
//!   and its values can go. Its number is not given again, since the journal tells of it.
//! - **A6, what a removed DAG leaves behind.** It may have delayed jobs that are in flight, and
//!   these others. Until an instant at which no job of its cluster is in flight it therefore counts in
//!   every proof; from then on nothing depends on it any more.

use core::mem::swap;

use super::Scheduler;
use super::key::Key;
use crate::ids::{ClusterId, DagId, to_u32};

impl Scheduler {
    /// Goes on as `larger`, a scheduler of the same cores that has not begun, of the same DAGs
    /// and others behind them ([`TaskSet::with_added`](crate::TaskSet::with_added)), and leaves there what is not needed
    /// any more. To be called between two instants (A1 to A4).
    ///
    /// # Panics
    ///
    /// If `larger` has other options, or fewer DAGs.
    pub fn extend(&mut self, larger: &mut Self) {
        assert!(
            larger.options == self.options && larger.dags.len() >= self.dags.len(),
            "a scheduler is to go on as one of other cores or fewer DAGs; make it of the same \
             options, with all DAGs"
        );
        let known = self.dags.len();
        larger.now_ns = self.now_ns;
        larger.fresh = self.fresh;
        larger.dags[..known].swap_with_slice(&mut self.dags);
        larger.vertices.take_over(&self.vertices);
        self.cores.change_keys(|key| larger.present_key(key));
        swap(&mut larger.cores, &mut self.cores);
        while let Some(key) = self.ready.pop() {
            let key = larger.present_key(key);
            larger.ready.insert(key);
        }
        for dag in 0..larger.dags.len() {
            larger.set_timer(DagId(to_u32(dag)));
        }
        swap(self, larger);
    }

    /// Returns the key that an instance has here, from the one that it had elsewhere.
    fn present_key(&self, elsewhere: Key) -> Key {
        let number = elsewhere.vertex();
        let vertex = self.vertices.get(number);
        (self.ready).key(number, vertex, || {
            self.dags[vertex.dag.index()].jobs.job(vertex.progress)
        })
    }

    /// Reports whether no job of a cluster's DAGs is in flight (A6).
    #[must_use]
    pub fn is_idle(&self, cluster: ClusterId) -> bool {
        let dags = self.task_set.dags().iter().zip(&self.dags);
        let mut here = dags.filter(|(dag, _)| dag.cluster() == cluster);
        here.all(|(_, state)| state.jobs.oldest == state.jobs.next)
    }
}
