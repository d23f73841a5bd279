//! The engine of one cluster: its scheduler, the bodies under the scheduler's control, and the
//! pending requests, in the steps common to every platform.
//!
//! A platform holds the engine under one lock, or alone. Through its [`PlatformPort`] the platform
//! reports the time, starts a body on a core, and reaches other clusters. A [`SubtaskBody`] runs
//! the instances of a subtask. Each event is one call, such as [`complete`](Engine::complete),
//! [`fail`](Engine::fail), [`wake`](Engine::wake), or [`step`](Engine::step) for everything without
//! a call of its own. Then the platform brings the cores [concerned](PlatformPort::retarget) by the
//! step to their targets: [`next`](Engine::next) gives a core its next instance,
//! [`suspend`](Engine::suspend) takes an instance away.
//!
//! # Guarantees
//!
//! - The cost of a fault, the effect of requests and the choice of the next instance are decided
//!   here, for all platforms alike.
//! - The journal is in the order of the decisions. A [start](PlatformPort::start) is recorded
//!   before the function begins, except in virtual time, where a workload may run the function to
//!   find its execution time.
//! - After [`Engine::of_clusters`] nothing is allocated here, except by a growing journal, and
//!   every step is bounded except for the releases and deadlines passed, and the signals come from
//!   other clusters or from outside, since the last step.

mod run;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::DerefMut;

use crate::ids::{ClusterId, CoreId, DagId, Vertex};
use crate::journal::{EventKind, EventSubject};
use crate::kept::Journal;
use crate::lifecycle::{Mailboxes, Parts, PendingRequests, Request, WaitLimit};
use crate::placement::{NextWork, Placement};
use crate::policies::SchedulerOptions;
use crate::scheduler::{Decision, DriverNotice, HandOff, Moment, Scheduler, TurnEnd, Unwritten};
use crate::task_set::{Dag, TaskSet};

pub use crate::engine::run::{ProvenBounds, Run, RunCounts};

/// A cluster's scheduler, its bodies, and the pending requests. `P` is a platform's representation
/// of a suspended instance.
#[derive(Debug)]
pub struct Engine<B: SubtaskBody, P> {
    /// The scheduler, with its journal.
    pub scheduler: Scheduler,
    /// The places of the bodies on cores.
    pub placement: Placement<B, P>,
    /// The cluster.
    pub cluster: ClusterId,
    /// The task set.
    pub task_set: Arc<TaskSet>,
    /// Requests of the run on their way to the scheduler.
    pub requests: PendingRequests,
    /// The bodies whose functions a fault has ended for good, as far as the platform has taken them
    /// back.
    pub lost: Vec<B>,
    /// By vertex, the function to take over after a fault.
    alternates: Box<[Option<B::Alternate>]>,
    /// By DAG, the handler DAG to be signalled when a fault ends the DAG.
    after_fault: Vec<Option<DagId>>,
    /// Room for looking at notices.
    notices: Vec<DriverNotice>,
    /// Cancelled instances whose bodies run older instances, and so cannot discard yet. While there
    /// are any, [`Request::Step`] keeps completions from taking the short way.
    undiscarded: Vec<(Vertex, u64)>,
}

impl<B: SubtaskBody, P> Engine<B, P> {
    /// Makes an engine without bodies for each cluster of a task set, with the cluster's part of
    /// the lifecycle, and allocates all memory the engines need. By DAG, `after_fault` is the
    /// handler DAG to be signalled when a fault ends the DAG.
    pub fn of_clusters<C: PlatformPort<B>>(
        task_set: &Arc<TaskSet>,
        options: SchedulerOptions,
        parts: Parts,
        after_fault: &[Option<DagId>],
        journal: impl Fn(ClusterId) -> Journal,
    ) -> impl Iterator<Item = Self> {
        task_set.clusters().zip(parts).map(move |(cluster, part)| {
            let scheduler = Scheduler::of_cluster(Arc::clone(task_set), options, cluster);
            let requests = PendingRequests::new(task_set.dags().len(), part);
            Self::new::<C>(cluster, scheduler, journal(cluster), requests, after_fault)
        })
    }

