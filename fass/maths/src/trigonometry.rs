//! Sine, cosine and tangent.
//!
//! The argument is reduced by multiples of a right angle. The right angle is held in three parts;
//! the first two have zeros at their ends, so their multiples are exact (W. J. Cody and W. Waite,
//! Software Manual for the Elementary Functions, 1980). The remainder, at most half of a right
//! angle, comes with its rounding error. There nine terms of the Taylor series are enough.

use core::f64::consts::FRAC_2_PI;

use super::{nearest_integer, polynomial};

/// The largest angle, in radians, with known sine and cosine: 2^20 right angles are exact, and
/// this is less.
pub const LARGEST_ANGLE: f64 = 1e6;

/// A right angle, in three parts.
const RIGHT_ANGLE: [f64; 3] = [
    1.570_796_326_734_125_6,
    6.077_100_506_303_966e-11,
    2.022_266_248_795_950_6e-21,
];

/// Returns the sine of an angle in radians.
pub fn sin(angle: f64) -> f64 {
    sin_cos(angle).0
}

/// Returns the cosine of an angle in radians.
pub fn cos(angle: f64) -> f64 {
    sin_cos(angle).1
}

/// Returns the tangent of an angle in radians.
pub fn tan(angle: f64) -> f64 {
    let (sin, cos) = sin_cos(angle);
    sin / cos
}

/// Returns sine and cosine of an angle in radians.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    if angle.is_nan() || angle.abs() > LARGEST_ANGLE {
        return (f64::NAN, f64::NAN);
    }
    if angle == 0.0 {
        return (angle, 1.0); // with its sign
    }
    let (quarters, quadrant) = nearest_integer(angle * FRAC_2_PI);
    let [first, second, third] = RIGHT_ANGLE;
    let left = angle - quarters * first;
    let (high, low) = difference(left, quarters * second);
    let (high, low) = difference(high, quarters * third - low);
    let (sin, cos) = (sin_of_part(high, low), cos_of_part(high, low));
    match quadrant & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Returns `a - b` and its rounding error (D. E. Knuth, The Art of Computer Programming 2, 4.2.2,
/// theorem B).
fn difference(a: f64, b: f64) -> (f64, f64) {
    let high = a - b;
    let of_b = a - high;
    let of_a = high + of_b;
    (high, (a - of_a) + (of_b - b))
}

/// The sine of `x + rest`, at most half of a right angle: x - x^3/3! + ...
fn sin_of_part(x: f64, rest: f64) -> f64 {
    const TERMS: [f64; 8] = [
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5_040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
        1.0 / 355_687_428_096_000.0,
    ];
    let square = x * x;
    let tail = square * polynomial(square, &TERMS);
    x + (x * tail + rest * (1.0 - square / 2.0))
}

/// The cosine of `x + rest`, at most half of a right angle: 1 - x^2/2! + ...
fn cos_of_part(x: f64, rest: f64) -> f64 {
    const TERMS: [f64; 8] = [
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
        -1.0 / 6_402_373_705_728_000.0,
    ];
    let square = x * x;
    let half = square / 2.0;
    let near = 1.0 - half;
    let tail = square * square * polynomial(square, &TERMS) - x * rest;
    // With the rounding error of `near`.
    near + (((1.0 - near) - half) + tail)
}
