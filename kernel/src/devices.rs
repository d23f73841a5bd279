//! PCI devices, for drivers in an app's crate: `docs/driver.md` writes an example.
//!
//! These are functions of the kernel, and not of the app's [`Machine`](crate::Machine), because the
//! machine is the same on Linux, where an app reaches no device. Unless an app asks, no device is
//! mapped, and none of this code is in the image.
//!
//! ```no_run
//! use kernel::AppError;
//! use kernel::devices::{self, Registers};
//!
//! fn is_alive() -> Result<bool, AppError> {
//!     let edu = devices::find(0x1234, 0x11e8)?;
//!     edu.enable();
//!     let registers = Registers::of(&edu, 0).map_err(|why| devices::refusal(&edu, why))?;
//!     registers.write32(4, 0x1234_5678);
//!     Ok(registers.read32(4) == !0x1234_5678)
//! }
//! ```

use alloc::format;
use core::fmt::Display;

use executive::devices::{ecam, pci};
use front::app::ending::AppError;

#[doc(inline)]
pub use executive::devices::dma::DmaMemory;
#[doc(inline)]
pub use executive::devices::lines::{DeviceLine, Line, LineError, tie};
#[doc(inline)]
pub use executive::devices::pci::{Function, PciError, Place};
#[doc(inline)]
pub use executive::devices::registers::Registers;

/// Calls `each` with every PCI function of the machine.
///
/// # Errors
///
/// The machine has no PCI configuration space in memory.
///
/// ```no_run
/// # fn list() -> Result<(), kernel::AppError> {
/// kernel::devices::each(&mut |function| {
///     let (vendor, device) = function.id;
///     kernel::println!("{} {vendor:04x}:{device:04x}", function.place);
/// })
/// # }
/// ```
pub fn each(each: &mut dyn FnMut(Function<'static>)) -> Result<(), AppError> {
    let space = ecam::configuration().map_err(|why| AppError::Failure(format!("{why}")))?;
    pci::find(space, each);
    Ok(())
}

/// Finds the first PCI function with these numbers of vendor and device.
///
/// See the [example](self).
///
/// # Errors
///
/// There is no such function, or the machine has no PCI configuration space in memory.
pub fn find(vendor: u16, device: u16) -> Result<Function<'static>, AppError> {
    let mut found = None;
    each(&mut |function| {
        found = found.or(Some(function).filter(|function| function.id == (vendor, device)));
    })?;
    found.ok_or_else(|| {
        AppError::Failure(format!(
            "the machine has no PCI function {vendor:04x}:{device:04x}; add the device, in QEMU by \
             `--device NAME`"
        ))
    })
}

/// Makes an error that names a PCI function and the reason why an app cannot use it.
///
/// See the [example](self).
pub fn refusal(function: &Function<'_>, why: impl Display) -> AppError {
    AppError::Failure(format!("PCI function {} {why}", function.place))
}
