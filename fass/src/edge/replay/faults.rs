//! The faults of a recorded run, which come again in its replay, or do not.
//!
//! A function that fails because of its inputs fails again. What it remembers of jobs that are not
//! recorded is lacking in a replay, so a fault that follows from that does not come again; nor does
//! one of a source that is not called, or of a budget.

use alloc::string::String;

use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

use super::{Divergence, Replay};

/// A fault of the recorded run.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) instance: Instance,
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
        let is_unmet = |Fault { instance, .. }: &&Fault| {
            let is_of = of.is_none_or(|of| of == (instance.dag, instance.job));
            let is_only_a_part = self.begins[instance.dag.index()] > 0;
            is_of && self.is_of(instance.dag) && (is_only_a_part || !self.passes_over(*instance))
        };
        let Fault { instance, subtask } = self.faults.iter().find(is_unmet)?;
        Some(Divergence {
            dag: self.own.dags[instance.dag.index()].name.clone(),
            topic: subtask.clone(),
            is_state: false,
            job: instance.job,
            recorded: None,
            computed: None,
        })
    }
}
