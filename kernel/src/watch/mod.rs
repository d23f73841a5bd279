//! Watchers of a run: they look in on it, and report when it cannot go on.
//!
//! `background` is what core 0 does for people meanwhile: progress, status, the console, and
//! instances that keep the others waiting. `panic` ends a kernel that is broken. Nothing
//! here may be needed for a job to end: `run` goes on without it, and does not name it.

pub(crate) mod background;
pub(crate) mod panic;

use executive::machine::this_core::Core;

/// Looks in on the run. In a heartbeat of this core.
pub(crate) fn beat(core: &Core, now_ns: u64) {
    background::stall::look(core, now_ns);
    for endpoint in background::endpoint::CONNECTED.iter() {
        endpoint.beat(core, now_ns);
    }
    if core.index == 0 {
        background::beat(now_ns);
        panic::beat(now_ns);
    }
}
