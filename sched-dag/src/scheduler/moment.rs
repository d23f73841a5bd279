//! One instant, in the order that its types force.

use super::{Decision, Observer, Scheduler};
use crate::ids::{CoreId, DagId, Instance, to_u32};

/// One instant, in which completions are still taken.
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

impl<'s> Moment<'s> {
    #[inline]
    pub(super) fn new(scheduler: &'s mut Scheduler) -> Self {
        Self { scheduler }
    }

    /// Takes note that an instance has finished.
    ///
    /// It need not run any more in the scheduler's eyes: on a machine an
    /// instance may finish while the decision to preempt it is under way. Then
    /// it only leaves the line, and the core goes on with what it was given.
    ///
    /// # Panics
    ///
    /// If the instance has not started or has ended before.
    pub fn complete(&mut self, instance: Instance, observer: &mut impl Observer) {
        self.scheduler.finish(instance, observer);
    }

    /// Takes note that an instance has ended by a fault, and ends its DAG.
    ///
    /// The instance's core is free. From now on the DAG releases no job and
    /// starts no instance; its instances that have started on other cores, or
    /// were preempted, are to be completed as ever (the module `ending` states
    /// the rules). A further instance of an ended DAG may fail, too. As with
    /// [`complete`](Self::complete), the instance need not run any more in the
    /// scheduler's eyes. Completions of the same instant should come first, as
    /// far as they are known: what finished together with the fault counts.
    ///
    /// # Panics
    ///
    /// If the instance has not started or has ended before.
    pub fn fail(&mut self, instance: Instance, observer: &mut impl Observer) {
        self.scheduler.fail(instance, observer);
    }

    /// Takes note that an instance has ended by a fault, and that the driver has another
    /// function for its subtask. If the DAG [survives](crate::FaultLimit) the fault, only
    /// the instance's job is cut, and the observer is told that the subtask is
    /// [restarted](Observer::restarted); else the DAG is ended, as by
    /// [`fail`](Self::fail). (The module `dropping` states the rules.)
    ///
    /// # Panics
    ///
    /// If the instance has not started or has ended before.
    pub fn fail_replaceable(&mut self, instance: Instance, observer: &mut impl Observer) {
        self.scheduler.fail_replaceable(instance, observer);
    }

    /// Ends a DAG as [`fail`](Self::fail) does, without an instance that has
    /// failed. Does nothing if the DAG is ended.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn stop(&mut self, dag: DagId, observer: &mut impl Observer) {
        self.scheduler.stop(dag, observer);
    }

    /// Pauses a DAG: from now on its due jobs are skipped, and what is in flight
    /// goes on (the module `pausing` states the rules). Does nothing if the DAG
    /// is closed or ended.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn pause(&mut self, dag: DagId, observer: &mut impl Observer) {
        self.scheduler.pause(dag, observer);
    }

    /// Returns the number of jobs of a DAG that are in flight.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    #[inline]
    pub fn in_flight(&self, dag: DagId) -> u64 {
        self.scheduler.in_flight(dag)
    }

    /// Ends the pause of a DAG: jobs that are due from now on are released. Does
    /// nothing if it is not paused.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn resume(&mut self, dag: DagId, observer: &mut impl Observer) {
        self.scheduler.resume(dag, observer);
    }

    /// Closes a DAG: it releases no further job, and is over when what is in flight has
    /// ended (the module `closing` states the rules). Does nothing if it is closed or ended.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn close(&mut self, dag: DagId, observer: &mut impl Observer) {
        self.scheduler.close(dag, observer);
    }

    /// Takes note of an event that a sporadic DAG waits for. Its next job is due
    /// now, or as soon after the job before it as the minimum inter-arrival time
    /// allows; while that one is to come, or waits for room, further signals are
    /// dropped and counted (the module `signals` states the rules).
    ///
    /// # Panics
    ///
    /// If there is no such DAG, or it is not sporadic.
    pub fn signal(&mut self, dag: DagId, observer: &mut impl Observer) {
        self.scheduler.signal(dag, observer);
    }

    /// Makes a core, if it is idle, the first that is given an instance, instead of the one that
    /// has become idle last: for drivers that know of one that is awake.
    pub fn prefer(&mut self, core: CoreId) {
        self.scheduler.cores.prefer(core);
    }

    /// Releases the jobs that are due, and notices deadlines that have passed.
    pub fn release_due(self, observer: &mut impl Observer) -> Released<'s> {
        let now_ns = self.scheduler.now_ns;
        while let Some((event_ns, index)) = self.scheduler.timers.peek()
            && event_ns <= now_ns
        {
            self.scheduler.serve(DagId(to_u32(index)), observer);
        }
        Released {
            scheduler: self.scheduler,
        }
    }
}

impl<'s> Released<'s> {
    /// Gives the cores to the instances with the smallest keys (R5), and
    /// returns the changes. They are in effect for the scheduler; the driver
    /// has to carry them out.
    #[must_use = "the decisions are for the driver to carry out"]
    #[inline]
    pub fn dispatch(self) -> &'s [Decision] {
        self.scheduler.decide();
        &self.scheduler.decisions
    }
}
