//! The inverse functions, all by the arc tangent of two numbers.
//!
//! The smaller of the two, divided by the larger, is a tangent t from 0 to 1. With the nearest
//! eighth c, atan t = atan c + atan((t - c) / (1 + tc)): the first comes from a table. The second's
//! argument is at most 1/16, so seven terms of the series are enough.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use super::{nearest_integer, polynomial, sqrt};

/// A number with more digits than a double: the nearest double, and the remainder.
type Long = (f64, f64);

/// The arc tangents of the eighths from 0 to 1.
const OF_EIGHTHS: [Long; 9] = [
    (0.0, 0.0),
    (0.124_354_994_546_761_44, -3.125_324_142_453_938_3e-18),
    (0.244_978_663_126_864_14, 1.069_875_561_873_445_1e-17),
    (0.358_770_670_270_572_25, -2.462_381_558_263_863_5e-17),
    (0.463_647_609_000_806_1, 2.269_877_745_296_168_7e-17),
    (0.558_599_315_343_562_4, -5.455_630_548_591_626e-18),
    (0.643_501_108_793_284_4, 1.583_478_505_144_428_6e-17),
    (0.718_829_999_621_624_5, -2.147_838_844_445_698_3e-17),
    (FRAC_PI_4, 3.061_616_997_868_383e-17),
];

const STRAIGHT_ANGLE: Long = (PI, 1.224_646_799_147_353_2e-16);
const RIGHT_ANGLE: Long = (FRAC_PI_2, 6.123_233_995_736_766e-17);

/// Returns the angle whose tangent is `x`, in radians, from -pi/2 to pi/2.
pub fn atan(x: f64) -> f64 {
    atan2(x, 1.0)
}

/// Returns the angle whose sine is `x`, in radians, from -pi/2 to pi/2; NaN beyond 1.
pub fn asin(x: f64) -> f64 {
    atan2(x, sqrt((1.0 - x) * (1.0 + x)))
}

/// Returns the angle whose cosine is `x`, in radians, from 0 to pi; NaN beyond 1.
pub fn acos(x: f64) -> f64 {
    atan2(sqrt((1.0 - x) * (1.0 + x)), x)
}

/// Returns the angle of the point (x, y), in radians, from -pi to pi; for zeros and infinities as
/// IEEE 754 (9.2.1) demands.
pub fn atan2(y: f64, x: f64) -> f64 {
    if x.is_nan() || y.is_nan() {
        return f64::NAN;
    }
    let (height, width) = match (y.abs(), x.abs()) {
        (f64::INFINITY, f64::INFINITY) => (1.0, 1.0),
        both => both,
    };
    let is_steep = height > width;
    let (less, more) = if is_steep {
        (width, height)
    } else {
        (height, width)
    };
    let angle = if more == 0.0 {
        (0.0, 0.0)
    } else {
        of_ratio(less / more)
    };
    let angle = if is_steep {
        minus(RIGHT_ANGLE, angle)
    } else {
        angle
    };
    let angle = if x.is_sign_negative() {
        minus(STRAIGHT_ANGLE, angle)
    } else {
        angle
    };
    (angle.0 + angle.1).copysign(y)
}

/// The arc tangent of a number from 0 to 1.
fn of_ratio(ratio: f64) -> Long {
    const TERMS: [f64; 6] = [
        -1.0 / 3.0,
        1.0 / 5.0,
        -1.0 / 7.0,
        1.0 / 9.0,
        -1.0 / 11.0,
        1.0 / 13.0,
    ];
    let (eighths, index) = nearest_integer(ratio * 8.0);
    let nearest = eighths / 8.0;
    let tangent = (ratio - nearest) / (1.0 + ratio * nearest);
    let square = tangent * tangent;
    let rest = tangent * (square * polynomial(square, &TERMS));
    let Some((high, low)) = OF_EIGHTHS.get((index & 15) as usize) else {
        unreachable!("the ratio is at most 1");
    };
    let sum = high + tangent;
    (sum, ((high - sum) + tangent) + (rest + low))
}

fn minus(a: Long, b: Long) -> Long {
    let high = a.0 - b.0;
    (high, ((a.0 - high) - b.0) + (a.1 - b.1))
}