    fn new<C: PlatformPort<B>>(
        cluster: ClusterId,
        mut scheduler: Scheduler,
        journal: Journal,
        requests: PendingRequests,
        after_fault: &[Option<DagId>],
    ) -> Self {
        let task_set = Arc::clone(scheduler.task_set());
        let (vertices, cores) = (task_set.vertices(), scheduler.options().cores as usize);
        let of_dag = |dag: &Dag| dag.slots() * dag.subtasks().len();
        let instances: usize = task_set.dags().iter().map(of_dag).sum();
        // The engine itself needs to hear of cancelled instances, to discard their inputs.
        let room = scheduler.hear(C::HEARS.iter().copied().chain([EventKind::Cancelled]));
        // The journal comes from the platform, which knows how much memory there is.
        scheduler.log.journal = journal;
        Self {
            placement: Placement::empty(vertices, cores),
            cluster,
            requests,
            lost: Vec::with_capacity(vertices),
            alternates: (0..vertices).map(|_| None).collect(),
            after_fault: after_fault.to_vec(),
            notices: Vec::with_capacity(room),
            // At the end of a step at most `instances` instances are in flight, and each is
            // cancelled at most once. A late step cancels the instances of several jobs, job by
            // job.
            undiscarded: Vec::with_capacity(instances + room),
            scheduler,
            task_set,
        }
    }

    /// Takes the body of a subtask, before the run.
    pub fn put(&mut self, vertex: Vertex, body: B) {
        // Kept apart from the body, so that it can be queried while the body runs.
        self.alternates[vertex.index()] = body.alternate();
        self.placement.replace(vertex, body);
    }

    /// Records what a core does with the instance of a vertex.
    pub fn note(&mut self, what: EventKind, core: CoreId, vertex: Vertex, time_ns: u64) {
        let instance = self.scheduler.instance_of(vertex);
        self.scheduler.log.on_core(core, what, time_ns, instance);
    }

