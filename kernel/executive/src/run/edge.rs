//! The edge of a run: values are recorded for the host, or replayed.
//!
//! All that is known of recordings is behind [`Crossing`](fass::edge::Crossing), which only an
//! image with a recorded topic has. It is used under the scheduler's lock, or for a moment by a
//! source that is replayed; the drain belongs to core 0's background alone, so sending disturbs
//! nobody.

use fass::edge::{Edge, EdgeMode};

use crate::machine::debug_port;
use crate::machine::spinlock::{SpinLock, SpinLockGuard};

static EDGE: SpinLock<Edge> = SpinLock::new(Edge::new());

/// Returns the edge.
pub fn get() -> SpinLockGuard<'static, Edge> {
    EDGE.lock()
}

/// Takes what the command line says.
pub fn set_wish(wish: EdgeMode) {
    // Nobody has asked for the latest jobs, so they do not fill a console.
    if !matches!(wish, EdgeMode::Latest { .. }) || debug_port::is_there() {
        get().set_wish(wish);
    }
}
