//! What functions are told that ask for the time.

use super::installed::expect_installed;
use crate::run::cell::current::Current;

/// What tells the time: the platform, unless it has named something else.
static CLOCK: Current<Clock> = Current::new(&(ASK_THE_PLATFORM as Clock));

/// Tells the time, as [`now_ns`] does.
pub type Clock = fn() -> u64;

const ASK_THE_PLATFORM: Clock = || expect_installed().now_ns();

/// Returns the platform's time in nanoseconds.
///
/// # Panics
///
/// If no platform is installed.
///
/// # Examples
///
/// ```
/// let machine = virtual_time::VirtualTime::new();
/// assert_eq!(fass::now_ns(), 0);
/// ```
#[inline]
#[must_use]
pub fn now_ns() -> u64 {
    CLOCK.get()()
}

/// Has functions told the time by that from now on, in place of by [`Platform::now_ns`](super::Platform::now_ns).
///
/// For platforms: one that writes down what functions were told has a way to do so, and all
/// others a shorter one.
///
/// # Examples
///
/// ```standalone_crate
/// static HALF_PAST: fass::Clock = || 30;
///
/// fass::set_clock(&HALF_PAST);
/// assert_eq!(fass::now_ns(), 30);
/// ```
pub fn set_clock(clock: &'static Clock) {
    CLOCK.set(clock);
}
