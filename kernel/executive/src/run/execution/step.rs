//! One step of the scheduler, and following what it decides.

use core::sync::atomic::Ordering;

use sched_dag::journal::{Subject, What};
use sched_dag::placement::Next;
use sched_dag::{CoreId, Decision, HandOff, Instance, Vertex};

use super::cluster::{FIRST_SEAT, MAY_DIVIDE};
use super::core_set::CoreSet;
use super::loans::Loan;
use super::runner::Runner;
use super::status::note_running;
use super::time::{here, instance_time_ns, seat, since_epoch};
use super::{EPOCH_NS, Execution, Occasion, Work};
use crate::machine::context::Parked;
use crate::machine::interrupt::Interrupted;
use crate::machine::this_core::Core;
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, this_core, turns};
use crate::run::contexts;

/// What comes of [`Execution::hand_off`].
pub(super) enum Ended {
    /// The core has its next instance, and nothing else is to do.
    HandedOff(Loan),
    /// The scheduler's step is not over.
    Open,
    /// When the next event is due may have changed; then the core may have a
    /// target.
    WithNews,
    /// The core may have a target.
    Quiet,
}

impl Execution {
    /// Tells the scheduler that this core has finished an instance, and gives
    /// the core the next one at once if nothing else is to be decided.
    #[inline]
    pub(super) fn hand_off(&mut self, core: &Core, vertex: Vertex) -> Ended {
        let watcher = &mut self.watcher;
        let here = seat(core);
        let finish_ns = watcher.finish_ns;
        // Another core's completion may have been later and come first.
        let instant_ns = finish_ns.max(self.scheduler.now_ns());
        watcher.instant_ns = instant_ns;
        let (done, is_fresh) = (self.scheduler).pass_on(finish_ns, here, vertex, watcher);
        if let HandOff::To(next, decision) = done
            && let Some(finished) = watcher.finished.take()
        {
            let from = finished.subject();
            let finish = (What::Finish, finish_ns, from);
            let Some(mut runner) = watcher.placement.exchange(here, vertex, finished, next) else {
                // It is suspended, so it has been ready before.
                watcher.journal.write_all(here, [finish]);
                return Ended::Quiet;
            };
            runner.instance.job = decision.instance().job;
            let to = runner.subject();
            note_running(core, Some(to));
            let start = (What::Start, begin(core, &runner), to);
            if is_fresh {
                let ready = (What::Ready, instant_ns, to);
                watcher.journal.write_all(here, [finish, ready, start]);
            } else {
                watcher.journal.write_all(here, [finish, start]);
            }
            return Ended::HandedOff(runner);
        }
        watcher.settle(here);
        match done {
            HandOff::Open => return Ended::Open,
            HandOff::To(next, _) => watcher.placement.set_target(here, Some(next)),
            HandOff::Idle => {}
        }
        if core::mem::take(&mut watcher.has_job_news) {
            Ended::WithNews
        } else {
            Ended::Quiet
        }
    }

    /// Makes one step of the scheduler, and says which other cores have to
    /// look at what they should run.
    pub(super) fn step(&mut self, now_ns: u64, occasion: Occasion, woken: &mut CoreSet) {
        let here = here();
        let Self {
            scheduler,
            watcher,
            dispatch_due_ns,
            coincidence_ns,
            may_hand_off,
            signals,
            ..
        } = self;
        let has_letters = watcher.cluster().may_have_letters();
        // Nothing that they bring about was before they came.
        let now_ns = if has_letters { clock::now_ns() } else { now_ns };
        let instant_ns = since_epoch(now_ns);
        watcher.instant_ns = instant_ns.max(scheduler.now_ns());
        let is_survived = match occasion {
            Occasion::Failed(failed) if scheduler.survives(failed.dag, failed.job) => {
                watcher.next(watcher.task_set.vertex(failed)).is_some()
            }
            _ => false,
        };
        let mut moment = scheduler.at(instant_ns);
        match occasion {
            Occasion::Time => {}
            Occasion::Completed(instance) => {
                moment.complete(instance, watcher);
                signals.send(&mut moment, watcher, woken);
            }
            Occasion::Failed(instance) if is_survived => {
                moment.fail_replaceable(instance, watcher);
            }
            Occasion::Failed(instance) => {
                moment.fail(instance, watcher);
                if let Some(dag) = signals.after_fault(instance.dag) {
                    signals.pass(dag, &mut moment, watcher, woken);
                }
            }
            Occasion::Signalled(dag) => moment.signal(dag, watcher),
            Occasion::Control(control) => control.apply(&mut moment, watcher),
        }
        if has_letters {
            signals.take_letters(&mut moment, watcher);
        }
        // What happens before time 0 releases nothing yet.
        let waits_until_ns = now_ns.saturating_add(*coincidence_ns);
        let epoch_ns = EPOCH_NS.load(Ordering::Relaxed);
        let due_ns = *dispatch_due_ns.get_or_insert(waits_until_ns.max(epoch_ns));
        if now_ns < due_ns {
            self.may_hand_off = false;
            self.announce(woken);
            return;
        }
        *dispatch_due_ns = None;
        *may_hand_off = *coincidence_ns == 0;
        let mut preempted = None;
        for decision in moment.release_due(watcher).dispatch() {
            let (core, instance) = (decision.core(), decision.instance());
            let vertex = watcher.task_set.vertex(instance);
            if let Decision::Preempt { .. } = decision {
                watcher.placement.set_target(core, None);
                preempted = Some(core);
            } else {
                watcher.placement.set_target(core, Some(vertex));
                if preempted == Some(core) {
                    let time_ns = since_epoch(clock::now_ns());
                    let subject = Subject::of(instance);
                    (watcher.journal).write(core, What::Request, time_ns, subject);
                }
            }
            if core != here {
                woken.insert(watcher.cluster().core(core));
            }
        }
        watcher.has_job_news = false;
        self.announce(woken);
    }

