//! A run as its trace describes it: the DAGs, the options, and what happened.
//!
//! Nothing is judged here. Times are nanoseconds since the run's epoch, the
//! instant from which the nominal release times O + kT count. Sums that leave
//! `u64` stay at its end, for a trace may state any number.
//!
//! *Events* are either of a job or of an instance; [`What`](sched_dag::journal::What)
//! says which. Those of the machine (`start` to `ended`) happened on the core that they
//! name, those of the scheduler in a step that was made on that core; only `request`
//! names another core, the one that shall switch.

use sched_dag::journal::Event;
use sched_dag::law::Terms;
use sched_dag::{SchedulerOptions, TaskSet};

use super::commit::Committed;

/// One run of one boot.
#[derive(Clone, Debug)]
pub struct Run {
    /// The run's number within its boot, counted from 0.
    pub number: u64,
    /// The line of the log where it begins, counted from 1.
    pub line: usize,
    /// How ready instances were ordered, whether a started one could lose its core, and
    /// how many cores the scheduler served, at least 1.
    pub options: SchedulerOptions,
    /// How long an instance may wait for what the rules owe it, where nobody says otherwise.
    pub usual_bound_ns: u64,
    /// The DAGs by number.
    pub task_set: TaskSet,
    /// What the log says of their commit; nothing if it has no such lines.
    pub committed: Committed,
    /// What happened, in the order of the log.
    pub events: Vec<Event>,
    /// Events, the oldest ones, that had made way before they were printed.
    pub lost: u64,
    /// Whether the run says that it went on until every job had ended.
    pub complete: bool,
}

impl Run {
    /// Returns what the run is judged by, if what is owed may be owed for `bound_ns`.
    #[must_use]
    pub const fn terms(&self, bound_ns: u64) -> Terms {
        Terms {
            is_whole: self.lost == 0,
            is_complete: self.complete,
            tolerance_ns: bound_ns,
        }
    }
}
