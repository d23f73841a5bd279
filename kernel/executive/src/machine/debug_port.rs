//! QEMU's debug port, which sends bytes to the host: a way out besides the console.
//!
//! The port takes a byte at any time, so there is nothing to wait for.

use super::port;

const PORT: u16 = 0x402;

/// Reports whether the port exists: QEMU's port reads as this byte.
pub(crate) fn is_there() -> bool {
    // SAFETY: the port is that of QEMU's isa-debugcon device or of nobody.
    unsafe { port::read_u8(PORT) == 0xe9 }
}

/// Sends bytes.
pub(crate) fn send(bytes: &[u8]) {
    for byte in bytes {
        // SAFETY: `record` asks `is_there` first, so the port is QEMU's, and this module's.
        unsafe { port::write_u8(PORT, *byte) };
    }
}