    /// Publishes the next event, and sees to it that the first core waits for it: that is to
    /// be woken if it has to be for that, and core 0 if nothing is left to be done here.
    pub(super) fn announce(&self, woken: &mut CoreSet) {
        let cluster = self.watcher.cluster();
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
        let next = self.scheduler.next_event_ns();
        let next = next.map_or(u64::MAX, |next| {
            next.saturating_add(EPOCH_NS.load(Ordering::Relaxed))
        });
        let next_ns = self.dispatch_due_ns.unwrap_or(next);
        let is_finished = self.scheduler.is_finished();
        self.watcher.cluster().publish(next_ns, is_finished);
    }

    /// Finds what this core, which runs nothing, is to do.
    pub(super) fn find_work(&mut self, core: &Core) -> Work {
        let here = seat(core);
        match self.watcher.placement.next(here.index()) {
            Next::Start(vertex, mut runner) => {
                runner.instance.job = self.scheduler.instance_of(vertex).job;
                note_running(core, Some(runner.subject()));
                let start_ns = begin(core, &runner);
                let subject = runner.subject();
                (self.watcher.journal).write(here, What::Start, start_ns, subject);
                Work::Run(runner)
            }
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
        let vertex = self.watcher.placement.current(seat)?;
        Some(self.scheduler.instance_of(vertex))
    }

    /// Makes the core whose interrupt is being handled leave what it should no
    /// longer run. Returns the seat of the core that waits for that, if there is one.
    pub(super) fn follow(&mut self, interrupted: &mut Interrupted, now_ns: u64) -> Option<CoreId> {
        let core = this_core::get();
        let here = seat(core).index();
        let is_background = core.context().is_background();
        let leaves_background = is_background && self.watcher.placement.is_wanted(here);
        if !self.watcher.placement.must_suspend(here) && !leaves_background {
            // One that rests has no background, unless it is core 0: it is to look for work.
            if MAY_DIVIDE && self.watcher.placement.is_wanted(here) {
                core.wake.store(true, Ordering::Relaxed);
            }
            return None;
        }
        let suspended = self.watcher.placement.detach(here);
        if let Some(vertex) = suspended {
            // Not when the interrupt came: its step has left events since then.
            let time_ns = since_epoch(clock::now_ns());
            let instance = self.scheduler.instance_of(vertex);
            self.watcher
                .journal
                .write(seat(core), What::Suspend, time_ns, Subject::of(instance));
            // The hold, or the turn, was the instance's.
            turns::leave(core);
            timer::set(Alarm::Hold, u64::MAX);
        }
        let next = match self.watcher.placement.take_suspended(here) {
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
                self.watcher.placement.suspend(vertex, last)
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
            self.watcher
                .journal
                .write(here, What::Resume, time_ns, Subject::of(instance));
        }
    }
}

/// Lets this core begin an instance as soon as the lock is free, and returns when, on the
/// run's time. Start and finish are stamped with interrupts disabled, so that no preemption
/// can stand between a stamp and what it says.
#[inline]
fn begin(core: &Core, runner: &Runner) -> u64 {
    let now_ns = clock::now_ns();
    let budget_end_ns = match runner.budget_ns {
        u64::MAX => u64::MAX,
        budget_ns => {
            let end_ns = now_ns.saturating_add(budget_ns);
            timer::set_no_later(core, Alarm::Budget, end_ns);
            end_ns
        }
    };
    core.context().set_budget_end(budget_end_ns);
    instance_time_ns(now_ns)
}
