//! A run that has ended: what its clusters have left behind.

use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{DagId, Journal, Scheduler, SchedulerOptions, SubtaskId, TaskSet};

use super::{Execution, cluster, divided};
use crate::machine::this_core;

/// A run, taken out.
pub struct Ended {
    /// By cluster; the first one's journal is the run's.
    parts: Vec<Execution>,
}

impl Ended {
    /// Makes one of what the clusters had; `None` if that is nothing.
    pub(super) fn of(mut parts: Vec<Execution>) -> Option<Self> {
        let (first, others) = parts.split_first_mut()?;
        if cluster::MAY_DIVIDE {
            divided::merge(first, others);
        }
        Some(Self { parts })
    }

    /// Returns the scheduler of a DAG, for its counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn scheduler(&self, dag: DagId) -> &Scheduler {
        &self.parts[self.task_set().dag(dag).cluster().index()].scheduler
    }

    /// Returns how all cores were told to work.
    #[must_use]
    pub fn options(&self) -> SchedulerOptions {
        SchedulerOptions {
            cores: u32::try_from(this_core::all().len()).unwrap_or(u32::MAX),
            ..self.parts[0].scheduler.options()
        }
    }

    /// Returns the response time that is proven of a DAG, if one is.
    #[must_use]
    pub fn bound_ns(&self, dag: DagId) -> Option<u64> {
        *self.parts[0].proven.bounds_ns.get(dag.index())?
    }

    /// Returns the response time that is proven of a sink, if one is.
    #[must_use]
    pub fn sink_bound_ns(&self, dag: DagId, sink: SubtaskId) -> Option<u64> {
        let place = self.task_set().dag(dag).sinks().binary_search(&sink).ok()?;
        let of_dag = self.parts[0].proven.sink_bounds_ns.get(dag.index())?;
        *of_dag.get(place)?
    }

    /// Returns what has happened.
    #[must_use]
    pub fn journal(&self) -> &Journal {
        &self.parts[0].watcher.journal
    }

    /// Returns the model.
    #[must_use]
    pub fn task_set(&self) -> &Arc<TaskSet> {
        self.parts[0].task_set()
    }
}
