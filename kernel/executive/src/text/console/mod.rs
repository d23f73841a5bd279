//! Text on the serial line, without disturbing what is being measured.
//!
//! What is printed is made into text by the context that prints it, outside every
//! lock (`Pieces`), and goes into a bounded buffer in pieces (`buffer`); the lock is
//! held for the copy of one piece. Outside a run it is sent at once. During a run it
//! stays in the buffer until an idle core sends it, byte by byte, so that no subtask
//! ever waits for a serial port; what no longer fits is dropped and counted, never
//! silently. A part of the buffer is left to the kernel's own machine lines, so that
//! an app that floods the port cannot hide a fault.
//!
//! Text and machine lines are told apart: only [`front::json`] can print a line
//! that begins with `{`.
//!
//! With `console=on` on the command line a person can talk to the kernel during a
//! run; that is `background`'s module `session`.

mod buffer;
mod emergency;

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use crate::machine::screen;
use crate::machine::serial;
use crate::machine::spinlock::SpinLock;
use buffer::Buffer;
pub use emergency::{write_in_emergency, write_line_in_emergency};
use front::console::{Kind, Pieces};

static BUFFER: SpinLock<Buffer<{ 16 * 1024 }>> = SpinLock::new(Buffer::new());

/// Whether text waits for idle cores.
static DEFERRED: AtomicBool = AtomicBool::new(false);
/// Whether the buffer holds anything, readable without the lock.
static PENDING: AtomicBool = AtomicBool::new(false);

/// Takes all text of an image; its entry names this to [`front::output!`].
#[inline(never)]
pub fn write_as(kind: Kind, text: fmt::Arguments<'_>) {
    let mut fits = true;
    let mut pieces = Pieces::new(kind, |piece, begins| {
        // What comes after a gap would only look like something else.
        fits = hand_over(piece, kind, begins, fits);
    });
    // Only a `Display` that fails of its own accord can fail here; its text up
    // to there is then all there is to show.
    let _ = pieces.write_fmt(text);
    pieces.end();
    if !DEFERRED.load(Ordering::Relaxed) {
        while send_pending_byte() {}
    }
}

/// Puts a piece into the buffer, or counts it as dropped: if it does not fit, or is not
/// `wanted`. Reports whether it is in the buffer.
fn hand_over(piece: &[u8], kind: Kind, begins: bool, wanted: bool) -> bool {
    loop {
        let mut buffer = BUFFER.lock();
        if wanted && buffer.take(piece, kind, begins) {
            PENDING.store(true, Ordering::Release);
            return true;
        }
        if !wanted || DEFERRED.load(Ordering::Relaxed) || buffer.is_empty() {
            buffer.dropped += piece.len() as u64;
            return false;
        }
        drop(buffer);
        send_pending_byte();
    }
}

/// Reports whether anything waits to be sent.
pub fn has_pending() -> bool {
    PENDING.load(Ordering::Acquire)
}

/// Sends one byte that waits, if any, or else draws one cell of the screen, and reports whether
/// there was one. It waits for the port, with interrupts and locks as they are.
#[inline(never)]
pub fn send_pending_byte() -> bool {
    if !has_pending() {
        return false;
    }
    let was_ready = serial::FIRST.wait_until_ready();
    let mut buffer = BUFFER.lock();
    if was_ready && !serial::FIRST.is_ready() {
        // Another core was faster. It is not waited for with the lock held.
        return true;
    }
    let byte = buffer.pop();
    if let Some(byte) = byte {
        serial::FIRST.write(byte);
        screen::put(byte);
    }
    let cell = if byte.is_none() {
        screen::take_cell()
    } else {
        None
    };
    PENDING.store(!buffer.is_empty() || screen::is_behind(), Ordering::Release);
    drop(buffer);
    if let Some(cell) = cell {
        screen::draw(cell);
        return true;
    }
    byte.is_some()
}

/// Sends bytes that wait for as long as the port takes them without a wait; not
/// more than a few lines.
pub fn send_what_goes_at_once() {
    const MOST_BYTES: usize = 512;
    for _ in 0..MOST_BYTES {
        if !serial::FIRST.is_ready() || !send_pending_byte() {
            break;
        }
    }
}

/// Leaves text to idle cores from now on.
pub fn defer() {
    DEFERRED.store(true, Ordering::Relaxed);
}

/// Sends text at once from now on, first what has waited, and returns how many
/// bytes were dropped meanwhile.
pub fn resume() -> u64 {
    DEFERRED.store(false, Ordering::Relaxed);
    while send_pending_byte() {}
    core::mem::take(&mut BUFFER.lock().dropped)
}

#[cfg(test)]
#[allow(unsafe_code, reason = "the symbol, for a program of tests")]
mod tests {
    front::output!(super::write_as);
}
