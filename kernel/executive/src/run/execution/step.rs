//! One step of the scheduler, and how cores follow its decisions.
//!
//! # Events of a core
//!
//! A core finds an instance to start or to continue, completes an instance, takes an interrupt, or
//! ends a faulty instance. Each event takes the cluster's lock once, makes a step of the scheduler
//! if there is anything to decide, and wakes the other cores after releasing the lock.
//!
//! # Effects of a completion beyond its DAG
//!
//! Under the lock and before the scheduler's step, a completing instance publishes its latest
//! values and hands over its requests, signals included; the step passes the requests on right
//! after the completion. A signal from outside makes a step of its own. A request to another
//! cluster becomes a letter ([`cluster`]), effective once the other cluster takes the letter.

use core::sync::atomic::Ordering;

use fass::platform::{Plan, Request};
use sched_dag::engine::{Engine, FaultCost, NextAction};
use sched_dag::journal::{EventKind, EventSubject};
use sched_dag::lifecycle::WaitId;
use sched_dag::placement::NextWork;
use sched_dag::{CoreId, DagId, Instance, Moment};

use super::cluster::{self, ClusterState, CoreSet, FIRST_SEAT, Letters};
use super::loans::RunnerLoan;
use super::port::{SmpPort, here, instance_time_ns, seat, since_epoch};
use super::status::{self, note_running};
use super::{ClusterRun, CoreWork, EPOCH_NS};
use crate::machine::abandoned::AbandonedContext;
use crate::machine::context::Parked;
use crate::machine::interrupt::Interrupted;
use crate::machine::this_core::{self, Core};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, interrupt_flag, section, time_slice};
use crate::run::contexts;

