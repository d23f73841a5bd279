//! What happens on a core, reported by that core: it finds work, starts it,
//! completes it, is interrupted, or ends it because of a fault.
//!
//! Each of these takes the cluster's lock once, makes a step of the scheduler where
//! there is something to decide, and wakes the other cores after the lock is
//! free again.

use sched_dag::engine::Continuation;

use super::core_set::CoreSet;
use super::loans::Loan;
use super::status::note_running;
use super::time::{instance_time_ns, seat, since_epoch};
use super::{Work, cluster};
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
pub fn complete(finished: Loan, finish_ns: u64) -> Work {
    let core = this_core::get();
    let here = seat(core);
    let mut place = finished.cluster().execution.lock_uninterrupted();
    let Some(execution) = place.as_mut() else {
        return Work::Rest;
    };
    let vertex = finished.vertex;
    let run_ns = instance_time_ns(finish_ns);
    let is_alone = execution.may_hand_off;
    let mut woken = CoreSet::default();
    let (engine, mut port) = execution.parts(&mut woken);
    match engine.complete((here, vertex), finished, run_ns, is_alone, &mut port) {
        Continuation::Run(successor) => return Work::Run(successor),
        Continuation::Look {
            is_rescheduled: false,
        } => {}
        Continuation::Look {
            is_rescheduled: true,
        } => execution.announce(&mut woken),
        Continuation::Step(ended) => execution.step(finish_ns, &mut woken, |moment| {
            ended.into_iter().for_each(|ended| moment.complete(ended));
        }),
    }
    let work = execution.find_work(core);
    drop(place);
    woken.wake();
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
    let Some(lost) = (execution.loans).recover(&mut execution.engine.placement, here.index(), left)
    else {
        return;
    };
    // Not when the interrupt came: a step may have left events since then. Nor may what follows
    // stand before this event.
    let clock_ns = clock::now_ns();
    let ended_ns = since_epoch(clock_ns);
    note_running(core, None);
    edge::failed(lost.instance, ended_ns, clock_ns);
    let mut woken = CoreSet::default();
    let (engine, mut port) = execution.parts(&mut woken);
    engine.tell_fault((ended_ns, here), lost.vertex, Some(lost), &mut port);
    execution.end_step(clock_ns, &mut woken);
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
        execution.step(now_ns, &mut woken, |_| ());
    }
    if !section::puts_off(core, now_ns)
        && let Some(waiting) = execution.follow(interrupted, now_ns)
    {
        woken.insert(cluster.core(waiting));
    }
    drop(place);
    woken.wake();
}
