//! The x86 I/O ports.

use core::arch::asm;

/// Writes a byte to a port.
///
/// # Safety
///
/// Writing `value` to `port` breaks no invariant: the device behind the port
/// is this caller's, or there is none.
pub(crate) unsafe fn write_u8(port: u16, value: u8) {
    // SAFETY: the caller vouches for the device.
    unsafe { asm!("out dx, al", in("dx") port, in("al") value, options(nomem, nostack)) };
}

/// Writes a 16-bit value to a port.
///
/// # Safety
///
/// As for [`write_u8`].
pub(crate) unsafe fn write_u16(port: u16, value: u16) {
    // SAFETY: the caller vouches for the device.
    unsafe { asm!("out dx, ax", in("dx") port, in("ax") value, options(nomem, nostack)) };
}

/// Writes a 32-bit value to a port.
///
/// # Safety
///
/// As for [`write_u8`].
pub(crate) unsafe fn write_u32(port: u16, value: u32) {
    // SAFETY: the caller vouches for the device.
    unsafe { asm!("out dx, eax", in("dx") port, in("eax") value, options(nomem, nostack)) };
}

/// Reads a byte from a port.
///
/// # Safety
///
/// As for [`write_u8`]; reading may change the device's state.
pub(crate) unsafe fn read_u8(port: u16) -> u8 {
    let value;
    // SAFETY: the caller vouches for the device.
    unsafe { asm!("in al, dx", in("dx") port, out("al") value, options(nomem, nostack)) };
    value
}

/// Reads a 16-bit value from a port.
///
/// # Safety
///
/// As for [`read_u8`].
pub(crate) unsafe fn read_u16(port: u16) -> u16 {
    let value;
    // SAFETY: the caller vouches for the device.
    unsafe { asm!("in ax, dx", in("dx") port, out("ax") value, options(nomem, nostack)) };
    value
}

/// Reads a 32-bit value from a port.
///
/// # Safety
///
/// As for [`read_u8`].
pub(crate) unsafe fn read_u32(port: u16) -> u32 {
    let value;
    // SAFETY: the caller vouches for the device.
    unsafe { asm!("in eax, dx", in("dx") port, out("eax") value, options(nomem, nostack)) };
    value
}
