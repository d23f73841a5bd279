//! The handlers of a core's interrupts: its timer, and wake-ups by other cores.

use core::sync::atomic::Ordering;

use crate::machine::interrupt::{self, Interrupted};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, section, this_core};
use crate::run::{containment, execution, heartbeat};

/// Handles this core's timer interrupt.
pub fn timer_interrupt(interrupted: &mut Interrupted) {
    let core = this_core::get();
    core.timer_interrupts.fetch_add(1, Ordering::Relaxed);
    let now_ns = clock::now_ns();
    core.interrupted_ns.store(now_ns, Ordering::Relaxed);
    // The instance holding the core watches the clock: waking it is enough.
    timer::take_due(Alarm::Hold, now_ns);
    if timer::take_due(Alarm::Heartbeat, now_ns) {
        heartbeat::beat(core, now_ns);
        interrupt::look_in(core, now_ns);
    }
    if timer::take_due(Alarm::Schedule, now_ns) {
        execution::interrupt(interrupted, now_ns, true);
    }
    // After the schedule's step: an instance suspended there at its budget's end has not overrun.
    if timer::take_due(Alarm::Budget, now_ns) {
        containment::end_overrun(interrupted, now_ns);
    }
    // Last, since a section's end may have passed while the handlers above ran.
    if section::has_put_off(core) {
        execution::interrupt(interrupted, now_ns, false);
    }
    timer::arm_earliest();
}

/// Handles another core's wake-up: there is work, an earlier event to wait for, or another
/// heartbeat.
pub fn wake_interrupt(interrupted: &mut Interrupted) {
    let core = this_core::get();
    let now_ns = clock::now_ns();
    core.interrupted_ns.store(now_ns, Ordering::Relaxed);
    // The waker may have an earlier event for this core, whose timer only this core can write.
    if execution::keeps_time(core) {
        execution::arm_next_event();
    }
    heartbeat::keep_beating(core);
    execution::interrupt(interrupted, now_ns, false);
}

/// Returns the timer interrupts taken by all cores since boot.
pub fn timer_interrupts() -> u64 {
    let counts = this_core::all().iter().map(|core| &core.timer_interrupts);
    counts.map(|count| count.load(Ordering::Relaxed)).sum()
}