    /// Takes a step at an instant, on a core: the event `happened`, requests, releases, a dispatch.
    #[inline]
    pub fn step(
        &mut self,
        instant: (u64, CoreId),
        port: &mut impl PlatformPort<B>,
        happened: impl FnOnce(&mut Moment<'_>),
    ) {
        self.tell(instant, port, happened);
        self.decide(instant.0, port);
    }

    /// Tells the scheduler of an event and of pending requests. The instant stays open.
    #[inline(always)]
    pub fn tell(
        &mut self,
        (now_ns, here): (u64, CoreId),
        port: &mut impl PlatformPort<B>,
        happened: impl FnOnce(&mut Moment<'_>),
    ) {
        self.scheduler.log.here = here;
        let mut moment = self.scheduler.at(now_ns);
        happened(&mut moment);
        // Requests after completions: a function's request takes effect with its completion.
        if !self.requests.are_none() || port.has_letters() {
            self.serve(now_ns, port);
        }
        self.act(port);
    }

    /// Serves the pending requests. Out of line, as most steps have none.
    #[cold]
    #[inline(never)]
    fn serve(&mut self, now_ns: u64, port: &mut impl PlatformPort<B>) {
        // Requests to other clusters first, so that they are not served here.
        self.requests.give_away(|request| port.forward(request));
        let mut moment = self.scheduler.at(now_ns);
        if let Some(letters) = port.take_letters() {
            (self.requests).take_letters(letters, self.cluster, &mut moment);
        }
        self.requests.serve(&mut moment);
        // The `Step` that keeps the short way closed comes here: by now an older instance may have
        // ended, and its body may rest.
        self.discard_late();
    }

    /// Ends the instant: releases the due jobs, and sets the cores' targets.
    #[inline]
    pub fn decide(&mut self, now_ns: u64, port: &mut impl PlatformPort<B>) {
        // As often as notices fill their room; each round the port takes them out.
        while !self.scheduler.at(now_ns).release_some() {
            self.act(port);
        }
        let _ = self.scheduler.at(now_ns).dispatch();
        self.act(port);
        self.set_targets(port);
        // The flag concerns the step, and the platform reads the next event after each step anyway.
        self.scheduler.log.take_job_event();
    }

    /// Returns the decisions of the latest step. A core is named at most twice.
    pub fn decisions(&self) -> &[Decision] {
        self.scheduler.decisions()
    }

    /// Takes note that a core has finished an instance, or that the instance's turn has ended in a
    /// wait. If `is_alone`, the completion may be the whole instant, and the core may go on without
    /// a step.
    #[inline(always)]
    pub fn complete<C: PlatformPort<B>>(
        &mut self,
        (core, vertex): (CoreId, Vertex),
        mut body: B,
        finish_ns: u64,
        is_alone: bool,
        port: &mut C,
    ) -> NextAction<B> {
        // Before the scheduler knows: the latest value must be there when a successor of this
        // instance starts.
        if body.has_effects()
            && let Some(limit) = self.publish(&mut body, port.on_clock(finish_ns))
        {
            // Checked here, so that the port need not be in memory for subtasks without waits.
            let is_alone = is_alone && !port.has_letters();
            return self.wait((core, vertex), body, (finish_ns, limit), is_alone, port);
        }
        // Another event belongs to this instant, so the whole step has to be taken.
        if !is_alone || !self.requests.are_none() {
            let instance = self.scheduler.instance_of(vertex);
            self.placement.finish(core.index(), vertex, body);
            let limit_ns = None;
            return NextAction::Step(Some(TurnEnd { instance, limit_ns }));
        }
        let (done, unwritten) = self.scheduler.pass_on(finish_ns, core, vertex);
        if let HandOff::To(next, decision) = done {
            let (ended, hop) = ((core, finish_ns), (vertex, next, decision.instance.job));
            // A separate copy for each way: the frequent way makes no check twice.
            return match unwritten {
                Unwritten::FinishAndReady => self.hop::<C, true, true>(ended, hop, body, port),
                Unwritten::Finish => self.hop::<C, true, false>(ended, hop, body, port),
                Unwritten::Nothing => self.hop::<C, false, false>(ended, hop, body, port),
            };
        }
        self.placement.finish(core.index(), vertex, body);
        self.act(port);
        // More is to be decided: the caller begins the instant again, at the same time.
        if let HandOff::Open = done {
            return NextAction::Step(None);
        }
        // A job's end may bring the next timer forward or back; the platform sets its alarm anew.
        let is_rescheduled = self.scheduler.log.take_job_event();
        NextAction::Look { is_rescheduled }
    }

    /// Makes a core go on from one vertex to the next, with the next vertex's instance of a job.
    #[inline(always)]
    fn hop<C: PlatformPort<B>, const HAS_ENDED: bool, const IS_NEW: bool>(
        &mut self,
        (core, finish_ns): (CoreId, u64),
        (vertex, next, job): (Vertex, Vertex, u64),
        body: B,
        port: &mut C,
    ) -> NextAction<B> {
        // Before the body goes back to its place.
        let finish = (EventKind::Finish, finish_ns, body.subject());
        let exchanged = self.placement.exchange(core, vertex, body, next);
        if !HAS_ENDED {
            // Jobs may have been cut on this way, too: their inputs are given up before the next
            // function begins.
            self.act(port);
        }
        let log = &mut self.scheduler.log;
        let Some(mut body) = exchanged else {
            // The next instance has started before, so its readiness is already recorded.
            if HAS_ENDED {
                log.journal.write_all(core, [finish]);
            }
            return NextAction::Look {
                is_rescheduled: false,
            };
        };
        body.set_job(job);
        let to = body.subject();
        let start_ns = port.start(core, &mut body, log.now_ns());
        let start = (EventKind::Start, start_ns, to);
        // One entry instead of several: the times of finish and ready are the same.
        if IS_NEW {
            let ready = (EventKind::Ready, log.now_ns(), to);
            log.journal.write_all(core, [finish, ready, start]);
        } else if HAS_ENDED {
            log.journal.write_all(core, [finish, start]);
        } else {
            log.journal.write_all(core, [start]);
        }
        NextAction::Run(body)
    }

    /// Takes note that the turn of a core's instance has ended in a wait, which may be the whole
    /// instant, too. Out of line, as most sets have no waits.
    #[cold]
    #[inline(never)]
    fn wait<C: PlatformPort<B>>(
        &mut self,
        (core, vertex): (CoreId, Vertex),
        mut body: B,
        (ended_ns, limit): (u64, WaitLimit),
        is_alone: bool,
        port: &mut C,
    ) -> NextAction<B> {
        let limit_ns = self.limit_ns(vertex, limit, ended_ns);
        port.wait(core, &mut body, ended_ns);
        let done = match is_alone && !C::ANSWERS_AT_ONCE && self.requests.are_none() {
            true => (self.scheduler).wait_shortly(ended_ns, core, vertex, limit_ns),
            false => None,
        };
        // A wait of no time, and nothing more urgent: only body and journal learn of it.
        if let Some(HandOff::To(next, _)) = done
            && next == vertex
        {
            body.wake(true);
            let (log, subject) = (&mut self.scheduler.log, body.subject());
            let wait = (EventKind::Wait, ended_ns, subject);
            let wake = (EventKind::Wake, log.now_ns(), subject);
            let resume_ns = port.proceed(core, &mut body, log.now_ns());
            let resume = (EventKind::Resume, resume_ns, subject);
            log.journal.write_all(core, [wait, wake, resume]);
            return NextAction::Run(body);
        }
        self.placement.wait(core.index(), vertex, body);
        match done {
            None => {
                let instance = self.scheduler.instance_of(vertex);
                let limit_ns = Some(limit_ns);
                return NextAction::Step(Some(TurnEnd { instance, limit_ns }));
            }
            Some(HandOff::To(next, _)) => self.placement.set_target(core, Some(next)),
            Some(HandOff::Idle | HandOff::Open) => {}
        }
        let is_rescheduled = self.scheduler.log.take_job_event();
        NextAction::Look { is_rescheduled }
    }

    /// Ends the wait whose limit has come, at an instant and on a core, and gives its instance an
    /// idle core. Reports whether this is the whole instant; if not, a step has to be taken.
    #[inline]
    pub fn wake(&mut self, (now_ns, here): (u64, CoreId), port: &mut impl PlatformPort<B>) -> bool {
        let is_alone = self.requests.are_none() && !port.has_letters();
        let woken = match is_alone {
            true => self.scheduler.wake_shortly(now_ns, here),
            false => None,
        };
        if let Some((core, vertex)) = woken {
            self.placement.set_target(core, Some(vertex));
            port.retarget(core);
        }
        woken.is_some()
    }

    /// Takes note of the end of a turn whose instance no core has any more; `core` ran it last. The
    /// turn ended at the first of the two times; the second is the instant.
    pub fn complete_parked(
        &mut self,
        (core, vertex): (CoreId, Vertex),
        mut body: B,
        (finish_ns, now_ns): (u64, u64),
        port: &mut impl PlatformPort<B>,
    ) {
        let wait = self.publish(&mut body, port.on_clock(finish_ns));
        let instance = self.scheduler.instance_of(vertex);
        let limit_ns = wait.map(|limit| self.limit_ns(vertex, limit, finish_ns));
        match limit_ns {
            Some(_) => {
                port.wait(core, &mut body, finish_ns);
                self.placement.wait(core.index(), vertex, body);
            }
            None => self.placement.finish_parked(vertex, body),
        }
        let turn = TurnEnd { instance, limit_ns };
        // By the whole step: the core runs another instance by now, so there is no hand-off.
        self.step((now_ns, core), port, |moment| moment.end_turn(turn));
    }

    /// Returns the limit of a wait beginning now, in nanoseconds.
    fn limit_ns(&self, vertex: Vertex, limit: WaitLimit, now_ns: u64) -> u64 {
        match limit {
            WaitLimit::For(limit_ns) => limit_ns,
            WaitLimit::SinceRelease(after_ns) => {
                let until_ns = self.scheduler.release_ns(vertex).saturating_add(after_ns);
                // An instant that has passed is a wait of no time.
                until_ns.saturating_sub(now_ns)
            }
        }
    }

    /// Returns the cost of a fault of the vertex's present instance.
    fn cost_of_fault(&self, vertex: Vertex) -> FaultCost {
        let instance = self.scheduler.instance_of(vertex);
        let alternate = self.alternates[vertex.index()].as_ref();
        let is_survived = self.scheduler.survives(instance.dag, instance.job);
        match alternate.filter(|next| is_survived && next.is_there()) {
            None => FaultCost::Dag,
            Some(next) if next.is_fallback() => FaultCost::Degraded,
            Some(_) => FaultCost::Job,
        }
    }

    /// Ends an instance by a fault on a core, and its job or its DAG with it. The platform has
    /// taken the body back if possible; without the body the fault costs the DAG.
    #[inline]
    pub fn fail(
        &mut self,
        instant: (u64, CoreId),
        vertex: Vertex,
        body: Option<B>,
        port: &mut impl PlatformPort<B>,
    ) -> FaultCost {
        let cost = self.tell_fault(instant, vertex, body, port);
        self.decide(instant.0, port);
        cost
    }

    /// Ends an instance as [`fail`](Self::fail) does, and leaves the instant open.
    pub fn tell_fault(
        &mut self,
        instant: (u64, CoreId),
        vertex: Vertex,
        body: Option<B>,
        port: &mut impl PlatformPort<B>,
    ) -> FaultCost {
        let instance = self.scheduler.instance_of(vertex);
        // Without its body the subtask cannot be replaced.
        let cost = match &body {
            Some(_) => self.cost_of_fault(vertex),
            None => FaultCost::Dag,
        };
        if cost != FaultCost::Dag {
            self.tell(instant, port, |moment| moment.fail_replaceable(instance));
            if let Some(mut body) = body {
                body.replace();
                self.placement.replace(vertex, body);
                // Before the subtask may start again, as the next job may reuse the places of older
                // jobs.
                self.discard_late();
            }
            return cost;
        }
        let handler = self.after_fault.get(instance.dag.index()).copied();
        let handler = handler.flatten();
        // A handler in another cluster gets its signal as a letter.
        let handler = handler.filter(|&dag| !port.forward(Request::Signal(dag)));
        self.tell(instant, port, |moment| {
            // The end first: the handler's signal comes to a run in which the DAG is ended.
            moment.fail(instance);
            handler
                .into_iter()
                .for_each(|dag| moment.serve(Request::Signal(dag)));
        });
        // Dropped after the run: its values may be large, and a destructor is the app's code.
        self.lost.extend(body);
        cost
    }

    /// Finds the next work of a core without an instance, at an instant. The engine has recorded
    /// the start of [`NextWork::Start`], and the resumption of [`NextWork::Proceed`]. The caller,
    /// who knows the time, [records](Self::note) that of [`NextWork::Continue`].
    #[inline]
    pub fn next(
        &mut self,
        (now_ns, core): (u64, CoreId),
        port: &mut impl PlatformPort<B>,
    ) -> NextWork<B, P> {
        let mut next = self.placement.next(core.index());
        if let NextWork::Start(vertex, body) = &mut next {
            let instance = self.scheduler.instance_of(*vertex);
            body.set_job(instance.job);
            let subject = body.subject();
            // A port that reads the clock reads it as late as possible, right before the call.
            let start_ns = port.start(core, body, now_ns);
            (self.scheduler.log.journal).write(core, EventKind::Start, start_ns, subject);
        } else if let NextWork::Proceed(vertex, body) = &mut next {
            self.proceed((now_ns, core, *vertex), body, port);
        }
        next
    }

    /// Makes a core go on with an instance after its wait. Out of line, as most sets have no waits.
    #[cold]
    #[inline(never)]
    fn proceed(
        &mut self,
        (now_ns, core, vertex): (u64, CoreId, Vertex),
        body: &mut B,
        port: &mut impl PlatformPort<B>,
    ) {
        let (_, has_timed_out) = self.scheduler.latest_wait(vertex);
        body.wake(has_timed_out);
        let subject = body.subject();
        let resume_ns = port.proceed(core, body, now_ns);
        (self.scheduler.log.journal).write(core, EventKind::Resume, resume_ns, subject);
    }

    /// Takes a core's instance away, if there is one, and returns the core waiting for it, if any.
    pub fn suspend(&mut self, core: CoreId, now_ns: u64, parked: P) -> Option<CoreId> {
        let vertex = self.placement.detach(core.index())?;
        self.note(EventKind::Suspend, core, vertex, now_ns);
        self.placement.suspend(vertex, parked)
    }

    #[inline]
    fn publish(&mut self, body: &mut B, finish_ns: u64) -> Option<WaitLimit> {
        body.complete(finish_ns, &mut |request| self.requests.keep(request))
    }

    #[inline]
    fn act(&mut self, port: &mut impl PlatformPort<B>) {
        if self.scheduler.log.has_notices() {
            self.act_on_notices(port);
        }
    }

    #[cold]
    #[inline(never)]
    fn act_on_notices(&mut self, port: &mut impl PlatformPort<B>) {
        self.scheduler.log.exchange_notices(&mut self.notices);
        for notice in &self.notices {
            port.hear(notice);
            if notice.event.what == EventKind::Cancelled
                && let Some(instance) = notice.event.instance()
            {
                let vertex = self.task_set.vertex(instance);
                self.placement.cancel_wait(vertex);
                self.undiscarded.push((vertex, instance.job));
            }
        }
        self.discard_late();
    }

    /// Discards the inputs of cancelled instances as soon as their bodies rest: before the places
    /// of the inputs are used again, as jobs end in their order.
    #[cold]
    #[inline(never)]
    fn discard_late(&mut self) {
        self.undiscarded.retain(|&(vertex, job)| {
            // A running body, or a body with a parked context, still reads its inputs.
            if let Some(body) = self.placement.resting(vertex) {
                body.discard(job);
                return false;
            }
            let dag = self.scheduler.instance_of(vertex).dag;
            // An ended DAG starts nothing any more, so no later job needs the places of its inputs.
            !self.scheduler.is_ended(dag)
        });
        // The short way would start the next instance without looking here.
        if !self.undiscarded.is_empty() {
            self.requests.keep(Request::Step);
        }
    }

    #[inline]
    fn set_targets<C: PlatformPort<B>>(&mut self, port: &mut C) {
        let mut preempted = None;
        let (decisions, log) = self.scheduler.decided();
        for decision in decisions {
            let (core, instance) = (decision.core, decision.instance);
            port.retarget(core);
            // The next decision names the same core with its new instance.
            if decision.what == EventKind::Suspend {
                self.placement.set_target(core, None);
                preempted = Some(core);
            } else {
                let vertex = self.task_set.vertex(instance);
                self.placement.set_target(core, Some(vertex));
                // Where an interrupt has to arrive first, the journal records the time of the
                // request.
                if C::SUSPENDS_LATER && preempted == Some(core) {
                    log.on_core(core, EventKind::Request, port.now_ns(), instance);
                }
            }
        }
    }
}

/// The code of one subtask, as seen by the engine. Each subtask has one body, because it has at
/// most one started and unfinished instance at a time (R2).
pub trait SubtaskBody {
    /// A function to take over after a fault.
    type Alternate: Alternate;

    /// Begins another job.
    fn set_job(&mut self, job: u64);

    /// Returns the present instance as the subject of events.
    fn subject(&self) -> EventSubject;

    /// Gives up the arrived inputs of a job that the body will not run, or the remaining inputs of
    /// a job in which it has waited.
    fn discard(&mut self, job: u64);

    /// Called before the instance goes on after a wait: tells whether the limit has ended the wait.
    fn wake(&mut self, _has_timed_out: bool) {}

    /// Reports whether a completion has effects outside the scheduler.
    fn has_effects(&self) -> bool;

    /// Publishes the effects of a completion, and passes on the function's requests. If the turn
    /// has ended in a wait, returns the limit of the wait. `finish_ns` is on the clock read by
    /// functions.
    fn complete(&mut self, finish_ns: u64, ask: &mut dyn FnMut(Request)) -> Option<WaitLimit>;

    /// Returns the alternate that takes over if a fault ends the function.
    fn alternate(&self) -> Option<Self::Alternate>;

    /// Makes the body go on with the alternate, after a fault.
    fn replace(&mut self);
}

/// A pointer to a body, such as a box, is a body.
impl<D: DerefMut<Target: SubtaskBody>> SubtaskBody for D {
    type Alternate = <D::Target as SubtaskBody>::Alternate;

    #[inline]
    fn set_job(&mut self, job: u64) {
        (**self).set_job(job);
    }

    #[inline]
    fn subject(&self) -> EventSubject {
        (**self).subject()
    }

    fn discard(&mut self, job: u64) {
        (**self).discard(job);
    }

    fn wake(&mut self, has_timed_out: bool) {
        (**self).wake(has_timed_out);
    }

    #[inline]
    fn has_effects(&self) -> bool {
        (**self).has_effects()
    }

    #[inline]
    fn complete(&mut self, finish_ns: u64, ask: &mut dyn FnMut(Request)) -> Option<WaitLimit> {
        (**self).complete(finish_ns, ask)
    }

    fn alternate(&self) -> Option<Self::Alternate> {
        (**self).alternate()
    }

    fn replace(&mut self) {
        (**self).replace();
    }
}

/// The function to take over after a fault; it can be queried while the body runs.
pub trait Alternate {
    /// Reports whether there is such a function at present.
    fn is_there(&self) -> bool;

    /// Reports whether the function is the fallback, which degrades the DAG.
    fn is_fallback(&self) -> bool;
}

/// An alternate that is made anew each time.
impl Alternate for () {
    fn is_there(&self) -> bool {
        true
    }

    fn is_fallback(&self) -> bool {
        false
    }
}

/// The part of a platform called by the engine during a step.
///
/// A step returns everything else: the platform's code taking the step holds the lock around the
/// engine, and wakes and suspends cores by its own means, mostly after releasing the lock.
pub trait PlatformPort<B> {
    /// The kinds of events the platform itself acts on.
    const HEARS: &'static [EventKind] = &[];

    /// Whether a core gives up its instance only some time after the request.
    const SUSPENDS_LATER: bool = true;

    /// Whether a wait may be answered at the instant at which it begins: then the wait does not end
    /// the instant.
    const ANSWERS_AT_ONCE: bool = false;

    /// Returns the time, in nanoseconds since the run's epoch.
    fn now_ns(&self) -> u64;

    /// Converts a time of the run to a time on the clock read by functions.
    fn on_clock(&self, time_ns: u64) -> u64 {
        time_ns
    }

    /// Called for a core that begins with a body as soon as the engine's lock is free. Returns the
    /// start on the run's time: the step's instant, or a later reading of the clock.
    fn start(&mut self, core: CoreId, body: &mut B, instant_ns: u64) -> u64;

    /// Called when the instance of a body gives its core up and begins a wait: its turn has ended.
    fn wait(&mut self, _core: CoreId, _body: &mut B, _ended_ns: u64) {}

    /// Called for a core that goes on with a body after a wait, like [`start`](Self::start).
    /// Returns the time.
    fn proceed(&mut self, core: CoreId, body: &mut B, instant_ns: u64) -> u64 {
        self.start(core, body, instant_ns)
    }

    /// Forwards a request to the other clusters concerned, and reports whether it does not concern
    /// this cluster.
    fn forward(&mut self, _request: Request) -> bool {
        false
    }

    /// Reports whether there may be letters of other clusters, or from outside.
    fn has_letters(&self) -> bool {
        false
    }

    /// Returns the letters, if there may be any, and takes note that they are read.
    fn take_letters(&mut self) -> Option<&Mailboxes> {
        None
    }

    /// Called when the target of a core may have changed.
    fn retarget(&mut self, _core: CoreId) {}

    /// Called for each event of a [heard](Self::HEARS) kind, and each
    /// [`Cancelled`](EventKind::Cancelled), even if the journal has no room.
    fn hear(&mut self, _notice: &DriverNotice) {}
}

/// The next action of a core after a completion.
#[derive(Debug, PartialEq, Eq)]
#[must_use]
pub enum NextAction<B> {
    /// Runs this body at once; nothing else changes.
    Run(B),
    /// Looks for a target; nothing changes for other cores.
    Look {
        /// Whether the time of the next event may have changed.
        is_rescheduled: bool,
    },
    /// Takes a step first: a step in which this turn ends, or else a step that goes on with the
    /// open instant.
    Step(Option<TurnEnd>),
}

/// The cost of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultCost {
    /// The DAG is ended.
    Dag,
    /// The job is lost, and the subtask goes on with a newly made function.
    Job,
    /// The job is lost, and the subtask goes on with the fallback function.
    Degraded,
}

impl FaultCost {
    /// Returns the cost's word in machine lines.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Dag => "dag",
            Self::Job => "job",
            Self::Degraded => "degraded",
        }
    }

    /// Returns the consequence, for people.
    pub const fn consequence(self) -> &'static str {
        match self {
            Self::Dag => "the DAG is ended",
            Self::Job => "the job is lost, and the subtask is made anew",
            Self::Degraded => "the job is lost, and the subtask falls back",
        }
    }
}
