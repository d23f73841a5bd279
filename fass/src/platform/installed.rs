//! The platform of the program.

use core::fmt;

use super::Platform;
use crate::run::cell::SetOnce;
use crate::run::crossing::Recorded;

static PLATFORM: SetOnce<&'static dyn Platform> = SetOnce::new();

/// A platform is installed already; the earlier one stays.
///
/// # Examples
///
/// ```
/// assert!(fass::AlreadyInstalled.to_string().contains("already installed"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlreadyInstalled;

impl fmt::Display for AlreadyInstalled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a platform is already installed; install one platform, once, at start")
    }
}

impl core::error::Error for AlreadyInstalled {}

/// Installs the platform, once, for the whole program.
///
/// # Errors
///
/// [`AlreadyInstalled`] from the second call on.
///
/// # Examples
///
/// Apps do not call it; the kernel's entry or `VirtualTime` does. See
/// [`Platform`] for a platform of one's own.
///
/// ```standalone_crate
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new(); // installs itself
/// assert_eq!(fass::now_ns(), 0);
/// ```
pub fn install(platform: &'static dyn Platform) -> Result<(), AlreadyInstalled> {
    if PLATFORM.set(platform) {
        Ok(())
    } else {
        Err(AlreadyInstalled)
    }
}

/// Returns the installed platform, if there is one.
#[inline]
pub(crate) fn installed() -> Option<&'static dyn Platform> {
    PLATFORM.get().copied()
}

#[inline]
pub(crate) fn expect_installed() -> &'static dyn Platform {
    match installed() {
        Some(platform) => platform,
        None => missing(),
    }
}

/// Gives a value to the platform. It looks for the platform itself: a function that is called for
/// that is, in a crate compiled for size, as long again.
pub(crate) fn record(value: &Recorded<'_>) {
    match PLATFORM.get() {
        Some(platform) => platform.record(value),
        None => missing(),
    }
}

#[cold]
fn missing() -> ! {
    panic!("no platform is installed; boot the kernel, or make a `virtual_time::VirtualTime`")
}
