//! Text on the serial line, without disturbing what is being measured.
//!
//! Text goes through a bounded buffer. Outside a run it is sent at once. During
//! a run it stays in the buffer until an idle core sends it, byte by byte, so
//! that no subtask ever waits for a serial port; what no longer fits is dropped
//! and counted, never silently.
//!
//! With `console=on` on the command line a person can talk to the kernel during a
//! run; that is the module `session`.

mod command;
mod input;
pub(crate) mod session;

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use crate::machine::serial;
use crate::machine::spinlock::SpinLock;

const CAPACITY: usize = 16 * 1024;

/// Bytes that wait to be sent, the oldest at `start`.
struct Buffer {
    bytes: [u8; CAPACITY],
    start: usize,
    length: usize,
    dropped: u64,
}

static BUFFER: SpinLock<Buffer> = SpinLock::new(Buffer {
    bytes: [0; CAPACITY],
    start: 0,
    length: 0,
    dropped: 0,
});

/// Whether text waits for idle cores.
static DEFERRED: AtomicBool = AtomicBool::new(false);
/// Whether the buffer holds anything, readable without the lock.
static PENDING: AtomicBool = AtomicBool::new(false);

impl Buffer {
    fn push(&mut self, byte: u8) {
        if self.length == CAPACITY {
            if DEFERRED.load(Ordering::Relaxed) {
                self.dropped += 1;
                return;
            }
            self.send_one();
        }
        self.bytes[(self.start + self.length) % CAPACITY] = byte;
        self.length += 1;
    }

    fn send_one(&mut self) {
        if self.length > 0 {
            serial::send(self.bytes[self.start]);
            self.start = (self.start + 1) % CAPACITY;
            self.length -= 1;
        }
    }
}

impl Write for Buffer {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.bytes().for_each(|byte| self.push(byte));
        Ok(())
    }
}

/// Writes text; what one call writes stays together. For [`print!`](crate::print).
///
/// ```no_run
/// kernel::println!("{} jobs", 3); // calls it
/// ```
pub fn write(text: fmt::Arguments<'_>) {
    let mut buffer = BUFFER.lock();
    // Only a `Display` that fails of its own accord can fail here; its text up
    // to there is then all there is to show.
    let _ = buffer.write_fmt(text);
    PENDING.store(buffer.length > 0, Ordering::Release);
    drop(buffer);
    if !DEFERRED.load(Ordering::Relaxed) {
        while send_pending_byte() {}
    }
}

/// Reports whether anything waits to be sent.
pub(crate) fn has_pending() -> bool {
    PENDING.load(Ordering::Acquire)
}

/// Sends one byte that waits, if any, and reports whether it did.
pub(crate) fn send_pending_byte() -> bool {
    if !has_pending() {
        return false;
    }
    let mut buffer = BUFFER.lock();
    let any = buffer.length > 0;
    buffer.send_one();
    PENDING.store(buffer.length > 0, Ordering::Release);
    any
}

/// Sends bytes that wait for as long as the port takes them without a wait; not
/// more than a few lines.
pub(crate) fn send_what_goes_at_once() {
    const MOST_BYTES: usize = 512;
    for _ in 0..MOST_BYTES {
        if !serial::is_ready() || !send_pending_byte() {
            break;
        }
    }
}

/// Leaves text to idle cores from now on.
pub(crate) fn defer() {
    DEFERRED.store(true, Ordering::Relaxed);
}

/// Sends text at once from now on, first what has waited, and returns how many
/// bytes were dropped meanwhile.
pub(crate) fn resume() -> u64 {
    DEFERRED.store(false, Ordering::Relaxed);
    while send_pending_byte() {}
    core::mem::take(&mut BUFFER.lock().dropped)
}

/// Writes straight to the port when nothing else may be relied on.
///
/// To be used only when all other cores are stopped: one of them, or the caller
/// itself, may hold the buffer's lock forever.
pub(crate) fn write_in_emergency(text: fmt::Arguments<'_>) {
    struct Port;
    impl Write for Port {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            text.bytes().for_each(serial::send);
            Ok(())
        }
    }
    if let Some(mut buffer) = BUFFER.try_lock() {
        while buffer.length > 0 {
            buffer.send_one();
        }
    }
    let _ = Port.write_fmt(text);
}

/// Prints text on the serial line.
#[macro_export]
macro_rules! print {
    ($($text:tt)*) => { $crate::console::write(format_args!($($text)*)) };
}

/// Prints a line of text on the serial line.
#[macro_export]
macro_rules! println {
    () => { $crate::print!("\n") };
    ($($text:tt)*) => { $crate::console::write(format_args!("{}\n", format_args!($($text)*))) };
}
