//! Bytes from the serial port where no conversation takes them: as events, each of which raises
//! the signal of a sporadic DAG, and the one that ends the run in order before its time.
//!
//! That byte is what ctrl-C is on a serial line (ETX in ASCII). With `console=stop` core 0's
//! heartbeat looks for it, four times a second, so it counts however busy the cores are.
//!
//! For events the port is looked at by core 0's background, each time that the core wakes up and
//! has nothing else to do, and at least every [`PERIOD_NS`] if it is idle. What the byte is does
//! not matter, but for the one that ends the run. How fast the bytes come does not either: the
//! DAG's minimum inter-arrival time is enforced by the scheduler.
//!
//! [`PERIOD_NS`]: front::shell::PERIOD_NS

use core::sync::atomic::{AtomicBool, Ordering};

use sched_dag::DagId;

use super::live_run::KernelRun;
use executive::machine::serial;
use executive::run::execution;
use front::shell::{END, shut_down};

/// Whether the heartbeat looks.
static IS_WATCHED: AtomicBool = AtomicBool::new(false);

/// Has the heartbeat look for the byte that ends the run, or not.
pub(super) fn watch(is_watched: bool) {
    IS_WATCHED.store(is_watched, Ordering::Relaxed);
}

/// Looks for that byte. In core 0's heartbeat.
pub(super) fn beat() {
    /// The size of the port's FIFO.
    const MOST_BYTES: usize = 16;
    let is_watched = IS_WATCHED.load(Ordering::Relaxed);
    let mut bytes = (0..MOST_BYTES).map_while(|_| serial::FIRST.receive());
    if is_watched && bytes.any(|byte| byte == END) {
        shut_down::<KernelRun>();
    }
}

/// The DAG that bytes are for.
#[derive(Debug)]
pub(super) struct Listener {
    plan: u64,
    dag: DagId,
    /// Whether one byte ends the run instead.
    stops: bool,
}

impl Listener {
    pub(super) const fn new((plan, dag): (u64, DagId), stops: bool) -> Self {
        Self { plan, dag, stops }
    }

    /// Raises the signal for each byte that has come.
    pub(super) fn step(&self) {
        /// The port may not end to have some.
        const MOST_BYTES: usize = 256;
        for _ in 0..MOST_BYTES {
            match serial::FIRST.receive() {
                None => return,
                Some(END) if self.stops => shut_down::<KernelRun>(),
                Some(_) => execution::raise(self.plan, self.dag),
            }
        }
    }
}
