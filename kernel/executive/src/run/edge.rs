//! The edge of a run: values are recorded for the host, or replayed.
//!
//! All that is known of recordings is behind [`Crossing`](fass::edge::Crossing), which only an
//! image with a recorded topic has. It is used under the scheduler's lock, or for a moment by a
//! source that is replayed; the drain belongs to core 0's background alone, so sending disturbs
//! nobody.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::edge::RecordedValue;
use fass::edge::{Edge, EdgeMode, Record};
use fass::platform::{LaunchError, Plan};
use sched_dag::{DriverNotice, Instance};

use crate::machine::debug_port;
use crate::machine::spinlock::{SpinLock, SpinLockGuard};

static EDGE: SpinLock<Edge> = SpinLock::new(Edge::new());

/// Whether a plan has been launched with it, so that events are of interest.
static IS_ON: AtomicBool = AtomicBool::new(false);

/// Returns the edge, outside of the scheduler's lock.
pub fn get() -> SpinLockGuard<'static, Edge> {
    EDGE.lock()
}

/// Takes what the command line says.
pub fn set_wish(wish: EdgeMode) {
    // Nobody has asked for the latest jobs, so they do not fill a console.
    if !matches!(wish, EdgeMode::Latest { .. }) || debug_port::is_there() {
        EDGE.lock().set_wish(Box::leak(Box::new(wish)));
    }
}

/// Makes a plan one that is recorded or replayed, if there is a wish. Reports whether that goes for
/// the times, too, that functions are told.
/// Its header goes into the record.
pub fn launch(plan: &mut Plan, record: Option<&mut Record>) -> Result<bool, LaunchError> {
    let mut edge = EDGE.lock();
    let launched = edge.launch(plan, record);
    IS_ON.store(edge.is_on(), Ordering::Relaxed);
    launched.map_err(LaunchError::new)
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
pub fn record(value: &RecordedValue<'_>, at_ns: u64) {
    EDGE.lock_uninterrupted().record(value, at_ns);
}

/// Takes what became of a job or an instance, if it is of interest. The scheduler's lock is
/// held.
pub fn happened(notice: &DriverNotice) {
    if IS_ON.load(Ordering::Relaxed) {
        EDGE.lock_uninterrupted().happened(notice);
    }
}
