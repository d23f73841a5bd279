//! One step of the scheduler, and following what it decides.

use core::sync::atomic::Ordering;

use sched_dag::{CoreId, Decision, Instance};

use super::core_set::CoreSet;
use super::events::{arm_next_event, here, since_epoch};
use super::placement::Next;
use super::status::{is_finished, note_running};
use super::watcher::Watcher;
use super::{Assignment, EPOCH_NS, Event, Execution, FINISHED, NEXT_EVENT_NS, Work};
use crate::machine::context::Parked;
use crate::machine::interrupt::Interrupted;
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, this_core};
use crate::platform::KERNEL;
use crate::trace::{self, What};
use crate::worker;

impl Execution {
    /// Makes one step of the scheduler and returns which other cores have to
    /// look at what they should run.
    pub(super) fn step(&mut self, now_ns: u64, event: Event) -> CoreSet {
        let here = this_core::get().index;
        let Self {
            scheduler,
            placement,
            record,
            latest_ns,
            dispatch_due_ns,
            signals,
            ..
        } = self;
        *latest_ns = since_epoch(now_ns).max(*latest_ns);
        let mut watcher = Watcher { record, placement };
        let mut moment = scheduler.at(*latest_ns);
        match event {
            Event::Time => {}
            Event::Completed(instance) => {
                moment.complete(instance, &mut watcher);
                signals.send(&mut moment, &mut watcher);
            }
            Event::Failed(instance) => moment.fail(instance, &mut watcher),
            Event::Signalled(dag) => moment.signal(dag, &mut watcher),
            Event::Control(control) => control.apply(&mut moment, &mut watcher),
        }
        let mut woken = CoreSet::default();
        let due_ns = *dispatch_due_ns.get_or_insert(now_ns.saturating_add(KERNEL.coincidence_ns()));
        if now_ns < due_ns {
            self.announce(&mut woken);
            return woken;
        }
        *dispatch_due_ns = None;
        let mut preempted = None;
        for decision in moment.release_due(&mut watcher).dispatch() {
            placement.decide(*decision);
            let (core, instance) = (decision.core(), decision.instance());
            if let Decision::Preempt { .. } = decision {
                preempted = Some(core);
                if let Some(record) = record.instance_mut(instance) {
                    record.preemptions += 1;
                }
            } else if preempted == Some(core) {
                trace::instance(What::Request, since_epoch(clock::now_ns()), core, instance);
            }
            if core.0 != here {
                woken.insert(core.0);
            }
        }
        self.announce(&mut woken);
        woken
    }

    /// Publishes the next event, and sees to it that core 0 waits for it.
    fn announce(&self, woken: &mut CoreSet) {
        let earlier = NEXT_EVENT_NS.load(Ordering::Relaxed);
        self.publish();
        if this_core::get().index == 0 {
            arm_next_event();
        } else if NEXT_EVENT_NS.load(Ordering::Relaxed) < earlier || is_finished() {
            woken.insert(0);
        }
    }

    /// Lets everyone see when the next event is, and whether there is any.
    pub(super) fn publish(&self) {
        let next = self.scheduler.next_event_ns();
        let next = next.map_or(u64::MAX, |next| {
            next.saturating_add(EPOCH_NS.load(Ordering::Relaxed))
        });
        let next = self.dispatch_due_ns.unwrap_or(next);
        NEXT_EVENT_NS.store(next, Ordering::Release);
        FINISHED.store(self.scheduler.is_finished(), Ordering::Release);
    }

    /// Finds what this core, which runs nothing, is to do.
    pub(super) fn find_work(&mut self) -> Work {
        let core = this_core::get();
        let here = core.index as usize;
        let work = match self.placement.next(here) {
            Next::Start(instance, body) => Work::Run(Assignment {
                instance,
                budget_ns: self.budget_ns(instance),
                body,
            }),
            Next::Continue(context) => {
                self.note_resumed(&context, clock::now_ns());
                Work::Continue(context)
            }
            // Only core 0 has a background, and only while it does other work.
            Next::Nothing if here == 0 => self.background.take().map_or(Work::Rest, Work::Continue),
            Next::Nothing => Work::Rest,
        };
        note_running(core, self.placement.current(here));
        work
    }

    /// Makes the core whose interrupt is being handled leave what it should no
    /// longer run. Returns the core that waits for that, if there is one.
    pub(super) fn follow(&mut self, interrupted: &mut Interrupted, now_ns: u64) -> Option<CoreId> {
        let core = this_core::get();
        let here = core.index as usize;
        let is_background = core.context().is_background();
        let leaves_background = is_background && self.placement.is_wanted(here);
        if !self.placement.must_suspend(here) && !leaves_background {
            return None;
        }
        let suspended = self.placement.detach(here);
        if let Some(instance) = suspended {
            // Not when the interrupt came: its step has left events since then.
            let time_ns = since_epoch(clock::now_ns());
            trace::instance(What::Suspend, time_ns, CoreId(core.index), instance);
        }
        let next = match self.placement.take_suspended(here) {
            Some(context) => {
                self.note_resumed(&context, now_ns);
                context
            }
            None => worker::new_context(),
        };
        note_running(core, self.placement.current(here));
        let last = interrupted.exchange(next);
        match suspended {
            Some(instance) => {
                last.note_suspended(now_ns);
                timer::set(Alarm::Hold, u64::MAX);
                self.placement.suspend(instance, last)
            }
            None => {
                self.background = Some(last);
                None
            }
        }
    }

    /// Returns how long an instance may execute for, `u64::MAX` if for ever.
    pub(super) fn budget_ns(&self, instance: Instance) -> u64 {
        let subtask = self.task_set().dag(instance.dag).subtask(instance.subtask);
        subtask
            .budget_ns()
            .or_else(|| KERNEL.budget_of_wcet(subtask.wcet_ns()?))
            .unwrap_or(u64::MAX)
    }

    /// Notes that this core's current instance continues in `context`.
    fn note_resumed(&self, context: &Parked, now_ns: u64) {
        context.note_resumed(now_ns);
        timer::set_no_later(Alarm::Budget, context.budget_end_ns());
        let here = here();
        if let Some(instance) = self.placement.current(here.index()) {
            let time_ns = since_epoch(clock::now_ns());
            trace::instance(What::Resume, time_ns, here, instance);
        }
    }
}
