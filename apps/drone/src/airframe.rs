//! The simulated airframe: four rotors as one thrust and three torques, moved on by each job of
//! the attitude loop, and the sensors on board.
//!
//! Lengths are in metres, angles in radians, times in seconds. The axes of the world are north,
//! west and up; those of the body forward, left and up. Angles are roll, pitch and yaw, turned in
//! the order yaw, pitch, roll.

use maths::{sin_cos, tan};
use random::Random;

use crate::GRAVITY;

/// Three numbers along three axes.
pub type Vector = [f64; 3];

/// The mass, in kg.
pub const MASS: f64 = 1.2;

/// The moments of inertia, in kg m^2.
pub const INERTIA: Vector = [0.012, 0.012, 0.02];

/// The drag of the airframe, in 1/s.
const DRAG: f64 = 0.25;

/// The force of the rotors.
#[derive(Clone, Copy, Debug)]
pub struct RotorForce {
    /// Along the body's upward axis, in N.
    pub thrust: f64,
    /// About the body's axes, in N m.
    pub torque: Vector,
}

impl RotorForce {
    /// The force that holds the airframe up.
    pub const HOVER: RotorForce = RotorForce {
        thrust: MASS * GRAVITY,
        torque: [0.0; 3],
    };
}

/// Where the airframe is, and how it moves.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pose {
    /// In the world.
    pub position: Vector,
    /// In the world, in m/s.
    pub velocity: Vector,
    /// Roll, pitch and yaw.
    pub angles: Vector,
    /// About the body's axes, in rad/s.
    pub rates: Vector,
}

/// Measurements of the sensors on board, with noise.
#[derive(Clone, Copy, Debug)]
pub struct SensorReadings {
    /// The gyroscopes, in rad/s.
    pub rates: Vector,
    /// The direction upwards, in the body's axes.
    pub up: Vector,
    /// The direction to the north, in the body's axes.
    pub north: Vector,
    /// The height above the ground.
    pub height: f64,
}

/// The airframe.
#[derive(Clone, Debug)]
pub struct Airframe {
    pub(crate) pose: Pose,
}

impl Airframe {
    /// Places the airframe in the air, askew.
    pub fn new() -> Self {
        Self {
            pose: Pose {
                position: [0.3, -0.2, 2.5],
                angles: [0.1, -0.08, 0.2],
                ..Pose::default()
            },
        }
    }

    /// Moves the airframe on by `seconds`.
    pub fn step(&mut self, force: RotorForce, seconds: f64) {
        let Pose {
            position,
            velocity,
            angles,
            rates,
        } = &mut self.pose;
        let up = rotation(*angles).map(|row| row[2]);
        for axis in 0..3 {
            let weight = if axis == 2 { GRAVITY } else { 0.0 };
            let acceleration = up[axis] * force.thrust / MASS - weight - DRAG * velocity[axis];
            velocity[axis] += acceleration * seconds;
            position[axis] += velocity[axis] * seconds;
            rates[axis] += force.torque[axis] / INERTIA[axis] * seconds;
        }
        *angles = turned(*angles, *rates, seconds);
    }

    /// Measures the airframe's motion, with noise.
    pub fn measure(&self, noise: &mut Random) -> SensorReadings {
        let mut noisy = |value: f64, size: f64| value + size * draw(noise);
        let rotation = rotation(self.pose.angles);
        SensorReadings {
            rates: self.pose.rates.map(|rate| noisy(rate, 0.01)),
            up: rotation[2].map(|part| noisy(part, 0.02)),
            north: rotation[0].map(|part| noisy(part, 0.02)),
            height: noisy(self.pose.position[2], 0.05),
        }
    }
}

impl Default for Airframe {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the matrix that turns the body's axes into the world's, by rows.
pub fn rotation([roll, pitch, yaw]: Vector) -> [Vector; 3] {
    let ((sr, cr), (sp, cp), (sy, cy)) = (sin_cos(roll), sin_cos(pitch), sin_cos(yaw));
    [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
}

/// Returns the angles after turning about the body's axes for `seconds`.
pub fn turned([roll, pitch, yaw]: Vector, rates: Vector, seconds: f64) -> Vector {
    let ((sr, cr), (_, cp)) = (sin_cos(roll), sin_cos(pitch));
    let across = rates[1] * sr + rates[2] * cr;
    [
        roll + (rates[0] + across * tan(pitch)) * seconds,
        pitch + (rates[1] * cr - rates[2] * sr) * seconds,
        yaw + across / cp * seconds,
    ]
}

/// Draws a number from -1 to 1.
fn draw(noise: &mut Random) -> f64 {
    let thousandth = u32::try_from(noise.within(0..=2_000_000)).unwrap_or(0);
    f64::from(thousandth) / 1e6 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thrust_against_weight_hovers_and_a_tilt_accelerates() {
        let mut level = Airframe {
            pose: Pose::default(),
        };
        let mut tilted = level.clone();
        tilted.pose.angles[1] = 0.1;
        for _ in 0..100 {
            level.step(RotorForce::HOVER, 0.001);
            tilted.step(RotorForce::HOVER, 0.001);
        }
        assert_eq!(level.pose.position, [0.0; 3]);
        // g sin(0.1) t^2 / 2, of which drag takes a little.
        let ahead = tilted.pose.position[0];
        assert!((0.0048..0.00495).contains(&ahead), "{ahead} m");
    }

    #[test]
    fn torque_turns_about_its_axis() {
        let mut airframe = Airframe {
            pose: Pose::default(),
        };
        let force = RotorForce {
            torque: [0.0, 0.0, INERTIA[2]],
            ..RotorForce::HOVER
        };
        (0..1000).for_each(|_| airframe.step(force, 0.001));
        let yaw = airframe.pose.angles[2];
        assert!((yaw - 0.5).abs() < 1e-3, "{yaw} rad after 1 s of 1 rad/s^2");
    }
}
