//! The attitude loop: from the sensors' measurements to the rotors' force.
//!
//! The gyroscopes give the angles, drawn slowly towards the angles of the directions upwards and to
//! the north (a complementary filter). The position controller asks for an acceleration, thus for
//! angles; the angle controller asks for torques.

use maths::{atan2, sin_cos, sqrt};

use crate::airframe::{INERTIA, MASS, RotorForce, SensorReadings, Vector, turned};
use crate::camera::PositionFix;
use crate::{GRAVITY, SECONDS};

/// The state that the loop estimates.
#[derive(Clone, Copy, Debug, Default)]
pub struct AttitudeEstimate {
    /// Roll, pitch and yaw.
    pub angles: Vector,
    /// About the body's axes, in rad/s.
    pub rates: Vector,
    /// The height above the ground.
    pub height: f64,
    /// Upwards, in m/s.
    pub climb: f64,
}

impl AttitudeEstimate {
    /// Starts from measurements, for an airframe without climb.
    pub fn new(measured: &SensorReadings) -> Self {
        Self {
            angles: angles_of(measured),
            rates: measured.rates,
            height: measured.height,
            climb: 0.0,
        }
    }

    /// Updates the estimate with new measurements.
    pub fn update(self, measured: &SensorReadings) -> Self {
        const TRUST: f64 = 0.02;
        let mut angles = turned(self.angles, measured.rates, SECONDS);
        for (angle, seen) in angles.iter_mut().zip(angles_of(measured)) {
            *angle += TRUST * difference(seen, *angle);
        }
        let height = self.height + self.climb * SECONDS;
        let error = measured.height - height;
        Self {
            angles,
            rates: measured.rates,
            height: height + TRUST * error,
            climb: self.climb + 0.2 * error,
        }
    }
}

/// Returns the angles of the directions upwards and to the north.
fn angles_of(measured: &SensorReadings) -> Vector {
    let [x, y, z] = measured.up;
    let roll = atan2(y, z);
    let pitch = atan2(-x, sqrt(y * y + z * z));
    let ((sr, cr), (sp, cp)) = (sin_cos(roll), sin_cos(pitch));
    let [x, y, z] = measured.north;
    let ahead = x * cp + (y * sr + z * cr) * sp;
    let left = y * cr - z * sr;
    [roll, pitch, atan2(-left, ahead)]
}

/// Returns the turn from one angle to another, at most half a turn.
fn difference(to: f64, from: f64) -> f64 {
    let (sin, cos) = sin_cos(to - from);
    atan2(sin, cos)
}

/// Decides the rotors' force for reaching a goal. Without a fix the airframe stays level.
pub fn control(
    estimate: &AttitudeEstimate,
    fix: Option<(PositionFix, f64)>,
    goal: Vector,
) -> RotorForce {
    const MOST: f64 = 2.5; // m/s^2, which is a tilt of 14 degrees
    let mut wanted = [0.0; 2];
    if let Some((fix, age)) = fix {
        for axis in 0..2 {
            let now = fix.position[axis] + fix.velocity[axis] * age;
            let acceleration = 2.5 * (goal[axis] - now) - 2.6 * fix.velocity[axis];
            wanted[axis] = acceleration.clamp(-MOST, MOST);
        }
    }
    let lift = 3.0 * (goal[2] - estimate.height) - 3.0 * estimate.climb;
    let lift = GRAVITY + lift.clamp(-MOST, MOST);

    let [roll, pitch, yaw] = estimate.angles;
    let (sy, cy) = sin_cos(yaw);
    let ahead = cy * wanted[0] + sy * wanted[1];
    let left = cy * wanted[1] - sy * wanted[0];
    let wanted = [
        atan2(-left, sqrt(lift * lift + ahead * ahead)),
        atan2(ahead, lift),
        0.0,
    ];
    let mut torque = [0.0; 3];
    for axis in 0..3 {
        let turn = difference(wanted[axis], estimate.angles[axis]);
        torque[axis] = INERTIA[axis] * (90.0 * turn - 17.0 * estimate.rates[axis]);
    }
    let upright = (sin_cos(roll).1 * sin_cos(pitch).1).max(0.5);
    RotorForce {
        thrust: (MASS * lift / upright).clamp(0.0, 2.0 * MASS * GRAVITY),
        torque,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::airframe::rotation;

    #[test]
    fn the_angles_of_exact_directions_are_exact() {
        let angles = [0.2, -0.3, 2.5];
        let rotation = rotation(angles);
        let measured = SensorReadings {
            rates: [0.0; 3],
            up: rotation[2],
            north: rotation[0],
            height: 0.0,
        };
        for (found, angle) in angles_of(&measured).into_iter().zip(angles) {
            assert!((found - angle).abs() < 1e-12, "{found} for {angle}");
        }
    }
}
