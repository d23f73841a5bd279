//! An orientation from angular rates, drawn towards the directions of gravity and the magnetic
//! field.
//!
//! The filter comes from S. Madgwick, "An efficient orientation filter for inertial and
//! inertial/magnetic sensor arrays", 2010, equations 12 to 46, with the magnetometer. The rates are
//! integrated; a step of gradient descent corrects the drift.

use maths::sqrt;

use crate::Sensor;

/// A quaternion: w, x, y, z.
pub type Quaternion = [f64; 4];

/// The orientation before the first sample.
pub const START: Quaternion = [1.0, 0.0, 0.0, 0.0];

/// How strongly the directions correct the rates, in rad/s.
const GAIN: f64 = 0.041;

/// The time between two samples, in seconds.
const SECONDS: f64 = 1.0 / 120.0;

/// Returns the product of two quaternions.
pub fn product([a, b, c, d]: Quaternion, [w, x, y, z]: Quaternion) -> Quaternion {
    [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]
}

/// Returns the opposite turn of a unit quaternion.
pub fn conjugate([w, x, y, z]: Quaternion) -> Quaternion {
    [w, -x, -y, -z]
}

/// Returns the orientation after a sample. Without a rate the orientation stays; without an
/// acceleration only the rates count.
///
/// # Panics
///
/// If a part of the sample is not finite, because all later orientations would be no numbers.
pub fn after(orientation: Quaternion, sensor: &Sensor) -> Quaternion {
    let parts = [sensor.acc, sensor.gyr, sensor.mag];
    let are_numbers = parts.as_flattened().iter().all(|part| part.is_finite());
    assert!(are_numbers, "a sensor has given what is no number");
    let [gx, gy, gz] = sensor.gyr;
    if norm(&sensor.gyr) == 0.0 {
        return orientation;
    }
    let mut change = product(orientation, [0.0, gx, gy, gz]).map(|part| 0.5 * part);
    if let Some(slope) = slope(orientation, sensor) {
        for (change, slope) in change.iter_mut().zip(slope) {
            *change -= GAIN * slope;
        }
    }
    let mut turned = orientation;
    for (part, change) in turned.iter_mut().zip(change) {
        *part += change * SECONDS;
    }
    unit(turned)
}

/// Returns the direction in which the orientation departs fastest from the measured directions of
/// gravity and of the magnetic field; `None` without an acceleration or without a departure.
fn slope(orientation: Quaternion, sensor: &Sensor) -> Option<Quaternion> {
    if norm(&sensor.acc) == 0.0 {
        return None;
    }
    let [ax, ay, az] = unit(sensor.acc);
    let [mx, my, mz] = unit(sensor.mag);
    // The field in the world: ahead and down.
    let field = product(
        product(orientation, [0.0, mx, my, mz]),
        conjugate(orientation),
    );
    let [_, hx, hy, bz] = field;
    let bx = sqrt(hx * hx + hy * hy);
    let [w, x, y, z] = orientation;
    let errors = [
        2.0 * (x * z - w * y) - ax,
        2.0 * (w * x + y * z) - ay,
        2.0 * (0.5 - x * x - y * y) - az,
        2.0 * bx * (0.5 - y * y - z * z) + 2.0 * bz * (x * z - w * y) - mx,
        2.0 * bx * (x * y - w * z) + 2.0 * bz * (w * x + y * z) - my,
        2.0 * bx * (w * y + x * z) + 2.0 * bz * (0.5 - x * x - y * y) - mz,
    ];
    if norm(&errors) == 0.0 {
        return None;
    }
    // The derivatives of each error by w, x, y and z.
    let derivatives = [
        [-2.0 * y, 2.0 * z, -2.0 * w, 2.0 * x],
        [2.0 * x, 2.0 * w, 2.0 * z, 2.0 * y],
        [0.0, -4.0 * x, -4.0 * y, 0.0],
        [
            -2.0 * bz * y,
            2.0 * bz * z,
            -4.0 * bx * y - 2.0 * bz * w,
            -4.0 * bx * z + 2.0 * bz * x,
        ],
        [
            -2.0 * bx * z + 2.0 * bz * x,
            2.0 * bx * y + 2.0 * bz * w,
            2.0 * bx * x + 2.0 * bz * z,
            -2.0 * bx * w + 2.0 * bz * y,
        ],
        [
            2.0 * bx * y,
            2.0 * bx * z - 4.0 * bz * x,
            2.0 * bx * w - 4.0 * bz * y,
            2.0 * bx * x,
        ],
    ];
    let mut gradient = [0.0; 4];
    for (error, derivatives) in errors.into_iter().zip(derivatives) {
        for (sum, derivative) in gradient.iter_mut().zip(derivatives) {
            *sum += derivative * error;
        }
    }
    Some(unit(gradient))
}

fn norm(parts: &[f64]) -> f64 {
    sqrt(parts.iter().map(|part| part * part).sum())
}

fn unit<const N: usize>(parts: [f64; N]) -> [f64; N] {
    let norm = norm(&parts);
    parts.map(|part| part / norm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_and_its_opposite_are_none() {
        let half = [0.8, 0.0, 0.6, 0.0];
        let none = product(half, conjugate(half));
        assert!((none[0] - 1.0).abs() < 1e-15 && none[2] == 0.0, "{none:?}");
    }

    #[test]
    fn without_acceleration_only_the_rate_counts_and_without_rate_nothing() {
        let mut sensor = Sensor {
            acc: [0.0; 3],
            gyr: [0.0, 0.0, 0.3],
            mag: [1.0, 0.0, 0.0],
        };
        let [w, x, y, z] = after(START, &sensor);
        assert_eq!((x, y), (0.0, 0.0));
        // A turn of 0.3 rad/s for 1/120 s about z.
        assert!((2.0 * maths::atan2(z, w) - 0.3 / 120.0).abs() < 1e-8);
        sensor.gyr = [0.0; 3];
        assert_eq!(after(START, &sensor), START);
    }
}