impl ClusterRun {
    /// Returns the engine, and the port for one step of the engine.
    #[inline(always)]
    pub(super) fn parts<'s>(
        &'s mut self,
        woken: &'s mut CoreSet,
    ) -> (&'s mut Engine<RunnerLoan, Parked>, SmpPort<'s>) {
        let port = SmpPort {
            cluster: self.cluster,
            id: self.engine.cluster,
            letters: &self.signals.letters,
            woken,
        };
        (&mut self.engine, port)
    }

    /// Makes one step of the scheduler, and adds to `woken` the other cores due to look at their
    /// assigned work.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        now_ns: u64,
        woken: &mut CoreSet,
        event: impl FnOnce(&mut Moment<'_>),
    ) {
        let core = here();
        let has_letters = self.cluster().may_have_letters();
        // Effects of messages are not dated before their arrival.
        let now_ns = if has_letters { clock::now_ns() } else { now_ns };
        let instant_ns = since_epoch(now_ns);
        let (engine, mut port) = self.parts(woken);
        engine.tell((instant_ns, core), &mut port, event);
        self.end_step(now_ns, woken);
    }

    /// Ends a wait whose limit has come, if the step consists of nothing else, and reports whether
    /// that was so.
    #[inline]
    fn wake(&mut self, now_ns: u64, woken: &mut CoreSet) -> bool {
        // While a dispatch is owed, the whole step has to be taken.
        if !self.engine.scheduler.has_waits() || !self.may_hand_off {
            return false;
        }
        let (engine, mut port) = self.parts(woken);
        let is_all = engine.wake((since_epoch(now_ns), here()), &mut port);
        if is_all {
            self.announce(woken);
        }
        is_all
    }

    #[inline]
    fn end_step(&mut self, now_ns: u64, woken: &mut CoreSet) {
        // Events before time 0 release nothing yet.
        let waits_until_ns = now_ns.saturating_add(self.coincidence_ns);
        let epoch_ns = EPOCH_NS.load(Ordering::Relaxed);
        let due_ns = *(self.dispatch_due_ns).get_or_insert(waits_until_ns.max(epoch_ns));
        if now_ns < due_ns {
            self.may_hand_off = false;
        } else {
            self.dispatch_due_ns = None;
            // With a coincidence time, every later completion may have to wait as well: no
            // hand-offs.
            self.may_hand_off = self.coincidence_ns == 0;
            let (engine, mut port) = self.parts(woken);
            engine.decide(since_epoch(now_ns), &mut port);
        }
        self.announce(woken);
    }

    /// Returns the cluster of this part of the run.
    #[inline]
    pub(super) const fn cluster(&self) -> &'static ClusterState {
        self.cluster
    }

    /// Publishes the next event and ensures that the cluster's first core waits for the event:
    /// wakes the first core if necessary, and core 0 if nothing is left to do here.
    #[inline(always)]
    fn announce(&self, woken: &mut CoreSet) {
        let cluster = self.cluster();
        let earlier_ns = cluster.next_event_ns();
        self.publish();
        let is_over = || cluster.is_finished.load(Ordering::Relaxed);
        if here() == FIRST_SEAT {
            timer::set(Alarm::Schedule, cluster.next_event_ns());
        } else if cluster.next_event_ns() < earlier_ns || is_over() {
            // Another core's timer cannot be written from here: the first core arms its own when
            // woken.
            woken.insert(cluster.core(FIRST_SEAT));
        }
        if is_over() {
            woken.insert(0);
        }
    }

    /// Publishes to all cores the time of the next event, and whether nothing is left to do.
    ///
    /// Inlined into each step: as a call, the way to a preemption takes six instructions more.
    #[inline(always)]
    pub(super) fn publish(&self) {
        let next = self.engine.scheduler.next_event_ns();
        let next = next.map_or(u64::MAX, |next| {
            next.saturating_add(EPOCH_NS.load(Ordering::Relaxed))
        });
        let next_ns = self.dispatch_due_ns.unwrap_or(next);
        let is_finished = self.engine.scheduler.is_finished();
        let jobs_ended = self.engine.scheduler.log.jobs_ended;
        (self.cluster().jobs_ended).store(jobs_ended, Ordering::Relaxed);
        self.cluster().publish(next_ns, is_finished);
    }

    /// Finds the next work for this core, which runs nothing.
    pub(super) fn find_work(&mut self, core: &Core) -> CoreWork {
        let here = seat(core);
        let mut none = CoreSet::default();
        let (engine, mut port) = self.parts(&mut none);
        // The step's instant, not the clock: taking work decides nothing new, and a start stamps
        // itself.
        let instant_ns = engine.scheduler.now_ns();
        match engine.next((instant_ns, here), &mut port) {
            NextWork::Start(_, runner) | NextWork::Proceed(_, runner) => CoreWork::Run(runner),
            NextWork::Continue(context) => {
                self.note_resumed(core, &context, clock::now_ns());
                note_running(core, self.current(here.index()).map(EventSubject::of));
                CoreWork::Continue(context)
            }
            // Only core 0 has a background, parked only while core 0 does other work.
            NextWork::Nothing => {
                note_running(core, None);
                let background = self.background.take_if(|_| core.index == 0);
                background.map_or(CoreWork::Rest, CoreWork::Continue)
            }
        }
    }

    /// Returns a core's current instance, by seat.
    fn current(&self, seat: usize) -> Option<Instance> {
        let vertex = self.engine.placement.current(seat)?;
        Some(self.engine.scheduler.instance_of(vertex))
    }

    /// Makes the interrupted core leave its instance, or its background, if the core is no longer
    /// to run it. Returns the seat of the core waiting for the suspended instance, if any.
    pub(super) fn follow(&mut self, interrupted: &mut Interrupted, now_ns: u64) -> Option<CoreId> {
        let core = this_core::get();
        let here = seat(core).index();
        // The background is no instance, so the placement never suspends it: an assigned instance
        // does.
        let is_background = core.context().is_background();
        let leaves_background = is_background && self.engine.placement.is_wanted(here);
        if !self.engine.placement.must_suspend(here) && !leaves_background {
            // Idle cores other than core 0 have no background context to leave: wake them.
            if self.engine.placement.is_wanted(here) {
                // No `wake_up`: this core reads its own flag as soon as the handler returns and
                // ends its halt.
                core.wake.store(true, Ordering::Relaxed);
            }
            return None;
        }
        let suspended = self.engine.placement.detach(here);
        if let Some(vertex) = suspended {
            // Not the interrupt's time: a step may have written later events since then, and the
            // journal keeps order.
            let time_ns = since_epoch(clock::now_ns());
            let instance = self.engine.scheduler.instance_of(vertex);
            self.engine.scheduler.log.journal.write(
                seat(core),
                EventKind::Suspend,
                time_ns,
                EventSubject::of(instance),
            );
            // The hold, or the time slice, was the instance's.
            time_slice::leave(core);
            section::stop_waiting(core.context());
            // The budget's alarm may stay: `end_overrun` looks at the budget of the context then
            // running.
            timer::set(Alarm::Hold, u64::MAX);
        }
        let next = match self.engine.placement.take_suspended(here) {
            Some(context) => {
                self.note_resumed(core, &context, now_ns);
                context
            }
            None => {
                time_slice::come(core);
                contexts::new_worker()
            }
        };
        note_running(core, self.current(here).map(EventSubject::of));
        let last = interrupted.exchange(next);
        // Another core may resume `last` once the lock is free: this core is on its handler stack
        // and touches that context no more.
        match suspended {
            Some(vertex) => {
                last.note_suspended(now_ns);
                self.engine.placement.suspend(vertex, last)
            }
            None => {
                self.background = Some(last);
                None
            }
        }
    }

    /// Notes that this core's current instance continues in `context`.
    fn note_resumed(&mut self, core: &Core, context: &Parked, now_ns: u64) {
        context.note_resumed(now_ns);
        timer::set_no_later(core, Alarm::Budget, context.budget_end_ns());
        time_slice::join(core);
        let here = seat(core);
        if let Some(instance) = self.current(here.index()) {
            let time_ns = since_epoch(clock::now_ns());
            self.engine.scheduler.log.journal.write(
                here,
                EventKind::Resume,
                time_ns,
                EventSubject::of(instance),
            );
        }
    }
}

