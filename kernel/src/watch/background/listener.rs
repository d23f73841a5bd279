//! Bytes from the serial port as events: each raises the signal of a sporadic DAG.
//!
//! The port is looked at by core 0's background, each time that the core wakes up
//! and has nothing else to do, and at least every [`PERIOD_NS`] if it is
//! idle. What the byte is does not matter, but for the one that ends the run ([`stop`]). How fast
//! the bytes come does not either:
//! the DAG's minimum inter-arrival time is enforced by the scheduler.
//!
//! [`PERIOD_NS`]: front::shell::PERIOD_NS

use sched_dag::DagId;

use super::stop;
use executive::machine::serial;
use executive::run::execution;
use front::shell::END;

/// The most bytes that are taken at a time: the port may not end to have some.
const MOST_BYTES: usize = 256;

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
        for _ in 0..MOST_BYTES {
            match serial::FIRST.receive() {
                None => return,
                Some(END) if self.stops => stop::shut_down(),
                Some(_) => execution::raise(self.plan, self.dag),
            }
        }
    }
}
