//! DAGs that are added between two parts of a run, and removed.

use std::sync::Arc;

use fass::{LaunchError, Plan};
use sched_dag::DagId;

use super::Session;
use crate::surroundings::Surroundings;

/// What has become of a DAG's removal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Removal {
    /// It was not asked for.
    #[default]
    None,
    /// It was asked for; the DAG still counts in proofs.
    Asked,
    /// What it may have delayed is over.
    Forgotten,
}

impl Session {
    /// Adds the DAGs of a plan at the end of the run so far, and returns that time.
    pub(crate) fn add(&mut self, plan: Plan, machine: &Surroundings) -> Result<u64, LaunchError> {
        let from_ns = self.recording.run_until_ns;
        if from_ns == u64::MAX || self.is_shut_down() {
            return Err(LaunchError::new(
                "the run is over, or is being shut down; add DAGs before, or make a new \
                 `VirtualTime`",
            ));
        }
        if machine.edge.is_replay() {
            return Err(LaunchError::new(
                "the run is a replay, which has the DAGs of its recording; add DAGs to other runs",
            ));
        }
        let task_set = Arc::new(self.task_set.with_added(&plan.task_set, from_ns));
        self.driver.extend(&task_set);
        self.recording.journal.extend(Arc::clone(&task_set));
        let count = task_set.dags().len();
        self.recording.degraded.resize(count, false);
        self.removals.resize(count, Removal::None);
        self.bodies.extend(plan.bodies);
        self.others.extend(plan.others);
        self.after_fault.extend(plan.after_fault);
        self.task_set = task_set;
        Ok(from_ns)
    }

    /// Closes a DAG at the end of the run so far.
    pub(crate) fn remove(&mut self, dag: DagId, machine: &Surroundings) {
        if self.removals[dag.index()] != Removal::None {
            return;
        }
        self.removals[dag.index()] = Removal::Asked;
        let journal = &self.recording.journal;
        let now_ns = match self.recording.run_until_ns {
            u64::MAX => journal.now_ns,
            until_ns => until_ns,
        };
        let (driver, mut runner) = self.parts(machine);
        driver.close(dag, now_ns, &mut runner);
        self.let_go();
    }

    /// Reports whether a DAG counts in a proof that is made now (A6).
    pub(crate) fn counts(&mut self, dag: DagId) -> bool {
        self.let_go();
        self.removals[dag.index()] != Removal::Forgotten
    }

    /// Drops the functions and values of removed DAGs that are over (A5), and forgets DAGs of
    /// which nothing is left behind (A6).
    pub(super) fn let_go(&mut self) {
        for dag in self.task_set.ids() {
            let scheduler = self.driver.scheduler_of(dag);
            if self.removals[dag.index()] == Removal::Asked && scheduler.is_over(dag) {
                self.bodies[dag.index()] = Vec::new();
                self.others[dag.index()] = Vec::new();
                if scheduler.is_idle(self.task_set.dag(dag).cluster()) {
                    self.removals[dag.index()] = Removal::Forgotten;
                }
            }
        }
    }

    /// Reports whether a DAG releases nothing any more, whatever comes.
    pub(super) fn is_closed(&self, dag: DagId) -> bool {
        self.driver.scheduler_of(dag).is_closed(dag)
    }

    /// Reports whether a function has ended the run: nothing else closes a DAG but that.
    fn is_shut_down(&self) -> bool {
        let mut others = (self.task_set.ids()).filter(|dag| {
            let is_removed = self.removals[dag.index()] != Removal::None;
            !is_removed && !self.driver.scheduler_of(*dag).is_ended(*dag)
        });
        others.any(|dag| self.is_closed(dag))
    }
}
