//! The first serial port: a 16550 at I/O port 0x3f8, by polling.
//!
//! Polling, because output comes at boot, at the end, on a panic, or from an
//! idle core byte by byte; an interrupt for each byte would only disturb. Input
//! comes from a person, for whom an idle core looks now and then; the sender waits
//! while the port's FIFO of 16 bytes is full, or bytes are lost.
//! Registers: National Semiconductor PC16550D data sheet, 8.0.

use core::sync::atomic::{AtomicBool, Ordering};

use super::port;

const BASE: u16 = 0x3f8;

/// Several times the 1.4 ms that a full FIFO of 16 bytes takes.
const MOST_POLLS: u32 = 100_000;

/// Whether the port is there, which is found at [`initialize`].
static IS_THERE: AtomicBool = AtomicBool::new(false);

/// Looks whether there is a port, and sets it to 115200 baud, 8 data bits, no parity, one stop bit.
pub fn initialize() {
    const SETUP: [(u16, u8); 7] = [
        (1, 0x00), // no interrupts
        (3, 0x80), // the next two set the divisor
        (0, 0x01), // 115200 baud
        (1, 0x00),
        (3, 0x03), // 8 data bits, no parity, one stop bit
        (2, 0xc7), // FIFOs on and cleared
        (4, 0x03), // ready to send
    ];
    /// The register that means nothing to the port.
    const SCRATCH: u16 = BASE + 7;
    let is_there = keeps_bytes(
        // SAFETY: the ports from 0x3f8 are the serial port's, which is this module's.
        |value| unsafe { port::write_u8(SCRATCH, value) },
        // SAFETY: likewise.
        || unsafe { port::read_u8(SCRATCH) },
    );
    IS_THERE.store(is_there, Ordering::Release);
    for (register, value) in SETUP {
        // SAFETY: the ports from 0x3f8 are the serial port's, which is this module's.
        unsafe { port::write_u8(BASE + register, value) };
    }
}

/// Reports whether a register keeps what is written to it, as none does where there is no
/// port: that reads as the same byte each time.
fn keeps_bytes(write: impl Fn(u8), read: impl Fn() -> u8) -> bool {
    let keeps = |byte: &u8| {
        write(*byte);
        read() == *byte
    };
    [0x5a, 0xa5].iter().all(keeps)
}

/// Sends one byte, waiting until there is room for it.
pub fn send(byte: u8) {
    wait_until_ready();
    write(byte);
}

/// Waits until a byte can be sent, and reports whether it can.
///
/// The wait is bounded: a port that never gets ready costs its bytes, not the kernel. If
/// there is none nothing is waited for, and bytes go nowhere.
pub fn wait_until_ready() -> bool {
    for _ in 0..MOST_POLLS {
        if is_ready() {
            return true;
        }
        super::cpu::relax();
    }
    false
}

/// Waits until the last byte has left the port, at most as long as for one to be sent.
pub fn drain() {
    const ALL_SENT: u8 = 1 << 6;
    // SAFETY: reading the line status of this module's device.
    let is_idle = |_: &u32| unsafe { port::read_u8(BASE + 5) } & ALL_SENT != 0;
    let _ = (0..MOST_POLLS).find(is_idle);
}

/// Sends one byte; it is lost if there is no room for it.
pub fn write(byte: u8) {
    // SAFETY: the data register of this module's device.
    unsafe { port::write_u8(BASE, byte) };
}

/// Reports whether a byte can be sent without a wait.
pub fn is_ready() -> bool {
    const TRANSMITTER_EMPTY: u8 = 1 << 5;
    // SAFETY: reading the line status of this module's device.
    let status = unsafe { port::read_u8(BASE + 5) };
    status & TRANSMITTER_EMPTY != 0 || !IS_THERE.load(Ordering::Relaxed)
}

/// Takes a byte that has been received, if there is one.
pub fn receive() -> Option<u8> {
    const DATA_READY: u8 = 1 << 0;
    /// What a port reads as that does not exist.
    const ABSENT: u8 = 0xff;
    // SAFETY: reading the line status of this module's device.
    let status = unsafe { port::read_u8(BASE + 5) };
    if status & DATA_READY == 0 || status == ABSENT {
        return None;
    }
    // SAFETY: the data register of this module's device.
    Some(unsafe { port::read_u8(BASE) })
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::keeps_bytes;

    #[test]
    fn only_a_register_is_taken_for_a_port() {
        let register = Cell::new(0);
        assert!(keeps_bytes(|byte| register.set(byte), || register.get()));
        for absent in 0..=u8::MAX {
            assert!(!keeps_bytes(|_| (), || absent), "{absent:#x}");
        }
    }
}
