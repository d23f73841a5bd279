//! Signs of life: interrupts taken by a core now and then, also when nothing else is due.

use core::sync::atomic::Ordering;

use crate::machine::clock;
use crate::machine::this_core::{self, Core};
use crate::machine::timer::{self, Alarm};

/// The time between two signs of life of core 0, in nanoseconds. Without any alarm on any core a
/// virtual machine with virtual time would stop forever.
const FIRST_NS: u64 = 1_000_000_000;

/// The same time for core 1, whose heartbeat notices a core 0 that takes no interrupts.
pub const SECOND_NS: u64 = 2_000_000_000;

/// Gives every core a heartbeat each `period_ns`; if 0, gives cores 0 and 1 their ordinary
/// heartbeats and the others none.
pub fn set_heartbeats(period_ns: u64) {
    for core in this_core::all() {
        let ordinary_ns = match core.index {
            0 => FIRST_NS,
            1 => SECOND_NS,
            _ => 0,
        };
        let own_ns = if period_ns == 0 {
            ordinary_ns
        } else {
            period_ns
        };
        core.heartbeat_ns.store(own_ns, Ordering::Relaxed);
        // Each other core sets its own alarm: only the core itself can write its timer.
        core.wake_up();
    }
    beat(this_core::get(), clock::now_ns());
}

/// Returns the time between two heartbeats of core 0, the calling core.
pub fn own_heartbeat_ns() -> u64 {
    this_core::get().heartbeat_ns.load(Ordering::Relaxed)
}

/// Gives core 0, the calling core, a heartbeat each `period_ns`. Called outside any instance.
pub fn set_own_heartbeat(period_ns: u64) {
    let core = this_core::get();
    core.heartbeat_ns.store(period_ns, Ordering::Relaxed);
    beat(core, clock::now_ns());
}

/// Begins the core's heartbeat if the core has a period and no alarm set yet.
pub fn keep_beating(core: &Core) {
    // Each wake-up comes here: setting the alarm anew would put the heartbeat off for ever.
    if !timer::is_set(Alarm::Heartbeat) {
        beat(core, clock::now_ns());
    }
}

/// Sets the core's alarm for its next heartbeat, if the core has a period.
pub fn beat(core: &Core, now_ns: u64) {
    let next_ns = match core.heartbeat_ns.load(Ordering::Relaxed) {
        0 => u64::MAX,
        period_ns => now_ns.saturating_add(period_ns),
    };
    timer::set(Alarm::Heartbeat, next_ns);
}
