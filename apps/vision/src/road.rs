//! The road ahead, as each of the two cameras sees it.
//!
//! An obstacle with a pattern stands straight ahead. Each camera is off the middle by half the
//! [`BASELINE`], so in its image the obstacle is shifted to the other side, the more the nearer.

use common::random::{Random, nth};

use crate::image::SIDE;

/// The focal length, in pixels.
pub const FOCAL: f32 = 256.0;

/// How far the cameras are from each other, in metres.
pub const BASELINE: f32 = 0.4;

/// The obstacle's width and height, in metres.
const WIDTH: f32 = 1.6;

/// How many squares of its pattern stand side by side.
const SQUARES: f32 = 6.0;

/// The obstacle's pattern is always this one.
const PATTERN: u64 = 7;

/// The brightness of what is behind it.
const BEHIND: u8 = 30;

/// Which camera it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

/// Draws what a camera sees of an obstacle that is so many metres away.
pub fn draw(pixels: &mut [u8], metres: f32, side: Side, noise: &mut Random) {
    let off = match side {
        Side::Left => -BASELINE / 2.0,
        Side::Right => BASELINE / 2.0,
    };
    // From pixels to squares of the pattern.
    let scale = metres / FOCAL * SQUARES / WIDTH;
    let shift = (off / WIDTH + 0.5) * SQUARES;
    let centre = SIDE as f32 / 2.0;
    let mut row = -centre * scale + SQUARES / 2.0;
    for line in pixels.chunks_exact_mut(SIDE) {
        let mut column = -centre * scale + shift;
        for eight in line.chunks_exact_mut(8) {
            let mut drawn = noise.number();
            for pixel in eight {
                *pixel = brightness(row, column) + (drawn & 3) as u8;
                drawn >>= 8;
                column += scale;
            }
        }
        row += scale;
    }
}

/// The brightness of a place of the pattern, in squares from its corner.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "both are from 0 to 6, and the brightness is from 60 to 251"
)]
fn brightness(row: f32, column: f32) -> u8 {
    let is_there = |at: f32| (0.0..SQUARES).contains(&at);
    if !is_there(row) || !is_there(column) {
        return BEHIND;
    }
    let square = u64::from(row as u32 * 8 + column as u32);
    60 + (nth(PATTERN, square) % 192) as u8
}
