//! QEMU's debug port, which takes bytes for the host: a way out besides the console's.
//!
//! It takes a byte at any time, so there is nothing to wait for.

use super::port;

const PORT: u16 = 0x402;

/// Reports whether there is one: QEMU's reads as this byte.
pub(crate) fn is_there() -> bool {
    // SAFETY: the port is that of QEMU's isa-debugcon device or of nobody.
    unsafe { port::read_u8(PORT) == 0xe9 }
}

/// Sends bytes.
pub(crate) fn send(bytes: &[u8]) {
    for byte in bytes {
        // SAFETY: `edge` asks `is_there` first, so the port is QEMU's, and this module's.
        unsafe { port::write_u8(PORT, *byte) };
    }
}
