//! The functions of `f32`, calculated in `f64` and rounded once more.

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
