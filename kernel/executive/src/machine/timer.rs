//! Each core's alarms, all on its one hardware timer.
//!
//! An *alarm* is a time to interrupt the core, for one of a few fixed purposes. The hardware timer
//! is armed for the earliest alarm. The hardware may fire a little early or late: the clock alone
//! decides whether an alarm is due.

use core::sync::atomic::Ordering;

use super::this_core::{self, Core};
use super::{clock, counted_time, interrupt_flag, local_apic};

/// The purpose of an alarm; each core has one alarm of each purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alarm {
    /// The scheduler's next event.
    Schedule = 0,
    /// The end of a subtask's hold of its core, or of the core's time slice
    /// ([`time_slice`](super::time_slice)).
    Hold = 1,
    /// The end of the running instance's budget.
    Budget = 3,
    /// A sign of life, so that no core ever halts without an end in sight.
    Heartbeat = 2,
}

/// Sets this core's alarm to time `at_ns`, or to never if `u64::MAX`.
pub fn set(alarm: Alarm, at_ns: u64) {
    let were_enabled = interrupt_flag::disable();
    let core = this_core::get();
    // Writing the timer costs a virtual machine an exit: only when the alarm changes.
    if core.alarms[alarm as usize].swap(at_ns, Ordering::Relaxed) != at_ns {
        arm(core);
    }
    interrupt_flag::restore(were_enabled);
}

/// Ensures that the alarm of this core, `core`, is not later than `at_ns`. The alarm may be
/// earlier: if its handler looks at the clock again, an early alarm costs an interrupt now and then
/// instead of a write of the timer each time.
///
/// Inlined, as each start of an instance with a budget calls this.
#[inline(always)]
pub fn set_no_later(core: &Core, alarm: Alarm, at_ns: u64) {
    if core.alarms[alarm as usize].load(Ordering::Relaxed) > at_ns {
        set(alarm, at_ns);
    }
}

/// Takes an alarm due at `now_ns`: reports whether the alarm was due, and if so sets the alarm to
/// never. To be followed by [`arm_earliest`].
pub fn take_due(alarm: Alarm, now_ns: u64) -> bool {
    let slot = &this_core::get().alarms[alarm as usize];
    let due = slot.load(Ordering::Relaxed) <= now_ns;
    if due {
        // The timer is left alone here: several alarms may be due, and one write at the end is
        // enough.
        slot.store(u64::MAX, Ordering::Relaxed);
    }
    due
}

/// Reports whether this core's alarm is set.
pub fn is_set(alarm: Alarm) -> bool {
    this_core::get().alarms[alarm as usize].load(Ordering::Relaxed) != u64::MAX
}

/// Ends a timer's interrupt: arms this core's timer for its earliest alarm. Interrupts are
/// disabled.
pub fn arm_earliest() {
    let core = this_core::get();
    core.arms_later.store(false, Ordering::Relaxed);
    arm(core);
}

/// Begins a timer's interrupt: makes its time independent of the host, see [`counted_time`]. Until
/// [`arm_earliest`] ends the interrupt, alarms set meanwhile are only noted.
pub(super) fn settle() {
    let core = this_core::get();
    counted_time::settle(earliest_ns(core));
    core.arms_later.store(true, Ordering::Relaxed);
}

fn arm(core: &Core) {
    if core.arms_later.load(Ordering::Relaxed) {
        return;
    }
    match earliest_ns(core) {
        u64::MAX => local_apic::start_timer(0),
        at_ns => {
            let remaining_ns = at_ns.saturating_sub(clock::now_ns());
            local_apic::start_timer(clock::apic_ticks(remaining_ns));
        }
    }
}

/// Returns the time of the core's earliest alarm in nanoseconds, `u64::MAX` if there is none.
fn earliest_ns(core: &Core) -> u64 {
    let times = core.alarms.iter().map(|at| at.load(Ordering::Relaxed));
    times.min().unwrap_or(u64::MAX)
}
