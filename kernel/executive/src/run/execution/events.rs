//! What happens on a core, reported by that core: it finds work, starts it,
//! completes it, is interrupted, or ends it because of a fault.
//!
//! Each of these takes the cluster's lock once, makes a step of the scheduler where
//! there is something to decide, and wakes the other cores after the lock is
//! free again.

use sched_dag::journal::{Subject, What};

use super::core_set::CoreSet;
use super::loans::Loan;
use super::status::note_running;
use super::step::Ended;
use super::time::{instance_time_ns, seat, since_epoch};
use super::{Occasion, Work, cluster};
use crate::machine::abandoned::Abandoned;
use crate::machine::interrupt::Interrupted;
use crate::machine::this_core::Core;
use crate::machine::{clock, section, this_core, turns};
use crate::run::edge;

/// Finds what this core, which runs nothing, is to do. Interrupts are disabled.
pub fn find_work() -> Work {
    let core = this_core::get();
    let mut place = cluster::of(core).execution.lock_uninterrupted();
    let Some(execution) = place.as_mut() else {
        return Work::Rest;
    };
    let work = execution.find_work(core);
    drop(place);
    take_turns(core, work)
}

/// Leaves the turns to others if this core does not compute.
fn take_turns(core: &Core, work: Work) -> Work {
    match &work {
        Work::Run(_) => {}
        Work::Continue(context) if !context.is_background() => {}
        Work::Continue(_) | Work::Rest => turns::rest(core),
    }
    work
}

/// Reports that this core has run its instance, and finds what it is to do
/// next. Interrupts are disabled.
pub fn complete(mut finished: Loan, finish_ns: u64) -> Work {
    let core = this_core::get();
    let here = seat(core);
    let mut place = finished.cluster().execution.lock_uninterrupted();
    let Some(execution) = place.as_mut() else {
        return Work::Rest;
    };
    let vertex = finished.vertex;
    if finished.body.has_effects() {
        execution.signals.take(&mut finished.body, finish_ns);
    }
    execution
        .watcher
        .note_finish(finished, instance_time_ns(finish_ns));
    let mut woken = None;
    if execution.may_hand_off && execution.signals.are_none() {
        match execution.hand_off(core, vertex) {
            Ended::HandedOff(successor) => return Work::Run(successor),
            Ended::Open => {
                let woken = woken.insert(CoreSet::default());
                execution.step(finish_ns, Occasion::Time, woken);
            }
            Ended::WithNews => execution.announce(woken.insert(CoreSet::default())),
            Ended::Quiet => {}
        }
    } else {
        execution.watcher.settle(here);
        let instance = execution.scheduler.instance_of(vertex);
        let woken = woken.insert(CoreSet::default());
        execution.step(finish_ns, Occasion::Completed(instance), woken);
    }
    let work = execution.find_work(core);
    drop(place);
    if let Some(woken) = woken {
        woken.wake();
    }
    take_turns(core, work)
}

/// Ends this core's instance because of a fault, and with it its DAG or its job. Its context was
/// `left` here. Interrupts are disabled.
pub fn fail(left: &Abandoned) {
    let core = this_core::get();
    let mut place = cluster::of(core).execution.lock_uninterrupted();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let here = seat(core);
    let Some(vertex) = execution.watcher.recover(here, left) else {
        return;
    };
    let instance = execution.scheduler.instance_of(vertex);
    // Not when the interrupt came: a step may have left events since then. Nor may what follows
    // stand before this event.
    let clock_ns = clock::now_ns();
    let ended_ns = since_epoch(clock_ns);
    execution
        .watcher
        .journal
        .write(here, What::Ended, ended_ns, Subject::of(instance));
    note_running(core, None);
    edge::failed(instance, ended_ns, clock_ns);
    let mut woken = CoreSet::default();
    execution.step(clock_ns, Occasion::Failed(instance), &mut woken);
    drop(place);
    woken.wake();
}

/// Makes a step of the scheduler if `is_event`, and follows its decisions on this
/// core. In an interrupt handler.
pub fn interrupt(interrupted: &mut Interrupted, now_ns: u64, is_event: bool) {
    let core = this_core::get();
    let cluster = cluster::of(core);
    let mut place = cluster.execution.lock_uninterrupted();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let mut woken = CoreSet::default();
    if is_event || cluster.may_have_letters() {
        execution.step(now_ns, Occasion::Time, &mut woken);
    }
    if !section::puts_off(core, now_ns)
        && let Some(waiting) = execution.follow(interrupted, now_ns)
    {
        woken.insert(cluster.core(waiting));
    }
    drop(place);
    woken.wake();
}
