//! One instant, in the order that its types force.

use super::{Decision, Scheduler};
use crate::ids::{CoreId, DagId, Instance, ModeId, to_u32};
use crate::journal::EventKind;
use crate::request::Request;

/// One instant, in which completions are still taken.
#[derive(Debug)]
#[must_use = "an instant without `dispatch` leaves cores idle"]
pub struct Moment<'s> {
    scheduler: &'s mut Scheduler,
    /// When the driver says that it is, which another core may have been later than.
    told_ns: u64,
}

/// The end of a *turn*: of what an instance executes from its start, or the end of a wait, to
/// its finish, or the next wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TurnEnd {
    /// The instance.
    pub instance: Instance,
    /// If it waits, for how long at most, in nanoseconds; `None`: it has finished.
    pub limit_ns: Option<u64>,
}

impl Scheduler {
    /// Does what is asked of one DAG. Compiled once, as it is rare.
    #[cold]
    #[inline]
    fn serve_request(&mut self, request: Request) {
        match request {
            Request::Signal(dag) => self.signal(dag),
            Request::Pause(dag) => self.pause(dag),
            Request::Resume(dag) => self.resume(dag),
            Request::Close(dag) => self.close(dag),
            Request::End(dag) => self.end_dag(dag),
            Request::Answer(wait) => self.answer(wait),
            // These concern the run, not one DAG; the engine serves them.
            Request::Enter(..)
            | Request::ShutDown
            | Request::Begin
            | Request::GoOn
            | Request::Step => {}
        }
    }
}

impl<'s> Moment<'s> {
    #[inline]
    pub(super) fn new(scheduler: &'s mut Scheduler, told_ns: u64) -> Self {
        Self { scheduler, told_ns }
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
    #[inline]
    pub fn complete(&mut self, instance: Instance) {
        // At the driver's own time: another core may have told a later one since, but this instance
        // finished then.
        self.scheduler
            .log
            .on_this(EventKind::Finish, self.told_ns, instance);
        self.scheduler.finish(instance);
    }

    /// Takes note that a turn of an instance has ended: it finishes, or waits (W1). As with
    /// [`complete`](Self::complete), it need not run any more in the scheduler's eyes.
    ///
    /// # Panics
    ///
    /// As [`complete`](Self::complete), or if it waits and its subtask states no waits.
    #[inline]
    pub fn end_turn(&mut self, turn: TurnEnd) {
        match turn.limit_ns {
            Some(limit_ns) => {
                let (log, told_ns) = (&mut self.scheduler.log, self.told_ns);
                log.on_this(EventKind::Wait, told_ns, turn.instance);
                let limit_ns = told_ns.saturating_add(limit_ns);
                self.scheduler.begin_wait(turn.instance, limit_ns);
            }
            None => self.complete(turn.instance),
        }
    }

    /// Takes note that an instance has ended by a fault, and ends its DAG.
    ///
    /// The instance's core is free. From now on the DAG releases no job and
    /// starts no instance; its instances that have started on other cores, or
    /// were preempted, are to be completed as ever (the module `phase` states
    /// the rules). A further instance of an ended DAG may fail, too. As with
    /// [`complete`](Self::complete), the instance need not run any more in the
    /// scheduler's eyes. Completions of the same instant should come first, as
    /// far as they are known: what finished together with the fault counts.
    ///
    /// # Panics
    ///
    /// If the instance has not started or has ended before.
    #[inline]
    pub fn fail(&mut self, instance: Instance) {
        self.scheduler
            .log
            .on_this(EventKind::Ended, self.told_ns, instance);
        // After the event: a journal shows a cause before what follows from it.
        self.scheduler.fail(instance);
    }

    /// Takes note that an instance has ended by a fault, and that the driver has another
    /// function for its subtask. If the DAG [survives](crate::FaultLimit) the fault, only
    /// the instance's job is cut, and the subtask is
    /// [restarted](EventKind::Restarted); else the DAG is ended, as by
    /// [`fail`](Self::fail). (The module `phase` states the rules.)
    ///
    /// # Panics
    ///
    /// If the instance has not started or has ended before.
    #[inline]
    pub fn fail_replaceable(&mut self, instance: Instance) {
        self.scheduler
            .log
            .on_this(EventKind::Ended, self.told_ns, instance);
        self.scheduler.fail_replaceable(instance);
    }

    /// Returns the number of jobs of a DAG that are in flight.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn in_flight(&self, dag: DagId) -> u64 {
        self.scheduler.in_flight(dag)
    }

    /// Does what is asked of one DAG; nothing at other requests. A pause of a closed DAG, or
    /// anything asked of an ended one, does nothing (the module `phase` states the rules).
    ///
    /// With a signal to a sporadic DAG its next job is due now, or as soon after the job before
    /// it as the minimum inter-arrival time allows; while that one is to come, or waits for room,
    /// further signals are dropped and counted (the module `signals` states the rules).
    ///
    /// # Panics
    ///
    /// If there is no such DAG, or a signal is to one that is not sporadic.
    #[inline(always)]
    pub fn serve(&mut self, request: Request) {
        self.scheduler.serve_request(request);
    }

    /// Writes down that the run is in another mode.
    #[inline]
    pub fn entered(&mut self, mode: ModeId) {
        let job = u64::from(mode.0);
        (self.scheduler.log).of_job(EventKind::Entered, DagId(0), job, None);
    }

    /// Makes a core, if it is idle, the first that is given an instance, instead of the one that
    /// has become idle last: for drivers that know of one that is awake.
    pub fn prefer(&mut self, core: CoreId) {
        self.scheduler.cores.prefer(core);
    }

    /// Releases the jobs that are due and takes note of deadlines that have passed. Then gives
    /// the cores to the instances with the smallest keys (R5), and returns the changes. They are
    /// in effect for the scheduler; the driver has to carry them out.
    #[must_use = "the decisions are for the driver to carry out"]
    #[inline]
    pub fn dispatch(mut self) -> &'s [Decision] {
        // Releases come after completions and ends of the instant, so that a slot that has just
        // become free is found free, and before the dispatch, which must see them.
        while self.release_next() {}
        self.scheduler.decide();
        &self.scheduler.decisions
    }

    /// Releases what is due as long as there is room for [notices](super::EventLog::has_notices), and reports whether
    /// that is all. A driver that is late finds any number of releases due.
    #[inline]
    pub fn release_some(mut self) -> bool {
        // Notices have a fixed amount of memory: the driver takes them out between two calls.
        while self.scheduler.log.has_room() {
            if !self.release_next() {
                return true;
            }
        }
        false
    }

    /// Releases the job that is due first, or notes the deadline; reports whether one is due.
    #[inline]
    fn release_next(&mut self) -> bool {
        let now_ns = self.scheduler.log.now_ns;
        let next = self.scheduler.timers.peek();
        // An event at this very instant is due: a deadline's event is one nanosecond after the
        // deadline.
        let due = next.filter(|&(event_ns, _)| event_ns <= now_ns);
        if let Some((_, index)) = due {
            self.scheduler.serve(DagId(to_u32(index)));
        }
        due.is_some()
    }
}
