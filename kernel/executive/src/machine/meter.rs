//! Meters of how long each core's interrupts stay disabled.

use core::panic::Location;
use core::sync::atomic::{AtomicPtr, AtomicU64};

/// The measurements of one core, in ticks of the time stamp counter.
#[derive(Debug)]
pub(super) struct CoreMeter {
    /// When the current section began; 0 if there is none.
    pub(super) began: AtomicU64,
    pub(super) began_at: AtomicPtr<Location<'static>>,
    pub(super) longest: AtomicU64,
    pub(super) longest_at: AtomicPtr<Location<'static>>,
}

impl CoreMeter {
    pub(super) const fn new() -> Self {
        Self {
            began: AtomicU64::new(0),
            began_at: AtomicPtr::new(core::ptr::null_mut()),
            longest: AtomicU64::new(0),
            longest_at: AtomicPtr::new(core::ptr::null_mut()),
        }
    }
}