/// Finds the next work for this core, which runs nothing. Interrupts are disabled.
pub fn find_work() -> CoreWork {
    let core = this_core::get();
    let mut place = cluster::cluster_of(core).execution.lock_uninterrupted();
    // Behind a fault that was the run's last event, the run may have been taken out.
    let work = match place.as_mut() {
        Some(execution) => execution.find_work(core),
        None => CoreWork::Rest,
    };
    drop(place);
    keep_slice(core, work)
}

/// Gives up this core's time slice if the core does not compute.
fn keep_slice(core: &Core, work: CoreWork) -> CoreWork {
    match &work {
        CoreWork::Run(_) => {}
        CoreWork::Continue(context) if !context.is_background() => {}
        CoreWork::Continue(_) | CoreWork::Rest => time_slice::rest(core),
    }
    work
}

/// Ends a turn of this core's instance, by its completion or by a wait, and finds the core's next
/// work. Interrupts are disabled.
pub fn complete(finished: RunnerLoan, finish_ns: u64) -> CoreWork {
    let here = here();
    let mut place = finished.cluster().execution.lock_uninterrupted();
    let Some(execution) = place.as_mut() else {
        return CoreWork::Rest;
    };
    let vertex = finished.vertex;
    let run_ns = instance_time_ns(finish_ns);
    let is_alone = execution.may_hand_off;
    let mut woken = CoreSet::default();
    let (engine, mut port) = execution.parts(&mut woken);
    match engine.complete((here, vertex), finished, run_ns, is_alone, &mut port) {
        // The short way concerns no other core, so nobody is to be woken, and the time slice goes
        // on.
        NextAction::Run(successor) => return CoreWork::Run(successor),
        NextAction::Look {
            is_rescheduled: false,
        } => {}
        NextAction::Look {
            is_rescheduled: true,
        } => execution.announce(&mut woken),
        NextAction::Step(ended) => execution.step(finish_ns, &mut woken, |moment| {
            // None if the scheduler has taken the completion already, and only the rest is to be
            // decided.
            ended.into_iter().for_each(|turn| moment.end_turn(turn));
        }),
    }
    let core = this_core::get();
    // In the same critical section, so each completion takes the lock once.
    let work = execution.find_work(core);
    drop(place);
    woken.wake();
    keep_slice(core, work)
}

/// Ends this core's instance because of a fault, and with the instance its DAG or its job. Returns
/// the cost, and the instance's budget in nanoseconds. The core has left the instance's context,
/// `left`. Interrupts are disabled.
pub fn fail(left: &AbandonedContext) -> Option<(FaultCost, u64)> {
    let core = this_core::get();
    let mut place = cluster::cluster_of(core).execution.lock_uninterrupted();
    let execution = place.as_mut()?;
    let here = seat(core);
    let placement = &mut execution.engine.placement;
    let lost = (execution.loans).recover(placement, here.index(), left)?;
    // Not the interrupt's time: a step may have written events since then, and a later event must
    // not come before this one.
    let clock_ns = clock::now_ns();
    let ended_ns = since_epoch(clock_ns);
    note_running(core, None);
    fass::platform::at_edge::failed(lost.instance, clock_ns);
    let mut woken = CoreSet::default();
    let (engine, mut port) = execution.parts(&mut woken);
    let budget_ns = lost.budget_ns;
    let cost = engine.tell_fault((ended_ns, here), lost.vertex, Some(lost), &mut port);
    execution.end_step(clock_ns, &mut woken);
    drop(place);
    woken.wake();
    Some((cost, budget_ns))
}

