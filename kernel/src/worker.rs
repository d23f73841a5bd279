//! What each core does: run what the scheduler assigns to it, else halt.

use core::sync::atomic::Ordering;

use sched_dag::{DagId, Instance, SubtaskId};

use crate::machine::this_core::{self, Core};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, cpu};
use crate::{console, execution};

/// The time between two signs of life of core 0. Without any alarm anywhere a
/// virtual machine whose time is virtual would stand still forever.
pub(crate) const HEARTBEAT_NS: u64 = 1_000_000_000;

/// Runs instances until `is_over` holds while nothing is assigned to this core.
///
/// `when_idle` is called each time before the core halts.
pub(crate) fn work(is_over: impl Fn() -> bool, mut when_idle: impl FnMut()) {
    let core = this_core::get();
    let mut next = None;
    loop {
        next = match next.take().or_else(|| look_for_work(core)) {
            Some(assignment) => run(core, assignment),
            None if is_over() => return,
            None => {
                when_idle();
                rest(core);
                None
            }
        };
    }
}

fn look_for_work(core: &Core) -> Option<execution::Assignment> {
    // The flag is cleared first: what is assigned from here on sets it again.
    core.wake
        .swap(false, Ordering::AcqRel)
        .then(|| execution::take_assignment(core.index))?
}

fn run(core: &Core, mut assignment: execution::Assignment) -> Option<execution::Assignment> {
    note_running(core, Some(assignment.instance));
    let start_ns = clock::now_ns();
    assignment.run();
    let finish_ns = clock::now_ns();
    note_running(core, None);
    execution::complete(core.index, assignment, start_ns, finish_ns)
}

/// Notes for reports of panics which instance runs on this core.
fn note_running(core: &Core, instance: Option<Instance>) {
    let fields = instance.map_or([u64::MAX; 3], |instance| {
        [
            u64::from(instance.dag.0),
            instance.job,
            u64::from(instance.subtask.0),
        ]
    });
    for (place, field) in core.running.iter().zip(fields) {
        place.store(field, Ordering::Relaxed);
    }
}

/// Returns the instance that runs on this core.
pub(crate) fn running(core: &Core) -> Option<Instance> {
    let [dag, job, subtask] = core
        .running
        .each_ref()
        .map(|field| field.load(Ordering::Relaxed));
    Some(Instance {
        dag: DagId(u32::try_from(dag).ok()?),
        job,
        subtask: SubtaskId(u32::try_from(subtask).ok()?),
    })
}

/// Sends a byte of waiting text, or else halts until an interrupt.
fn rest(core: &Core) {
    if console::send_pending_byte() {
        return;
    }
    cpu::disable_interrupts();
    // With interrupts disabled nothing can be assigned unnoticed between this
    // check and the halt.
    if core.wake.load(Ordering::Acquire) {
        cpu::enable_interrupts();
    } else {
        cpu::enable_interrupts_and_halt();
    }
}

/// Handles this core's timer interrupt.
pub(crate) fn timer_interrupt() {
    let core = this_core::get();
    core.timer_interrupts.fetch_add(1, Ordering::Relaxed);
    let now_ns = clock::now_ns();
    // Whoever holds the core watches the clock: waking it is all there is to do.
    timer::take_due(Alarm::Hold, now_ns);
    if timer::take_due(Alarm::Heartbeat, now_ns) {
        beat(core, now_ns);
    }
    if timer::take_due(Alarm::Schedule, now_ns) {
        execution::timer_event(now_ns);
    }
    timer::arm_earliest();
}

/// Gives every core a heartbeat each `period_ns`; if 0, core 0 its ordinary one
/// and the others none.
pub(crate) fn set_heartbeats(period_ns: u64) {
    for core in this_core::all() {
        let ordinary_ns = if core.index == 0 { HEARTBEAT_NS } else { 0 };
        let own_ns = if period_ns == 0 {
            ordinary_ns
        } else {
            period_ns
        };
        core.heartbeat_ns.store(own_ns, Ordering::Relaxed);
        core.wake_up();
    }
    beat(this_core::get(), clock::now_ns());
}

/// Returns the timer interrupts that all cores have taken since boot.
pub(crate) fn timer_interrupts() -> u64 {
    let counts = this_core::all().iter().map(|core| &core.timer_interrupts);
    counts.map(|count| count.load(Ordering::Relaxed)).sum()
}

fn beat(core: &Core, now_ns: u64) {
    let next_ns = match core.heartbeat_ns.load(Ordering::Relaxed) {
        0 => u64::MAX,
        period_ns => now_ns.saturating_add(period_ns),
    };
    timer::set(Alarm::Heartbeat, next_ns);
}

/// Handles another core's wake-up: there is work, an earlier event to wait for,
/// or another heartbeat.
pub(crate) fn wake_interrupt() {
    let core = this_core::get();
    if core.index == 0 {
        execution::arm_next_event();
    }
    if !timer::is_set(Alarm::Heartbeat) {
        beat(core, clock::now_ns());
    }
}

/// Keeps this core occupied until `ns` have passed, halted in between.
pub(crate) fn hold(ns: u64) {
    let end_ns = clock::now_ns().saturating_add(ns);
    timer::set(Alarm::Hold, end_ns);
    while clock::now_ns() < end_ns {
        cpu::disable_interrupts();
        // The alarm is still set unless it was taken meanwhile.
        if clock::now_ns() < end_ns {
            cpu::enable_interrupts_and_halt();
        } else {
            cpu::enable_interrupts();
        }
    }
    timer::set(Alarm::Hold, u64::MAX);
}

/// Keeps this core computing until `ns` have passed.
pub(crate) fn spin(ns: u64) {
    let end_ns = clock::now_ns().saturating_add(ns);
    while clock::now_ns() < end_ns {
        cpu::relax();
    }
}
