//! The faults of a recorded run, which come again in its replay, or do not.
//!
//! A function that fails because of its inputs fails again. What it remembers of jobs that are not
//! recorded is lacking in a replay, so a fault that follows from that does not come again; nor does
//! one of a source that is not called, or of a budget.

use alloc::string::String;

use recording::What;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

use super::{Divergence, Replay};

/// A fault of the recorded run.
#[derive(Debug)]
pub(super) struct Fault {
    instance: Instance,
    /// The name of the subtask, once it is known.
    subtask: String,
}

impl Fault {
    pub(super) fn new(dag: u16, subtask: u16, job: u64) -> Self {
        let (dag, subtask) = (DagId(dag.into()), SubtaskId(subtask.into()));
        Self {
            instance: Instance { dag, subtask, job },
            subtask: String::new(),
        }
    }
}

impl Replay {
    /// Finds the names of those that have failed. The DAGs are those of the recording.
    pub(super) fn name_faults(&mut self, task_set: &TaskSet) {
        for Fault { instance, subtask } in &mut self.faults {
            let subtasks = task_set.dag(instance.dag).subtasks();
            let failed = subtasks.get(instance.subtask.index());
            *subtask = failed.map_or("", |failed| failed.name()).into();
        }
    }

    /// Takes note that an instance of this run has failed.
    pub(crate) fn meet_fault(&mut self, instance: Instance) {
        self.faults.retain(|fault| fault.instance != instance);
    }

    /// Returns the first recorded fault, of any job or of one, that has not come again. Where the
    /// recording is of a whole run, only those count whose function is called.
    #[must_use]
    pub fn unmet_fault(&self, of: Option<(DagId, u64)>) -> Option<Divergence> {
        let is_only_a_part = self.lacking().is_some();
        let is_unmet = |Fault { instance, .. }: &&Fault| {
            let is_of = of.is_none_or(|of| of == (instance.dag, instance.job));
            is_of && self.is_of(instance.dag) && (is_only_a_part || !self.passes_over(*instance))
        };
        let Fault { instance, subtask } = self.faults.iter().find(is_unmet)?;
        Some(Divergence {
            dag: self.own.dags[instance.dag.index()].name.clone(),
            topic: subtask.clone(),
            job: instance.job,
            recorded: None,
            computed: None,
        })
    }

    /// Returns the first DAG of whose first jobs nothing is recorded, and its first job of which
    /// something is.
    pub(super) fn lacking(&self) -> Option<(String, u64)> {
        let is_skipped = |dag| {
            let mut events = self.events.iter();
            events.any(|event| (event.what, event.dag, event.job) == (What::Skip, dag, 0))
        };
        let mut of_dags = self.passed.jobs.chunk_by(|one, other| one.0 == other.0);
        let jobs = of_dags.find(|jobs| jobs[0].1 > 0 && !is_skipped(jobs[0].0))?;
        let (dag, first) = jobs[0];
        Some((self.own.dags[usize::from(dag)].name.clone(), first))
    }
}
