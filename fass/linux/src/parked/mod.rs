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

use sched_dag::journal::What;
use sched_dag::{CoreId, Vertex};

use crate::state::{Left, Number, Runner, State};
use crate::worker::Worker;

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
        let occupant = self.placement.current(core);
        occupant.is_some_and(|occupant| {
            let instance = self.scheduler.instance_of(occupant);
            let dag = self.task_set.dag(instance.dag);
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
            let mut left = self.left.remove(place);
            let vertex = left.runner.vertex;
            self.let_effects_happen(&mut left.runner, left.finish_ns);
            self.note_end_of_parked(left.worker, What::Finish, vertex);
            self.placement.finish_parked(vertex, left.runner);
            self.spare.push(left.worker);
            let instance = self.scheduler.instance_of(vertex);
            self.step(workers, |moment, mut observer| {
                moment.complete(instance, &mut observer);
            });
        }
    }

    /// Has happen what follows from an instance's completion besides what the scheduler does.
    #[inline]
    pub(crate) fn let_effects_happen(&mut self, runner: &mut Runner, finish_ns: u64) {
        if runner.body.has_effects() {
            let requests = &mut self.requests;
            let keep = &mut |request| requests.keep(request);
            runner.body.complete(finish_ns, keep);
            // Those to other clusters are on their way then.
            let (office, cluster) = (&self.office, self.cluster);
            requests.give_away(|request| office.send(cluster, request));
        }
    }

    /// Writes down that a parked instance has ended, on the core where it ran. Right now that
    /// core's processor is with the worker that says so, and what should run there is not.
    pub(crate) fn note_end_of_parked(&mut self, worker: Number, what: What, vertex: Vertex) {
        let core = self.core_of(worker);
        if what == What::Finish {
            let occupant = self.placement.current(core.index());
            if let Some(occupant) = occupant {
                self.note(What::Suspend, core, occupant);
            }
            self.note(What::Resume, core, vertex);
            // It goes on after the step that the end brings about, and within it nothing does.
            self.interrupted = occupant.map(|occupant| (core, occupant));
        }
        self.note(what, core, vertex);
    }
}

#[cfg(test)]
mod tests;
