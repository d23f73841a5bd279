//! One step of the scheduler, and following what it decides.

use core::sync::atomic::Ordering;

use sched_dag::engine::Engine;
use sched_dag::journal::{Subject, What};
use sched_dag::placement::Next;
use sched_dag::{CoreId, Instance, Moment};

use super::cluster::{self, Cluster, FIRST_SEAT, MAY_DIVIDE};
use super::core_set::CoreSet;
use super::loans::Loan;
use super::port::SmpPort;
use super::status::note_running;
use super::time::{here, seat, since_epoch};

use super::{EPOCH_NS, Execution, Work};
use crate::machine::context::Parked;
use crate::machine::interrupt::Interrupted;
use crate::machine::this_core::Core;
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, this_core, turns};
use crate::run::contexts;

impl Execution {
    /// Returns the engine, and the port for a step of it.
    #[inline(always)]
    pub(super) fn parts<'s>(
        &'s mut self,
        woken: &'s mut CoreSet,
    ) -> (&'s mut Engine<Loan, Parked>, SmpPort<'s>) {
        let port = SmpPort {
            cluster: match MAY_DIVIDE {
                true => self.cluster,
                false => &cluster::FIRST,
            },
            id: self.engine.cluster,
            letters: &self.signals.letters,
            woken,
        };
        (&mut self.engine, port)
    }

    /// Makes one step of the scheduler, and says which other cores have to
    /// look at what they should run.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        now_ns: u64,
        woken: &mut CoreSet,
        event: impl FnOnce(&mut Moment<'_>),
    ) {
        let core = here();
        let has_letters = self.cluster().may_have_letters();
        // Nothing that they bring about was before they came.
        let now_ns = if has_letters { clock::now_ns() } else { now_ns };
        let instant_ns = since_epoch(now_ns);
        let (engine, mut port) = self.parts(woken);
        engine.tell((instant_ns, core), &mut port, event);
        self.end_step(now_ns, woken);
    }

    #[inline]
    pub(super) fn end_step(&mut self, now_ns: u64, woken: &mut CoreSet) {
        // What happens before time 0 releases nothing yet.
        let waits_until_ns = now_ns.saturating_add(self.coincidence_ns);
        let epoch_ns = EPOCH_NS.load(Ordering::Relaxed);
        let due_ns = *(self.dispatch_due_ns).get_or_insert(waits_until_ns.max(epoch_ns));
        if now_ns < due_ns {
            self.may_hand_off = false;
            self.announce(woken);
            return;
        }
        self.dispatch_due_ns = None;
        self.may_hand_off = self.coincidence_ns == 0;
        let (engine, mut port) = self.parts(woken);
        engine.decide(since_epoch(now_ns), &mut port);
        self.announce(woken);
    }

    /// Returns the cluster that it is the run of.
    #[inline]
    pub(super) const fn cluster(&self) -> &'static Cluster {
        match MAY_DIVIDE {
            true => self.cluster,
            false => &cluster::FIRST,
        }
    }

    /// Publishes the next event, and sees to it that the first core waits for it: that is to
    /// be woken if it has to be for that, and core 0 if nothing is left to be done here.
    pub(super) fn announce(&self, woken: &mut CoreSet) {
        let cluster = self.cluster();
        let earlier_ns = cluster.next_event_ns();
        self.publish();
        let is_over = || cluster.is_finished.load(Ordering::Relaxed);
        if here() == FIRST_SEAT {
            timer::set(Alarm::Schedule, cluster.next_event_ns());
        } else if cluster.next_event_ns() < earlier_ns || is_over() {
            woken.insert(cluster.core(FIRST_SEAT));
        }
        if MAY_DIVIDE && is_over() {
            woken.insert(0);
        }
    }

    /// Shows all cores when the next event is, and whether nothing is left to be done.
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

    /// Finds what this core, which runs nothing, is to do.
    pub(super) fn find_work(&mut self, core: &Core) -> Work {
        let here = seat(core);
        let mut none = CoreSet::default();
        let (engine, mut port) = self.parts(&mut none);
        match engine.next(here, &mut port) {
            Next::Start(_, runner) => Work::Run(runner),
            Next::Continue(context) => {
                self.note_resumed(core, &context, clock::now_ns());
                note_running(core, self.current(here.index()).map(Subject::of));
                Work::Continue(context)
            }
            // Only core 0 has a background, and only while it does other work.
            Next::Nothing => {
                note_running(core, None);
                let background = self.background.take_if(|_| core.index == 0);
                background.map_or(Work::Rest, Work::Continue)
            }
        }
    }

    /// Returns the instance that a core has, by its seat.
    fn current(&self, seat: usize) -> Option<Instance> {
        let vertex = self.engine.placement.current(seat)?;
        Some(self.engine.scheduler.instance_of(vertex))
    }

    /// Makes the core whose interrupt is being handled leave what it should no
    /// longer run. Returns the seat of the core that waits for that, if there is one.
    pub(super) fn follow(&mut self, interrupted: &mut Interrupted, now_ns: u64) -> Option<CoreId> {
        let core = this_core::get();
        let here = seat(core).index();
        let is_background = core.context().is_background();
        let leaves_background = is_background && self.engine.placement.is_wanted(here);
        if !self.engine.placement.must_suspend(here) && !leaves_background {
            // One that rests has no background, unless it is core 0: it is to look for work.
            if MAY_DIVIDE && self.engine.placement.is_wanted(here) {
                core.wake.store(true, Ordering::Relaxed);
            }
            return None;
        }
        let suspended = self.engine.placement.detach(here);
        if let Some(vertex) = suspended {
            // Not when the interrupt came: its step has left events since then.
            let time_ns = since_epoch(clock::now_ns());
            let instance = self.engine.scheduler.instance_of(vertex);
            self.engine.scheduler.log.journal.write(
                seat(core),
                What::Suspend,
                time_ns,
                Subject::of(instance),
            );
            // The hold, or the turn, was the instance's.
            turns::leave(core);
            timer::set(Alarm::Hold, u64::MAX);
        }
        let next = match self.engine.placement.take_suspended(here) {
            Some(context) => {
                self.note_resumed(core, &context, now_ns);
                context
            }
            None => {
                turns::come(core);
                contexts::begin()
            }
        };
        note_running(core, self.current(here).map(Subject::of));
        let last = interrupted.exchange(next);
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
        turns::join(core);
        let here = seat(core);
        if let Some(instance) = self.current(here.index()) {
            let time_ns = since_epoch(clock::now_ns());
            self.engine.scheduler.log.journal.write(
                here,
                What::Resume,
                time_ns,
                Subject::of(instance),
            );
        }
    }
}
