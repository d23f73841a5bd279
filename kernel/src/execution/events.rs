//! What happens on a core, reported by that core: it finds work, starts it,
//! completes it, is interrupted, or ends it because of a fault.
//!
//! Each of these takes the one lock once, lets the scheduler take a step where
//! there is something to decide, and wakes the other cores after the lock is
//! free again.

use core::sync::atomic::Ordering;

use sched_dag::CoreId;

use super::core_set::CoreSet;
use super::status::note_running;
use super::{Assignment, EPOCH_NS, EXECUTION, Event, Execution, NEXT_EVENT_NS, Work};
use crate::machine::interrupt::Interrupted;
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, this_core};
use crate::trace::{self, What};

/// Finds what this core, which runs nothing, is to do. Interrupts are disabled.
pub(crate) fn find_work() -> Work {
    let mut place = EXECUTION.lock();
    place.as_mut().map_or(Work::Rest, Execution::find_work)
}

/// Notes that this core starts its instance. Interrupts are disabled.
pub(crate) fn note_start(assignment: &Assignment, start_ns: u64) {
    let budget_end_ns = start_ns.saturating_add(assignment.budget_ns);
    this_core::get().context().set_budget_end(budget_end_ns);
    timer::set_no_later(Alarm::Budget, budget_end_ns);
    trace::instance(
        What::Start,
        since_epoch(start_ns),
        here(),
        assignment.instance,
    );
}

/// Converts a time on the clock to the run's time.
pub(crate) fn since_epoch(time_ns: u64) -> u64 {
    time_ns.saturating_sub(EPOCH_NS.load(Ordering::Relaxed))
}

/// Returns the core that executes this. Interrupts are disabled.
pub(super) fn here() -> CoreId {
    CoreId(this_core::get().index)
}

/// Reports that this core has run its instance, and finds what it is to do
/// next. Interrupts are disabled.
pub(crate) fn complete(finished: Assignment, start_ns: u64, finish_ns: u64) -> Work {
    let mut place = EXECUTION.lock();
    let Some(execution) = place.as_mut() else {
        return Work::Rest;
    };
    let here = here();
    let Assignment {
        instance, mut body, ..
    } = finished;
    execution.signals.take(&mut body, finish_ns);
    trace::instance(What::Finish, since_epoch(finish_ns), here, instance);
    execution.placement.finish(here.index(), instance, body);
    if let Some(record) = execution.record.instance_mut(instance) {
        record.start_ns = Some(since_epoch(start_ns));
        record.finish_ns = Some(since_epoch(finish_ns));
        record.core = Some(here);
        record.runs += 1;
    }
    let woken = execution.step(finish_ns, Event::Completed(instance));
    let work = execution.find_work();
    drop(place);
    woken.wake();
    work
}
/// Ends this core's instance, and with it its DAG, because of a fault. The
/// context that ran it must not be resumed. Interrupts are disabled.
pub(crate) fn fail(now_ns: u64) {
    let mut place = EXECUTION.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let core = this_core::get();
    let Some(instance) = execution.placement.lose(core.index as usize) else {
        return;
    };
    // Not when the interrupt came: a step may have left events since then.
    let ended_ns = since_epoch(clock::now_ns());
    trace::instance(What::Ended, ended_ns, CoreId(core.index), instance);
    note_running(core, None);
    if let Some(record) = execution.record.instance_mut(instance) {
        record.failed_ns = Some(since_epoch(now_ns));
        record.core = Some(CoreId(core.index));
    }
    let woken = execution.step(now_ns, Event::Failed(instance));
    drop(place);
    woken.wake();
}

/// Lets the scheduler take a step if `is_event`, and lets this core follow its
/// decisions. In an interrupt handler.
pub(crate) fn interrupt(interrupted: &mut Interrupted, now_ns: u64, is_event: bool) {
    let mut place = EXECUTION.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let mut woken = CoreSet::default();
    if is_event {
        woken = execution.step(now_ns, Event::Time);
    }
    if let Some(waiting) = execution.follow(interrupted, now_ns) {
        woken.insert(waiting.0);
    }
    drop(place);
    woken.wake();
}

/// Sets core 0's alarm for the next event.
pub(crate) fn arm_next_event() {
    timer::set(Alarm::Schedule, NEXT_EVENT_NS.load(Ordering::Acquire));
}
