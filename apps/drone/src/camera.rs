//! The camera, looking down, and its view of the beacon at the world's origin.
//!
//! An image is drawn from the true pose, as optics would draw it. From there on only the image
//! counts: the centre of the brightest region gives a ray. The ray, turned by the believed angles
//! and as long as the believed height says, gives the place.

use crate::airframe::{Pose, Vector, rotation};
use crate::attitude::AttitudeEstimate;

/// Columns and rows of an image.
pub const SIZE: (u16, u16) = (32, 24);

/// An image, row by row, from 0 (dark) to 255.
pub type Image = [u8; PIXELS];

const PIXELS: usize = SIZE.0 as usize * SIZE.1 as usize;

/// The focal length, in pixels.
const FOCAL: f32 = 16.0;

/// The image's centre.
const CENTRE: (f32, f32) = (15.5, 11.5);

/// The least brightness of the beacon.
const THRESHOLD: u8 = 40;

/// The airframe's place over the ground, as the camera believes.
#[derive(Clone, Copy, Debug, Default)]
pub struct PositionFix {
    /// North and west of the beacon.
    pub position: [f64; 2],
    /// In m/s.
    pub velocity: [f64; 2],
}

/// Takes an image from a pose.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a brightness is from 0 to 200"
)]
pub fn capture(pose: &Pose) -> Image {
    let rotation = rotation(pose.angles);
    // The beacon, seen from the body: the transposed matrix turns the world's axes back.
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let along = |row: usize| -pose.position[row] * rotation[row][axis];
        along(0) + along(1) + along(2)
    });
    let mut image = [0; PIXELS];
    if z > -0.1 {
        return image; // above the camera, or too near
    }
    let column = CENTRE.0 + FOCAL * (x / -z) as f32;
    let row = CENTRE.1 + FOCAL * (y / -z) as f32;
    for (index, pixel) in (0_u16..).zip(image.iter_mut()) {
        let (x, y) = column_and_row(index);
        let distance = ((x - column) * (x - column) + (y - row) * (y - row)) / 2.0;
        *pixel = (200.0 / ((1.0 + distance) * (1.0 + distance))) as u8;
    }
    image
}

/// Finds the beacon's column and row from the image's centre, if the beacon is in sight.
pub fn detect(image: &Image) -> Option<(f32, f32)> {
    let (mut sum, mut columns, mut rows) = (0.0_f32, 0.0_f32, 0.0_f32);
    for (index, pixel) in (0_u16..).zip(image) {
        if *pixel >= THRESHOLD {
            let (x, y) = column_and_row(index);
            let weight = f32::from(*pixel);
            sum += weight;
            columns += weight * (x - CENTRE.0);
            rows += weight * (y - CENTRE.1);
        }
    }
    (sum > 0.0).then(|| (columns / sum, rows / sum))
}

/// Returns the column and row of a pixel.
fn column_and_row(index: u16) -> (f32, f32) {
    (f32::from(index % SIZE.0), f32::from(index / SIZE.0))
}

/// Returns the airframe's place, given the beacon's place in the image.
pub fn locate((column, row): (f32, f32), estimate: &AttitudeEstimate) -> [f64; 2] {
    let ray: Vector = [f64::from(column / FOCAL), f64::from(row / FOCAL), -1.0];
    let [x, y, z] = rotation(estimate.angles)
        .map(|axis| axis[0] * ray[0] + axis[1] * ray[1] + axis[2] * ray[2]);
    let length = estimate.height / -z;
    [-x * length, -y * length]
}

impl PositionFix {
    /// Updates the fix with a place seen `seconds` after the previous place (an alpha-beta filter).
    pub fn update(self, seen: [f64; 2], seconds: f64) -> Self {
        let mut fix = self;
        for (axis, seen) in seen.into_iter().enumerate() {
            let expected = self.position[axis] + self.velocity[axis] * seconds;
            let error = seen - expected;
            fix.position[axis] = expected + 0.6 * error;
            fix.velocity[axis] += 0.25 * error / seconds;
        }
        fix
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beacon_out_of_sight_is_not_found() {
        let far = Pose {
            position: [9.0, 0.0, 2.0],
            ..Pose::default()
        };
        assert_eq!(detect(&capture(&far)), None);
    }
}
