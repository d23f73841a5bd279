//! The report of a flight when it is over.

use alloc::sync::Arc;
use core::fmt;
use core::sync::atomic::{AtomicU64, Ordering::Relaxed};

use maths::sqrt;

use crate::airframe::Pose;

/// The figures of a flight. The DAGs only write figures, so no figure orders subtasks.
#[derive(Clone, Debug, Default)]
pub struct Flight(Arc<FlightFigures>);

#[derive(Debug, Default)]
struct FlightFigures {
    waypoints: AtomicU64,
    has_landed: AtomicU64,
    frames: AtomicU64,
    fixes: AtomicU64,
    /// The bits of non-negative numbers, whose order is the numbers' order.
    most_tilt: AtomicU64,
    most_error: AtomicU64,
    height: AtomicU64,
}

impl Flight {
    /// Returns the number of waypoints reached.
    pub fn waypoints(&self) -> u64 {
        self.0.waypoints.load(Relaxed)
    }

    /// Reports whether the drone was sent down.
    pub fn has_landed(&self) -> bool {
        self.0.has_landed.load(Relaxed) > 0
    }

    /// Returns the number of frames, and the number of frames showing the beacon.
    pub fn frames(&self) -> (u64, u64) {
        (self.0.frames.load(Relaxed), self.0.fixes.load(Relaxed))
    }

    /// Returns the largest angle between the body's upward axis and the world's, in degrees.
    pub fn most_tilt_degrees(&self) -> f64 {
        f64::from_bits(self.0.most_tilt.load(Relaxed)).to_degrees()
    }

    /// Returns the largest distance between a place found by the camera and the true place, in
    /// metres.
    pub fn most_error_metres(&self) -> f64 {
        f64::from_bits(self.0.most_error.load(Relaxed))
    }

    /// Returns the height at the end, in metres.
    pub fn height_metres(&self) -> f64 {
        f64::from_bits(self.0.height.load(Relaxed))
    }

    pub(crate) fn decided(&self, lands: bool) {
        match lands {
            true => self.0.has_landed.store(1, Relaxed),
            false => _ = self.0.waypoints.fetch_add(1, Relaxed),
        }
    }

    pub(crate) fn moved(&self, tilt: f64, height: f64) {
        self.0.most_tilt.fetch_max(tilt.to_bits(), Relaxed);
        self.0.height.store(height.to_bits(), Relaxed);
    }

    pub(crate) fn located(&self, found: Option<[f64; 2]>, truth: &Pose) {
        self.0.frames.fetch_add(1, Relaxed);
        if let Some([x, y]) = found {
            let (x, y) = (x - truth.position[0], y - truth.position[1]);
            self.0.fixes.fetch_add(1, Relaxed);
            self.0
                .most_error
                .fetch_max(sqrt(x * x + y * y).to_bits(), Relaxed);
        }
    }
}

impl fmt::Display for Flight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (frames, fixes) = self.frames();
        let landed = if self.has_landed() {
            "sent down"
        } else {
            "still up"
        };
        write!(
            f,
            "{} waypoints reached, {landed}; tilt at most {} degrees; the beacon seen in \
             {fixes} of {frames} frames, {} cm off at most",
            self.waypoints(),
            whole(self.most_tilt_degrees()),
            whole(self.most_error_metres() * 100.0)
        )
    }
}

/// Rounds up. Code to print a fraction would take 10 KB of an image.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "degrees and centimetres are small, and not negative"
)]
fn whole(number: f64) -> u32 {
    number as u32 + 1
}
