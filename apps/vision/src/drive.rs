//! What is left to be said of a drive when it is over.

use alloc::sync::Arc;
use core::fmt;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// The figures of a drive. The DAGs only write them, so that they order nothing.
#[derive(Clone, Debug, Default)]
pub struct Drive(Arc<Figures>);

#[derive(Debug, Default)]
struct Figures {
    frames: AtomicU32,
    seen: AtomicU32,
    /// The bits of numbers that are not negative, which have the numbers' order.
    most_error: AtomicU32,
    gap: AtomicU32,
    speed: AtomicU32,
}

impl Drive {
    /// Returns the number of frames, and of those in which a distance was found.
    #[must_use]
    pub fn frames(&self) -> (u32, u32) {
        (self.0.frames.load(Relaxed), self.0.seen.load(Relaxed))
    }

    /// Returns the largest error of a distance, as a part of the true one.
    #[must_use]
    pub fn most_error(&self) -> f32 {
        f32::from_bits(self.0.most_error.load(Relaxed))
    }

    /// Returns how far the obstacle is at the end, in metres, and how fast the vehicle is.
    #[must_use]
    pub fn end(&self) -> (f32, f32) {
        let of = |bits: &AtomicU32| f32::from_bits(bits.load(Relaxed));
        (of(&self.0.gap), of(&self.0.speed))
    }

    pub(crate) fn moved(&self, gap: f32, speed: f32) {
        self.0.gap.store(gap.to_bits(), Relaxed);
        self.0.speed.store(speed.to_bits(), Relaxed);
    }

    pub(crate) fn fused(&self, truth: f32, seen: Option<f32>) {
        self.0.frames.fetch_add(1, Relaxed);
        if let Some(seen) = seen {
            self.0.seen.fetch_add(1, Relaxed);
            let error = (seen - truth).abs() / truth;
            self.0.most_error.fetch_max(error.to_bits(), Relaxed);
        }
    }
}

impl fmt::Display for Drive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ((frames, seen), (gap, speed)) = (self.frames(), self.end());
        write!(
            f,
            "a distance in {seen} of {frames} frames, {:.1} % off at most; at the end {gap:.2} m \
             are left, at {speed:.1} m/s",
            self.most_error() * 100.0
        )
    }
}
