//! The run's time, and the alarm of each cluster's first core for its scheduler's next event.

use core::sync::atomic::Ordering;

use sched_dag::CoreId;

use super::EPOCH_NS;
use super::cluster::{self, FIRST_SEAT};
use crate::machine::this_core::{self, Core};
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

/// Returns the seat of the core that executes this. Interrupts are disabled.
pub(super) fn here() -> CoreId {
    seat(this_core::get())
}

/// Returns a core's seat.
#[inline]
pub(super) fn seat(core: &Core) -> CoreId {
    match cluster::MAY_DIVIDE {
        true => CoreId(core.place.load(Ordering::Relaxed)),
        false => CoreId(core.index),
    }
}

/// Reports whether a core keeps its cluster's time.
pub fn keeps_time(core: &Core) -> bool {
    seat(core) == FIRST_SEAT
}

/// Sets this core's alarm for the next event; it is its cluster's first one. Interrupts are
/// disabled, or nothing else runs here.
pub fn arm_next_event() {
    let cluster = cluster::of(this_core::get());
    timer::set(Alarm::Schedule, cluster.next_event_ns());
}

/// Sets the alarms of all clusters. On core 0, before a run.
pub fn arm_all() {
    arm_next_event();
    for cluster in cluster::all().skip(1) {
        this_core::all()[cluster.core(FIRST_SEAT) as usize].wake_up();
    }
}
