//! One instant, in the order forced by its types.

use super::{Decision, Scheduler};
use crate::ids::{CoreId, DagId, Instance, ModeId, to_u32};
use crate::journal::EventKind;
use crate::request::Request;

/// One instant, still open for completions.
#[derive(Debug)]
#[must_use = "an instant without `dispatch` leaves cores idle"]
pub struct Moment<'s> {
    scheduler: &'s mut Scheduler,
    /// The driver's time of the instant. Another core may have reported a later time before.
    told_ns: u64,
}

/// The end of a *turn*. A turn is the execution of an instance from its start, or the end of a
/// wait, to its finish, its fault, or the next wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TurnEnd {
    /// The instance.
    pub instance: Instance,
    /// The limit of the following wait, in nanoseconds; `None`: the instance has finished.
    pub limit_ns: Option<u64>,
}

impl Scheduler {
    /// Serves a request about one DAG. Compiled once, because requests are rare.
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
            // Requests about the run, not about one DAG; the engine serves them.
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
    /// The instance may already be preempted in the scheduler's eyes: on a machine an instance may
    /// finish while the decision to preempt it is under way. Then the instance only leaves the
    /// line, and the core goes on with its new instance.
    ///
    /// # Panics
    ///
    /// If the instance has not started, waits, or has ended before.
    #[inline]
    pub fn complete(&mut self, instance: Instance) {
        // At the driver's own time: the instance finished then, even if another core has reported a
        // later time since.
        self.scheduler
            .log
            .on_this(EventKind::Finish, self.told_ns, instance);
        self.scheduler.finish(instance);
    }

    /// Takes note that a turn of an instance has ended: the instance finishes, or begins a wait
    /// (W1); in a cut job it is cancelled instead of waiting (W6). As with
    /// [`complete`](Self::complete), the instance may already be preempted in the scheduler's eyes.
    ///
    /// # Panics
    ///
    /// As [`complete`](Self::complete), or if the instance begins a wait and its subtask states no
    /// waits.
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
    /// The instance's core, if it still has one, is free. From now on the DAG releases no job and
    /// starts no instance. Instances started on other cores, or preempted, are to be completed as
    /// ever; waiting instances are cancelled (the module `phase` states the rules). A further
    /// instance of an ended DAG may fail, too. As with [`complete`](Self::complete), the instance
    /// may already be preempted in the scheduler's eyes. Drivers should report known completions of
    /// the same instant first: an instance that finished together with the fault counts as
    /// finished.
    ///
    /// # Panics
    ///
    /// If the instance has not started, waits, or has ended before.
    #[inline]
    pub fn fail(&mut self, instance: Instance) {
        self.scheduler
            .log
            .on_this(EventKind::Ended, self.told_ns, instance);
        // After the event: a journal shows a cause before its consequences.
        self.scheduler.fail(instance);
    }

    /// Takes note that an instance has ended by a fault, and that the driver has another function
    /// for its subtask. If the DAG [survives](crate::FaultLimit) the fault, only the instance's job
    /// is cut, unless it was cut before, and the subtask is [restarted](EventKind::Restarted);
    /// otherwise the DAG is ended, as by [`fail`](Self::fail). (The module `phase` states the
    /// rules.)
    ///
    /// # Panics
    ///
    /// If the instance has not started, waits, or has ended before.
    #[inline]
    pub fn fail_replaceable(&mut self, instance: Instance) {
        self.scheduler
            .log
            .on_this(EventKind::Ended, self.told_ns, instance);
        self.scheduler.fail_replaceable(instance);
    }

    /// Returns the number of a DAG's jobs in flight.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn in_flight(&self, dag: DagId) -> u64 {
        self.scheduler.in_flight(dag)
    }

    /// Serves a request about one DAG; ignores other requests. A pause of a closed DAG, or any
    /// request to an ended DAG except a signal, does nothing (the module `phase` states the rules).
    ///
    /// With a signal to a sporadic DAG, its next job is due now, or as soon after the job before as
    /// the minimum inter-arrival time allows. While the next job is to come, or waits for room,
    /// further signals are dropped and counted, like all signals beyond the limit of jobs, and to a
    /// closed or ended DAG (the module `signals` states the rules).
    ///
    /// # Panics
    ///
    /// If there is no such DAG, or if the request is a signal to a DAG that is not sporadic.
    #[inline(always)]
    pub fn serve(&mut self, request: Request) {
        self.scheduler.serve_request(request);
    }

    /// Records that the run is in another mode.
    #[inline]
    pub fn entered(&mut self, mode: ModeId) {
        let job = u64::from(mode.0);
        (self.scheduler.log).of_job(EventKind::Entered, DagId(0), job, None);
    }

    /// Makes a core, if it is idle, the first to be given an instance, instead of the core that
    /// became idle last: for drivers that know of a core that is awake.
    pub fn prefer(&mut self, core: CoreId) {
        self.scheduler.cores.prefer(core);
    }

    /// Releases the jobs that are due, ends the waits whose limit has come, and takes note of
    /// passed deadlines. Then gives the cores to entries of tables (T1) and otherwise to the
    /// instances with the smallest keys (R5, T4), and returns the changes. The changes are in
    /// effect for the scheduler; the driver has to carry them out.
    #[must_use = "the decisions are for the driver to carry out"]
    #[inline]
    pub fn dispatch(mut self) -> &'s [Decision] {
        // Releases come after the completions and ends of the instant, so that a slot just freed is
        // found free, and before the dispatch, which must see the released jobs.
        while self.release_next() {}
        self.scheduler.decide();
        &self.scheduler.decisions
    }

    /// Releases due jobs as long as there is room for [notices](super::EventLog::has_notices), and
    /// reports whether all are released. A late driver finds any number of releases due.
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

    /// Serves the event due first: the due jobs and passed deadlines of one DAG, the limit of a
    /// wait, or a report of skips. Reports whether anything was due.
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
