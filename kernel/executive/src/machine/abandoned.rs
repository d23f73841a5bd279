//! Abandoned contexts: left for good, in the middle of a function.
//!
//! The kernel calls no destructor of the function: its code has just proved to be wrong, and a
//! destructor might never end. The stack is used again all the same.
//!
//! **Frames invariant**: data on a context's stack is reached from that context alone. Functions,
//! messages and states are `'static`, so they hold no reference to a frame, and the kernel lends
//! nothing in a frame to others except the lock of its section; recovering the context ends that
//! section.

use super::context::Parked;
use super::{paint, section};

/// A context left for good by a handler.
#[must_use = "its stack is lost unless it is recovered"]
pub struct AbandonedContext(Parked);

impl AbandonedContext {
    /// Takes a context that a handler has just left.
    pub(super) const fn new(left: Parked) -> Self {
        Self(left)
    }

    /// Returns the context, ready to [begin anew](Parked::restart). The data of a lock held by the
    /// context is lost.
    ///
    /// By the frames invariant nobody else knows of any data on its stack.
    #[must_use]
    pub fn recover(self) -> Parked {
        let Self(mut parked) = self;
        section::end(parked.context());
        parked.reset();
        paint::spoil(&parked.context().stack());
        parked
    }
}
