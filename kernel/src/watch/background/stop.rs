//! The end of a run in order, before its time: by the console's `shutdown`, or by one byte.
//!
//! The byte is what ctrl-C is on a serial line (ETX in ASCII). With `console=stop` core 0's
//! heartbeat looks for it, four times a second, so it counts however busy the cores are. Where a
//! conversation or a signal of the app's takes the port's bytes, that looks itself.

use core::sync::atomic::{AtomicBool, Ordering};

use executive::machine::serial;
use executive::run::execution;
use front::shell::END;
use sched_dag::DagId;
use sched_dag::lifecycle::Request;

use crate::println;

/// The most bytes that a look takes: what the port's FIFO holds.
const MOST_BYTES: usize = 16;

/// Whether the heartbeat looks.
static IS_WATCHED: AtomicBool = AtomicBool::new(false);

/// Whether the run shall end.
static IS_ASKED: AtomicBool = AtomicBool::new(false);

/// Begins a run, in which the heartbeat looks for the byte or does not.
pub(super) fn begin(is_watched: bool) {
    IS_WATCHED.store(is_watched, Ordering::Relaxed);
}

/// Ends the run. Reports whether that was asked for.
pub(super) fn end() -> bool {
    IS_WATCHED.store(false, Ordering::Relaxed);
    IS_ASKED.swap(false, Ordering::Relaxed)
}

/// Looks for the byte. In core 0's heartbeat.
pub(super) fn beat() {
    let is_watched = IS_WATCHED.load(Ordering::Relaxed);
    let mut bytes = (0..MOST_BYTES).map_while(|_| serial::FIRST.receive());
    if is_watched && bytes.any(|byte| byte == END) {
        shut_down();
    }
}

/// Has nothing more released, and what is in flight go on to its end.
pub(super) fn shut_down() {
    let Some(task_set) = execution::task_set() else {
        return;
    };
    println!("shutting down: nothing more is released; what is in flight goes on");
    let dags = (0..).map(DagId).take(task_set.dags().len());
    dags.for_each(|dag| execution::control(dag, Request::Close));
    IS_ASKED.store(true, Ordering::Relaxed);
}
