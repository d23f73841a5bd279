//! What crosses the edge of a run: recorded for the host, or replayed.
//!
//! All that is known of recordings is behind [`Crossing`](fass::edge::Crossing), which only an
//! image with a recorded topic has. It is used under the scheduler's lock, or for a moment by a
//! source that is replayed; the drain belongs to core 0's background alone, so sending disturbs
//! nobody.

use alloc::boxed::Box;
use alloc::string::String;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::edge::{Edge, Outgoing, Wish, send_rest};
use fass::{LaunchError, Plan, Recorded};
use sched_dag::{Instance, Notice};

use crate::machine::debug_port;
use crate::machine::spinlock::{SpinLock, SpinLockGuard};
use front::report::crossing;

static EDGE: SpinLock<Edge> = SpinLock::new(Edge::new());

/// Whether a plan has been launched with it, so that events are of interest.
static IS_ON: AtomicBool = AtomicBool::new(false);

/// Returns the edge, outside of the scheduler's lock.
pub fn get() -> SpinLockGuard<'static, Edge> {
    EDGE.lock()
}

/// Takes what the command line says.
pub fn set_wish(wish: Wish) -> Result<(), &'static str> {
    match wish {
        Wish::Record {
            is_needed: true, ..
        } if !debug_port::is_there() => {
            return Err(
                "`record`: there is no debug port at 0x402 to send it to; run it in QEMU, by \
                 `./scripts/run --record FILE`",
            );
        }
        // Nobody has asked for it, or for more than there is.
        Wish::Latest { .. } | Wish::Record { .. } if !debug_port::is_there() => return Ok(()),
        _ => {}
    }
    EDGE.lock().set_wish(Box::leak(Box::new(wish)));
    Ok(())
}

/// Makes a plan one that is recorded or replayed, if there is a wish. Reports whether that goes for
/// the times, too, that functions are told.
pub fn launch(plan: &mut Plan) -> Result<bool, LaunchError> {
    let mut edge = EDGE.lock();
    let launched = edge.launch(plan, &mut debug_port::send);
    IS_ON.store(edge.is_on(), Ordering::Relaxed);
    launched.map_err(LaunchError::new)
}

/// Sends an entry, if there is one; `false`: there was none.
pub fn send(outgoing: &mut Outgoing) -> bool {
    (outgoing.as_mut()).is_some_and(|drain| drain.step(&mut debug_port::send))
}

/// Sends what is left when the run is over, or what is kept of jobs before a fault, and says what
/// came of it.
pub fn end(outgoing: Outgoing, is_over: bool) {
    let mut edge = EDGE.lock();
    let outcome = edge.end_run(is_over);
    let outgoing = outgoing.or_else(|| edge.before_fault(&mut debug_port::send));
    drop(edge);
    if let Some(outcome) = outcome {
        crossing::replayed(&outcome);
    }
    if let Some(drained) = send_rest(outgoing, &mut debug_port::send) {
        crossing::recorded(&drained);
    }
}

/// Takes note that an instance has failed, on the run's time and the clock's. The scheduler's
/// lock is held.
pub fn failed(instance: Instance, at_ns: u64, clock_ns: u64) {
    if IS_ON.load(Ordering::Relaxed) {
        EDGE.lock_uninterrupted().failed(instance, at_ns, clock_ns);
    }
}

/// Takes a value that is not read where it was written, and when that was in the time of the run.
/// The scheduler's lock is held.
pub fn record(value: &Recorded<'_>, at_ns: u64) {
    EDGE.lock_uninterrupted().record(value, at_ns);
}

/// Takes what became of a job or an instance, if it is of interest. The scheduler's lock is
/// held.
pub fn happened(notice: &Notice) {
    if IS_ON.load(Ordering::Relaxed) {
        EDGE.lock_uninterrupted().happened(notice);
    }
}

/// Returns why the wish could not be met, and how a replay differs from its recording, if that is
/// so.
pub fn objections() -> [Option<String>; 2] {
    let edge = EDGE.lock();
    [edge.refusal(), edge.complaint()].map(|text| text.map(String::from))
}
