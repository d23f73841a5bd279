//! What has lost its core and ends all the same.
//!
//! A demoted worker runs on while its core's processor has nothing better to do (`worker`): before
//! the one in its place has begun, while that one waits in mid-function, or when that one has
//! returned and waits for the scheduler's lock. So an instance may end that is *parked*. It ends
//! where it ran last, and the journal must tell of a core that has one instance at a time:
//!
//! - Nothing is there yet: it goes on and ends.
//! - There is one that may lose its core: that one loses it, for as long as the scheduler's step takes.
//! - There is one that keeps its core, or one that has returned and will say so as soon as it gets
//!   the lock. That one has not lost anything, so the end is *left*: it is reported when that one
//!   has ended, by the thread that reports that, or, if the scheduler gives the parked one a core
//!   before, by its own thread, there. For the model it was suspended so long.
//! - A fault takes an instance away wherever it is: no core is asked for.

use sched_dag::CoreId;
use sched_dag::engine::Port as _;
use sched_dag::journal::What;

use crate::state::{Left, Number, State};
use crate::worker::Worker;
use fass::Runner;

impl State {
    /// Returns when the instance of a worker has ended whose function returned at a time. If it
    /// lost its core and got it back before it could say so, it ends there.
    pub(crate) fn end_of(&self, worker: Number, returned_ns: u64) -> u64 {
        returned_ns.max(self.resumed_ns[worker])
    }

    /// Reports whether a worker whose instance has finished has to leave the report of that.
    #[inline]
    pub(crate) fn must_leave(&self, worker: Number, workers: &[Worker]) -> bool {
        if self.seats[worker].is_some() {
            return false;
        }
        let core = self.core_of(worker).index();
        let occupant = self.engine.placement.current(core);
        occupant.is_some_and(|occupant| {
            let instance = self.engine.scheduler.instance_of(occupant);
            let dag = self.engine.task_set.dag(instance.dag);
            dag.subtask(instance.subtask).is_non_preemptive()
                || workers[self.active[core]].has_returned()
        })
    }

    /// Reports whether a worker has left the end of its instance.
    pub(crate) fn has_left(&self, worker: Number) -> bool {
        self.left.iter().any(|left| left.worker == worker)
    }

    /// Returns what a worker has left, if it has a core now and so reports it itself.
    pub(crate) fn take_left(&mut self, worker: Number) -> Option<Left> {
        self.seats[worker]?;
        let mut left = self.left.iter();
        let place = left.position(|left| left.worker == worker)?;
        Some(self.left.swap_remove(place))
    }

    /// Reports what was left by workers that ran on a core, which has nothing with it now.
    pub(crate) fn report_left(&mut self, core: CoreId, workers: &[Worker]) {
        let is_due = |state: &Self, worker: Number| {
            state.seats[worker].is_none() && state.core_of(worker).index() == core.index()
        };
        while let Some(place) = (self.left.iter()).position(|left| is_due(self, left.worker)) {
            let left = self.left.remove(place);
            self.end_parked(left.worker, left.runner, left.finish_ns, workers);
            self.spare.push(left.worker);
        }
    }

    /// Tells the scheduler that a parked instance has ended, on the core where it ran. Right now
    /// that core's processor is with the worker that says so, and what should run there is not.
    pub(crate) fn end_parked(
        &mut self,
        worker: Number,
        runner: Box<Runner>,
        finish_ns: u64,
        workers: &[Worker],
    ) {
        let (core, vertex) = (self.core_of(worker), runner.vertex);
        let occupant = self.engine.placement.current(core.index());
        if let Some(occupant) = occupant {
            self.note(What::Suspend, core, occupant);
        }
        self.note(What::Resume, core, vertex);
        // It goes on after the step that the end brings about, and within it nothing does.
        self.interrupted = occupant.map(|occupant| (core, occupant));
        let finish_ns = self.since_epoch(finish_ns);
        let (engine, mut port) = self.parts(workers);
        let times_ns = (finish_ns, port.now_ns());
        engine.complete_parked((core, vertex), runner, times_ns, &mut port);
        self.carry_out(workers);
    }
}

#[cfg(test)]
mod tests;
