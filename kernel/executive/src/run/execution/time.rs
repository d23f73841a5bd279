//! The run's time, and core 0's alarm for the scheduler's next event.

use core::sync::atomic::Ordering;

use sched_dag::CoreId;

use super::{EPOCH_NS, NEXT_EVENT_NS};
use crate::machine::this_core;
use crate::machine::timer::{self, Alarm};

/// Converts a time on the clock to the run's time; one before time 0 becomes that.
pub fn since_epoch(time_ns: u64) -> u64 {
    time_ns.saturating_sub(EPOCH_NS.load(Ordering::Relaxed))
}

/// Does the same for when something happened to an instance: none before time 0.
#[inline]
pub(super) fn instance_time_ns(time_ns: u64) -> u64 {
    time_ns.wrapping_sub(EPOCH_NS.load(Ordering::Relaxed))
}

/// Returns the core that executes this. Interrupts are disabled.
pub(super) fn here() -> CoreId {
    CoreId(this_core::get().index)
}

/// Sets core 0's alarm for the next event.
pub fn arm_next_event() {
    timer::set(Alarm::Schedule, NEXT_EVENT_NS.load(Ordering::Acquire));
}
