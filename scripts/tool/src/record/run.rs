//! A run as a record tells it.

use sched_dag::chains::Sampling;
use sched_dag::journal::Event;
use sched_dag::law::Terms;
use sched_dag::{SchedulerOptions, TaskSet};

/// A run: its model, and what happened in it.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its number within the boot, from 0.
    pub number: u64,
    /// How it was scheduled.
    pub options: SchedulerOptions,
    /// How late cores may be, if nobody says otherwise, in nanoseconds.
    pub usual_bound_ns: u64,
    /// The DAGs.
    pub task_set: TaskSet,
    /// The samplings of subtasks.
    pub samplings: Vec<Sampling>,
    /// The bound that was proven of each DAG.
    pub bounds_ns: Vec<Option<u64>>,
    /// The events, in the order of the journal.
    pub events: Vec<Event>,
    /// How many events came before these, and are lost.
    pub lost: u64,
    /// Whether the run has ended in order, so that nothing is to come.
    pub complete: bool,
}

impl Run {
    /// Returns on which terms it is judged, by a bound in nanoseconds.
    #[must_use]
    pub const fn terms(&self, bound_ns: u64) -> Terms {
        Terms {
            is_whole: self.lost == 0,
            is_complete: self.complete,
            tolerance_ns: bound_ns,
        }
    }
}
