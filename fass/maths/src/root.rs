//! The square root, which the processor calculates.

use core::arch::x86_64::{_mm_cvtsd_f64, _mm_set_sd, _mm_sqrt_sd};

/// Returns the square root, rounded to the nearest; NaN of a negative number.
#[must_use]
pub fn sqrt(x: f64) -> f64 {
    // SAFETY: SSE2 is part of every x86_64 processor, and code for it is compiled with SSE2.
    unsafe { root(x) }
}

#[target_feature(enable = "sse2")]
fn root(x: f64) -> f64 {
    let x = _mm_set_sd(x);
    _mm_cvtsd_f64(_mm_sqrt_sd(x, x))
}
