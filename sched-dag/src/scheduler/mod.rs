//! The scheduler as a pure state machine.

mod decision;
mod observer;
mod statistics;

use alloc::sync::Arc;

pub use decision::Decision;
pub use observer::{JobOutcome, Observer};
pub use statistics::DagStatistics;

use crate::ids::{CoreId, DagId, Instance};
use crate::policy::{Policy, Preemption};
use crate::task_set::TaskSet;

/// How a scheduler orders instances, and for how many cores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SchedulerOptions {
    /// How the ready instances are ordered.
    pub policy: Policy,
    /// Whether a started instance may lose its core.
    pub preemption: Preemption,
    /// The number of cores, at least 1.
    pub cores: u32,
}

/// The state of all jobs in flight.
#[derive(Debug)]
pub struct Scheduler {
    task_set: Arc<TaskSet>,
    options: SchedulerOptions,
}

/// One instant, in which completions are still accepted.
#[derive(Debug)]
#[must_use = "an instant without `release_due` and `dispatch` leaves cores idle"]
pub struct Moment<'s> {
    scheduler: &'s mut Scheduler,
}

/// One instant after its completions and releases.
#[derive(Debug)]
#[must_use = "an instant without `dispatch` leaves cores idle"]
pub struct Released<'s> {
    scheduler: &'s mut Scheduler,
}

impl Scheduler {
    /// Makes a scheduler with no job released, and allocates all it will need.
    ///
    /// # Panics
    ///
    /// If the options say 0 cores.
    #[must_use]
    pub fn new(task_set: Arc<TaskSet>, options: SchedulerOptions) -> Self {
        Self { task_set, options }
    }

    /// Begins the instant `now_ns`.
    pub fn at(&mut self, now_ns: u64) -> Moment<'_> {
        let _ = now_ns;
        Moment { scheduler: self }
    }

    /// Returns the time of the next release or expiry of a deadline.
    #[must_use]
    pub fn next_event_ns(&self) -> Option<u64> {
        todo!()
    }

    /// Returns what a core executes.
    ///
    /// # Panics
    ///
    /// If there is no such core.
    #[must_use]
    pub fn running(&self, core: CoreId) -> Option<Instance> {
        let _ = core;
        todo!()
    }

    /// Reports whether all jobs of all DAGs have been released or skipped, and
    /// none is in flight. Never true if a DAG has no limit of jobs.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        todo!()
    }

    /// Returns a DAG's counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn statistics(&self, dag: DagId) -> &DagStatistics {
        let _ = dag;
        todo!()
    }

    /// Returns the model that is scheduled.
    #[must_use]
    pub fn task_set(&self) -> &Arc<TaskSet> {
        &self.task_set
    }

    /// Returns the options.
    #[must_use]
    pub const fn options(&self) -> SchedulerOptions {
        self.options
    }
}

impl<'s> Moment<'s> {
    /// Takes note that an instance has finished.
    ///
    /// # Panics
    ///
    /// If the instance has not started or has finished before.
    pub fn complete(&mut self, instance: Instance, observer: &mut impl Observer) {
        let _ = (instance, observer);
        todo!()
    }

    /// Releases the jobs that are due, and notices deadlines that have passed.
    pub fn release_due(self, observer: &mut impl Observer) -> Released<'s> {
        let _ = observer;
        Released {
            scheduler: self.scheduler,
        }
    }
}

impl<'s> Released<'s> {
    /// Gives the cores to the instances with the smallest keys (R5).
    #[must_use = "the decisions are for the driver to carry out"]
    pub fn dispatch(self) -> &'s [Decision] {
        let _ = &self.scheduler;
        &[]
    }
}
