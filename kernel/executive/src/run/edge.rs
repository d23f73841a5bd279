//! The edge of a run: records values for the host, or replays them.
//!
//! All knowledge of recordings is behind [`Crossing`](fass::edge::Crossing), present only in an
//! image with a recorded topic. The scheduler's step uses the edge under the scheduler's lock, and
//! a replayed source uses the edge for a moment; the drain belongs to core 0's background, so
//! sending disturbs nobody.

use fass::edge::{Edge, EdgeMode};

use crate::machine::debug_port;
use crate::machine::spinlock::{SpinLock, SpinLockGuard};

static EDGE: SpinLock<Edge> = SpinLock::new(Edge::new());

/// Returns the edge, locked.
pub fn get() -> SpinLockGuard<'static, Edge> {
    EDGE.lock()
}

/// Takes the wish stated on the command line.
pub fn set_wish(wish: EdgeMode) {
    // Nobody has asked for the latest jobs, so they do not fill a console.
    if !matches!(wish, EdgeMode::Latest { .. }) || debug_port::is_there() {
        get().set_wish(wish);
    }
}
