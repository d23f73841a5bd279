//! Contexts that were left for good, in the middle of what they ran.
//!
//! No destructor of what such a context ran is called: that code has just proved to be wrong, and
//! there may be no end to it. Its stack is used again all the same.
//!
//! **Frames invariant**: what lies on a context's stack is reached from that context alone.
//! Functions, messages and states are `'static`, so they hold no reference to a frame, and the
//! kernel lends nothing of one to others but the lock of its section, which ends when the context is
//! recovered.

use super::context::Parked;
use super::{paint, section};

/// A context that a handler has left for good.
#[must_use = "its stack is lost unless it is recovered"]
pub struct AbandonedContext(Parked);

impl AbandonedContext {
    /// Takes a context that a handler has just left.
    pub(super) const fn new(left: Parked) -> Self {
        Self(left)
    }

    /// Returns the context, to [begin anew](Parked::restart). The data of a lock that it held is lost.
    ///
    /// By the frames invariant nobody else knows of what lay on its stack.
    #[must_use]
    pub fn recover(self) -> Parked {
        let Self(mut parked) = self;
        section::end(parked.context());
        parked.reset();
        paint::spoil(&parked.context().stack());
        parked
    }
}
