//! The serial ports: 16550s at I/O ports 0x3f8 and 0x2f8, by polling.
//!
//! The first is for text, the second for an app's wire. Polling suffices, because text comes at
//! boot, at the end, on a panic, or during a run from an idle core byte by byte, or from core 0's
//! heartbeat; an interrupt for each byte would only disturb. Input at the first port comes from a
//! person, and core 0 looks for input now and then, idle or in its heartbeat. The heartbeat polls
//! the second port. The sender waits while the port's FIFO of 16 bytes is full, or bytes are lost.
//! Registers: National Semiconductor PC16550D data sheet, 8.0.

use core::sync::atomic::{AtomicBool, Ordering};

use super::port;

/// The most polls for one byte: several times the 1.4 ms of a full FIFO of 16 bytes.
const MOST_POLLS: u32 = 100_000;

/// A serial port.
pub struct SerialPort {
    base: u16,
    /// Whether the port exists, found out by [`SerialPort::initialize`].
    is_there: AtomicBool,
}

/// The port for text.
pub static FIRST: SerialPort = SerialPort::at(0x3f8);

/// The port for an app's wire.
pub static SECOND: SerialPort = SerialPort::at(0x2f8);

impl SerialPort {
    const fn at(base: u16) -> Self {
        Self {
            base,
            is_there: AtomicBool::new(false),
        }
    }

    /// Checks whether the port exists, and sets it to 115200 baud, 8 data bits, no parity, one stop
    /// bit.
    pub fn initialize(&self) {
        const SETUP: [(u16, u8); 7] = [
            (1, 0x00), // no interrupts
            (3, 0x80), // the next two set the divisor
            (0, 0x01), // 115200 baud
            (1, 0x00),
            (3, 0x03), // 8 data bits, no parity, one stop bit
            (2, 0xc7), // FIFOs on and cleared
            (4, 0x03), // ready to send
        ];
        // The scratch register, without effect on the port.
        let scratch = self.base + 7;
        let is_there = keeps_bytes(
            // SAFETY: the eight ports from `base` on are the serial port's, which is this module's.
            |value| unsafe { port::write_u8(scratch, value) },
            // SAFETY: likewise.
            || unsafe { port::read_u8(scratch) },
        );
        self.is_there.store(is_there, Ordering::Release);
        for (register, value) in SETUP {
            // SAFETY: the eight ports from `base` on are the serial port's, which is this module's.
            unsafe { port::write_u8(self.base + register, value) };
        }
    }

    /// Reports whether the port exists.
    pub fn is_there(&self) -> bool {
        self.is_there.load(Ordering::Relaxed)
    }

    /// Sends one byte, waiting until there is room.
    pub fn send(&self, byte: u8) {
        self.wait_until_ready();
        self.write(byte);
    }

    /// Waits until a byte can be sent, and reports whether there is room.
    ///
    /// The wait is bounded: a port never ready costs its bytes, not the kernel. Without a port
    /// nothing waits, and bytes go nowhere.
    pub fn wait_until_ready(&self) -> bool {
        for _ in 0..MOST_POLLS {
            if self.is_ready() {
                return true;
            }
            super::cpu::relax();
        }
        false
    }

    /// Waits until the last byte has left the port, at most as long as for sending a byte.
    pub fn drain(&self) {
        const ALL_SENT: u8 = 1 << 6;
        // SAFETY: reading the line status of this module's device.
        let is_idle = |_: &u32| unsafe { port::read_u8(self.base + 5) } & ALL_SENT != 0;
        let _ = (0..MOST_POLLS).find(is_idle);
    }

    /// Sends one byte; without room the byte is lost.
    pub fn write(&self, byte: u8) {
        // SAFETY: the data register of this module's device.
        unsafe { port::write_u8(self.base, byte) };
    }

    /// Reports whether a byte can be sent without a wait.
    pub fn is_ready(&self) -> bool {
        const TRANSMITTER_EMPTY: u8 = 1 << 5;
        // SAFETY: reading the line status of this module's device.
        let status = unsafe { port::read_u8(self.base + 5) };
        status & TRANSMITTER_EMPTY != 0 || !self.is_there()
    }

    /// Takes a received byte, if there is one.
    pub fn receive(&self) -> Option<u8> {
        const DATA_READY: u8 = 1 << 0;
        /// The value read from a port without a device.
        const ABSENT: u8 = 0xff;
        // SAFETY: reading the line status of this module's device.
        let status = unsafe { port::read_u8(self.base + 5) };
        if status & DATA_READY == 0 || status == ABSENT {
            return None;
        }
        // SAFETY: the data register of this module's device.
        Some(unsafe { port::read_u8(self.base) })
    }
}

/// Reports whether a register keeps the bytes written. No register does without a port: such a read
/// returns the same byte each time.
fn keeps_bytes(write: impl Fn(u8), read: impl Fn() -> u8) -> bool {
    let keeps = |byte: &u8| {
        write(*byte);
        read() == *byte
    };
    [0x5a, 0xa5].iter().all(keeps)
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
