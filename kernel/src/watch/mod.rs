//! Watchers of a run: they observe the run, and report when it cannot go on.
//!
//! `background` is the work of core 0 for people during a run: progress, status, the console, and
//! reports of instances that keep others waiting. `panic` ends a broken kernel. No job may need a
//! watcher to end: the executive's module `run` works without watchers, and does not name them.

pub(crate) mod background;
pub(crate) mod panic;

use executive::machine::this_core::Core;

/// Observes the run. Called in a heartbeat of this core.
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