/// Makes a step of the scheduler, or just ends waits at their limit, if `is_event` or if letters
/// may be waiting. Then follows the scheduler's decisions on this core, unless a section of an
/// app's lock postpones the preemption. Called in an interrupt handler.
pub fn interrupt(interrupted: &mut Interrupted, now_ns: u64, is_event: bool) {
    let core = this_core::get();
    let cluster = cluster::cluster_of(core);
    let mut place = cluster.execution.lock_uninterrupted();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let mut woken = CoreSet::default();
    // Without an event this core only follows: another core's step has changed its target.
    if (is_event || cluster.may_have_letters()) && !execution.wake(now_ns, &mut woken) {
        execution.step(now_ns, &mut woken, |_| ());
    }
    // A section of an app's lock postpones the preemption; the alarm or the section's end retries.
    if !section::puts_off(core, now_ns)
        && let Some(waiting) = execution.follow(interrupted, now_ns)
    {
        woken.insert(cluster.core(waiting));
    }
    drop(place);
    woken.wake();
}

/// Lets a driver serve its device, and follows the resulting decisions on this core, so no further
/// interrupt is needed. Called in an interrupt handler.
pub fn device_interrupt(interrupted: &mut Interrupted, now_ns: u64, driver: impl FnOnce()) {
    let core = this_core::get();
    core.follows.store(true, Ordering::Relaxed);
    driver();
    core.follows.store(false, Ordering::Relaxed);
    interrupt(interrupted, now_ns, false);
}

/// A run's requests on their way to its scheduler.
pub(super) struct RequestQueue {
    /// The number of the running plan.
    pub(super) plan: u64,
    /// Whether the run has begun: before, there is no time.
    pub(super) has_begun: bool,
    pub(super) letters: Letters,
}

impl RequestQueue {
    pub(super) fn new(plan: &Plan, letters: &Letters) -> Self {
        Self {
            plan: plan.number,
            letters: letters.clone(),
            has_begun: false,
        }
    }
}

impl ClusterRun {
    /// Begins to pass signals on; signals from before the run count at time 0.
    pub(super) fn begin_signals(&mut self) {
        self.signals.has_begun = true;
        // All signals raised before are to DAGs of this cluster.
        let mut none = CoreSet::default();
        let (engine, mut port) = self.parts(&mut none);
        engine.tell((0, here()), &mut port, |_| ());
    }
}

/// Takes a signal from outside all instances, to a DAG of the plan with a number. A signal between
/// the commit and the run counts as of time 0.
///
/// # Panics
///
/// If an instance calls this function.
#[track_caller]
pub fn raise(plan: u64, dag: DagId) {
    let were_enabled = interrupt_flag::disable();
    let core = this_core::get();
    // A driver may raise signals, whichever instance its device's message has interrupted.
    let is_driver = core.follows.load(Ordering::Relaxed);
    let is_instance = !is_driver && status::running(core).is_some();
    if !is_instance {
        raise_in_interrupt(plan, dag);
    }
    interrupt_flag::restore(were_enabled);
    // Only now: with interrupts enabled again, the panic is contained as the app's own.
    assert!(
        !is_instance,
        "a subtask raises a signal that it was not registered with; register it by \
         `dag.using(signal.raising())`"
    );
}

/// Takes a signal from outside, like [`raise`], in an interrupt or where an interrupt could be:
/// interrupts are disabled. A signal for another cluster becomes a letter.
pub fn raise_in_interrupt(plan: u64, dag: DagId) {
    let cluster = cluster::cluster_of(this_core::get());
    status::serve(Some(plan), cluster, Request::Signal(dag));
}

/// Takes the answer to a wait of the plan with a number, from anywhere: an instance, an interrupt
/// handler, or the background. An answer for another cluster becomes a letter.
pub fn answer(plan: u64, wait: WaitId) {
    let were_enabled = interrupt_flag::disable();
    let cluster = cluster::cluster_of(this_core::get());
    status::serve(Some(plan), cluster, Request::Answer(wait));
    interrupt_flag::restore(were_enabled);
}
