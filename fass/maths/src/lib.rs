//! The mathematical functions that `core` lacks, for apps: square root and trigonometry.
//!
//! A result depends only on the arguments: it has the same bits on the host and on the machine, and
//! depends on no library of the host. Errors are given in *ulp*, units in the last place of the
//! true value; `tests/references.rs` measures them against true values in 90 digits.
//!
//! | function | error, at most | arguments |
//! |---|---|---|
//! | [`sqrt`] | 0.5 ulp, as IEEE 754 demands | all |
//! | [`sin`], [`cos`] | 1 ulp | up to [`LARGEST_ANGLE`] |
//! | [`tan`] | 2 ulp | up to [`LARGEST_ANGLE`] |
//! | [`atan`], [`atan2`] | 2 ulp | all |
//! | [`asin`], [`acos`] | 3 ulp | from -1 to 1 |
//!
//! For other arguments, and for NaN, the result is NaN. [`single`] has the same functions for
//! `f32`, calculated in `f64`, so their error is close to 0.5 ulp.
//!
//! Other functions (`exp`, `ln`, `pow`) are in crates such as `libm`: any `no_std` crate works in
//! an app.
//!
//! ```
//! let tilt = maths::atan2(1.0, 2.0);
//! assert!((maths::tan(tilt) - 0.5).abs() < 1e-15);
//! assert_eq!(maths::sqrt(2.25), 1.5);
//! assert_eq!(maths::single::sin(0.5), 0.5_f32.sin());
//! ```

#![no_std]

mod arcs;
mod trigonometry;

pub use arcs::{acos, asin, atan, atan2};
pub use root::sqrt;
pub use trigonometry::{LARGEST_ANGLE, cos, sin, sin_cos, tan};

/// Added to a number below 2^51, this constant makes the last bit of the sum count 1: the sum is
/// rounded, and its low bits are an integer.
const ROUNDS: f64 = 6_755_399_441_055_744.0;

/// Returns the integer nearest to a number below 2^51: as a number, and by its low bits.
fn nearest_integer(x: f64) -> (f64, u64) {
    let shifted = x + ROUNDS;
    (shifted - ROUNDS, shifted.to_bits())
}

/// Returns a polynomial's value, from its coefficients, the constant first.
fn polynomial(x: f64, coefficients: &[f64]) -> f64 {
    let highest_first = coefficients.iter().rev();
    highest_first.fold(0.0, |sum, coefficient| sum * x + coefficient)
}

// On other targets the standard library uses an instruction for it, too.
#[cfg(not(target_arch = "x86_64"))]
mod root {
    extern crate std;

    /// Returns the square root, rounded to the nearest; NaN of a negative number.
    pub fn sqrt(x: f64) -> f64 {
        x.sqrt()
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "the processor's square root")]
mod root {
    use core::arch::x86_64::{_mm_cvtsd_f64, _mm_set_sd, _mm_sqrt_sd};

    /// Returns the square root, rounded to the nearest; NaN of a negative number.
    pub fn sqrt(x: f64) -> f64 {
        // SAFETY: SSE2 is part of every x86_64 processor, and code for it is compiled with SSE2.
        unsafe { root(x) }
    }

    #[target_feature(enable = "sse2")]
    fn root(x: f64) -> f64 {
        let x = _mm_set_sd(x);
        _mm_cvtsd_f64(_mm_sqrt_sd(x, x))
    }
}

/// The functions of `f32`, calculated in `f64` and rounded once more.
pub mod single {
    macro_rules! single {
        ($($name:ident($($argument:ident),+): $what:literal;)+) => {$(
            #[doc = concat!("Returns ", $what, "; see [`", stringify!($name), "`](super::", stringify!($name), ").")]
            #[must_use]
            #[allow(clippy::cast_possible_truncation, reason = "rounding is what is wanted")]
            pub fn $name($($argument: f32),+) -> f32 {
                super::$name($(f64::from($argument)),+) as f32
            }
        )+};
    }

    single! {
        sqrt(x): "the square root";
        sin(angle): "the sine of an angle in radians";
        cos(angle): "the cosine of an angle in radians";
        tan(angle): "the tangent of an angle in radians";
        atan(x): "the angle whose tangent is `x`, in radians";
        asin(x): "the angle whose sine is `x`, in radians";
        acos(x): "the angle whose cosine is `x`, in radians";
        atan2(y, x): "the angle of the point (x, y), in radians";
    }
}
