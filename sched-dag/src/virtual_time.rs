//! The driver in virtual time: a [`Scheduler`] run without a machine.
//!
//! Time jumps from event to event. What the cores do comes from a
//! [`Workload`], which is asked once for each instance, at its start, how long
//! it executes; it may run the instance's real function to find out.

use crate::ids::{CoreId, Instance};
use crate::scheduler::{Observer, Scheduler};

/// What instances do and how long it takes them.
///
/// The methods without a body of their own are called in the order in which
/// things happen; those of [`Observer`] among them.
pub trait Workload: Observer {
    /// Returns the execution time of an instance in nanoseconds. Called once
    /// for each instance, at its start; 0 is allowed.
    fn execute(&mut self, instance: Instance, now_ns: u64) -> u64;

    /// The core begins the instance; called before [`execute`](Self::execute).
    fn started(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }

    /// The core gives up the instance, which is not finished.
    fn preempted(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }

    /// The core continues the instance.
    fn resumed(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }

    /// The instance has finished on the core; called before its successors
    /// become ready.
    fn finished(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }
}

/// A workload of which only the execution times matter.
///
/// ```
/// use sched_dag::virtual_time::ExecutionTimes;
/// let mut every_instance_takes_5_ns = ExecutionTimes(|_instance| 5);
/// ```
#[derive(Debug)]
pub struct ExecutionTimes<F>(pub F);

impl<F> Observer for ExecutionTimes<F> {}

impl<F: FnMut(Instance) -> u64> Workload for ExecutionTimes<F> {
    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        (self.0)(instance)
    }
}

/// A scheduler in virtual time.
#[derive(Debug)]
pub struct VirtualTime {
    scheduler: Scheduler,
}

/// Why a run in virtual time has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum End {
    /// Every job of every DAG has ended.
    Finished,
    /// The next event lies after the time up to which the run should go.
    TimeReached,
    /// An instance would finish after the last time there is.
    TimeOverflow(Instance),
}

impl VirtualTime {
    /// Makes a driver at time 0, and allocates all that it will need.
    #[must_use]
    pub fn new(scheduler: Scheduler) -> Self {
        Self { scheduler }
    }

    /// Runs until every job has ended.
    ///
    /// A DAG without a limit of jobs has no end; see [`run_until`](Self::run_until).
    pub fn run(&mut self, workload: &mut impl Workload) -> End {
        self.run_until(u64::MAX, workload)
    }

    /// Runs all events up to and including `until_ns`; may be called again.
    pub fn run_until(&mut self, until_ns: u64, workload: &mut impl Workload) -> End {
        let _ = (until_ns, workload);
        todo!()
    }

    /// Returns the time of the last event.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        todo!()
    }

    /// Returns the scheduler, for its statistics.
    #[must_use]
    pub const fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }
}
