//! Text on the serial line, without disturbing measurements.
//!
//! The printing context formats the text outside every lock (`TextPieces`), and copies it in pieces
//! into a bounded buffer (`OutputRing`); the lock is held for the copy of one piece. Outside a run
//! the text is sent at once. During a run the text stays in the buffer until an idle core sends it,
//! byte by byte, so that no subtask ever waits for a serial port; excess text is dropped and
//! counted, never silently. A part of the buffer is reserved for the kernel's own machine lines, so
//! that an app flooding the port cannot hide a fault.
//!
//! Text and machine lines are distinct: only [`front::json`] can print a line beginning with `{`.
//!
//! With `console=on` on the command line a person can talk to the kernel during a run, through the
//! shell of `front`.
//!
//! # The last words of a dying kernel, straight to the port
//!
//! To be used only when all other cores are stopped: one of them, or the caller itself, may hold
//! the buffer's lock and never release the lock. No function for last words waits for a lock, and
//! all are bounded: a message of megabytes is cut off.
//!
//! # Text waiting to be sent: a ring of bytes that takes whole pieces or none
//!
//! A line cut in the middle is worse than a missing line: half a machine line would make a run a
//! failure. The ring therefore refuses a piece as a whole if the piece does not fit.
//!
//! The ring keeps two promises, because only the ring knows the preceding byte:
//!
//! - A *machine line* begins in column 0, even after an unfinished line.
//! - *Text* never has a `{` in column 0; the ring puts a blank before the brace. No text can
//!   therefore be taken for a machine line.

use core::fmt::{self, Display, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use front::console::{OutputKind, TextPieces};

use crate::machine::spinlock::SpinLock;
use crate::machine::{screen, serial, time_slice};

static BUFFER: SpinLock<OutputRing<{ 16 * 1024 }>> = SpinLock::new(OutputRing::new());

/// Whether text is left to idle cores.
static DEFERRED: AtomicBool = AtomicBool::new(false);
/// Whether the buffer holds anything, readable without the lock.
static PENDING: AtomicBool = AtomicBool::new(false);

/// Takes all text of an image; the image's entry names this function to [`front::output!`].
#[inline(never)]
pub fn write_as(kind: OutputKind, text: fmt::Arguments<'_>) {
    let mut fits = true;
    let mut pieces = TextPieces::new(kind, |piece, begins| {
        // Text after a gap would only look like something else.
        fits = hand_over(piece, kind, begins, fits);
    });
    // Only a `Display` that fails of its own accord can fail here; its text up to there is then all
    // there is to show.
    let _ = pieces.write_fmt(text);
    pieces.finish();
    if !DEFERRED.load(Ordering::Relaxed) {
        while send_pending_byte() {}
    }
}

/// Puts a piece into the buffer, or counts the piece as dropped if it does not fit or is not
/// `wanted`. Reports whether the piece is in the buffer.
fn hand_over(piece: &[u8], kind: OutputKind, begins: bool, wanted: bool) -> bool {
    time_slice::look_up();
    loop {
        let mut buffer = BUFFER.lock();
        if wanted && buffer.append(piece, kind, begins) {
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

/// Reports whether any text waits to be sent.
pub fn has_pending() -> bool {
    PENDING.load(Ordering::Acquire)
}

/// Sends one waiting byte, if any, or else draws one cell of the screen, and reports whether there
/// was either. Waits for the port, with interrupts and locks left as they are.
#[inline(never)]
pub fn send_pending_byte() -> bool {
    if !has_pending() {
        return false;
    }
    time_slice::look_up();
    let was_ready = serial::FIRST.wait_until_ready();
    let mut buffer = BUFFER.lock();
    if was_ready && !serial::FIRST.is_ready() {
        // Another core was faster. Waiting for that core with the lock held would keep interrupts
        // off.
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
    // Drawn without the lock, since a cell takes about as long as a byte at the port.
    if let Some(cell) = cell {
        screen::draw(cell);
        return true;
    }
    byte.is_some()
}

/// Sends waiting bytes for as long as the port takes them without a wait; at most a few lines.
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

/// Sends text at once from now on, starting with the waiting text, and returns how many bytes were
/// dropped meanwhile.
pub fn resume() -> u64 {
    DEFERRED.store(false, Ordering::Relaxed);
    while send_pending_byte() {}
    core::mem::take(&mut BUFFER.lock().dropped)
}

#[cfg(test)]
#[allow(unsafe_code, reason = "the symbol, for a program of tests")]
mod output {
    front::output!(super::write_as);
}

/// The most bytes of one text.
const MOST_BYTES: usize = 8 * 1024;

/// Writes text at the beginning of a line.
pub fn write_in_emergency(text: fmt::Arguments<'_>) {
    send(OutputKind::Text, text);
}

/// Writes a machine line, and its end.
pub fn write_line_in_emergency(line: &dyn Display) {
    send(OutputKind::KernelLine, format_args!("{line}"));
}

fn send(kind: OutputKind, text: fmt::Arguments<'_>) {
    // Only tried: a stopped core may hold this lock for good.
    if let Some(mut buffer) = BUFFER.try_lock() {
        core::iter::from_fn(|| buffer.pop()).for_each(send_byte);
    }
    let mut pieces = TextPieces::new(kind, |piece: &[u8], begins| {
        let before = kind == OutputKind::Text && begins && piece[0] == b'{';
        let before: &[u8] = if before { b" " } else { b"" };
        before.iter().chain(piece).copied().for_each(send_byte);
    });
    // Fails where the text is cut off.
    let _ = AtMost(&mut pieces, MOST_BYTES).write_fmt(text);
    pieces.finish();
    screen::draw_all();
}

#[inline(never)]
fn send_byte(byte: u8) {
    serial::FIRST.send(byte);
    screen::put(byte);
}

/// Passes on a number of bytes, and then fails.
struct AtMost<W>(W, usize);

impl<W: Write> Write for AtMost<W> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let length = text.floor_char_boundary(self.1);
        self.1 -= length;
        self.0.write_str(&text[..length])?;
        if length < text.len() {
            self.0.write_str(" ...\n")?;
            return Err(fmt::Error);
        }
        Ok(())
    }
}

/// How many bytes are reserved for the kernel's own output, out of reach of apps.
const RESERVE: usize = 4096;

/// A ring of `N` bytes.
struct OutputRing<const N: usize> {
    bytes: [u8; N],
    /// The place of the oldest byte.
    start: usize,
    length: usize,
    /// Whether the next byte follows another byte of its line. (In this form an empty buffer is all
    /// zeros, and takes no place in the image.)
    is_within_line: bool,
    /// The number of bytes refused for good.
    dropped: u64,
}

impl<const N: usize> OutputRing<N> {
    const fn new() -> Self {
        Self {
            bytes: [0; N],
            start: 0,
            length: 0,
            is_within_line: false,
            dropped: 0,
        }
    }

    /// Takes a piece, if there is room for all of it. `begins` marks the first piece of a text or
    /// line.
    fn append(&mut self, piece: &[u8], kind: OutputKind, begins: bool) -> bool {
        let Some(last) = piece.last() else {
            return true;
        };
        let before: &[u8] = match kind {
            OutputKind::Text if !self.is_within_line && piece[0] == b'{' => b" ",
            OutputKind::Line | OutputKind::KernelLine if begins && self.is_within_line => b"\n",
            _ => b"",
        };
        let kept = if kind == OutputKind::KernelLine {
            0
        } else {
            RESERVE
        };
        if self.length + before.len() + piece.len() + kept > N {
            return false;
        }
        self.copy(before);
        self.copy(piece);
        self.is_within_line = *last != b'\n';
        true
    }

    /// Appends bytes; the caller has checked the room.
    fn copy(&mut self, bytes: &[u8]) {
        let end = (self.start + self.length) % N;
        let (first, second) = bytes.split_at(bytes.len().min(N - end));
        self.bytes[end..end + first.len()].copy_from_slice(first);
        self.bytes[..second.len()].copy_from_slice(second);
        self.length += bytes.len();
    }

    /// Takes out the oldest byte.
    fn pop(&mut self) -> Option<u8> {
        self.length = self.length.checked_sub(1)?;
        let byte = self.bytes[self.start];
        self.start = (self.start + 1) % N;
        Some(byte)
    }

    const fn is_empty(&self) -> bool {
        self.length == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = RESERVE + 16;

    /// Takes all of these and returns what is then to be sent.
    fn sent(pieces: &[(&str, OutputKind, bool)]) -> String {
        let mut buffer = OutputRing::<SIZE>::new();
        for (text, kind, begins) in pieces {
            assert!(buffer.append(text.as_bytes(), *kind, *begins), "{text}");
        }
        emptied(&mut buffer)
    }

    fn emptied(buffer: &mut OutputRing<SIZE>) -> String {
        let bytes: Vec<u8> = core::iter::from_fn(|| buffer.pop()).collect();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn no_text_looks_like_a_machine_line() {
        use OutputKind::{KernelLine, Line, Text};
        assert_eq!(sent(&[("{a\n", Text, true)]), " {a\n");
        assert_eq!(sent(&[("a", Text, true), ("{b\n", Text, true)]), "a{b\n");
        // At the seam of two pieces.
        assert_eq!(sent(&[("a\n", Text, true), ("{", Text, false)]), "a\n {");
        assert_eq!(sent(&[("{}\n", Line, true)]), "{}\n");
        // A machine line begins in column 0.
        assert_eq!(
            sent(&[("a", Text, true), ("{}\n", KernelLine, true)]),
            "a\n{}\n"
        );
        // The second piece of a line goes on in it.
        assert_eq!(
            sent(&[("{\"a\":", Line, true), ("{}}\n", Line, false)]),
            "{\"a\":{}}\n"
        );
    }

    #[test]
    fn a_piece_that_does_not_fit_is_refused_as_a_whole() {
        let mut buffer = OutputRing::<SIZE>::new();
        assert!(buffer.append(b"0123456789abcde\n", OutputKind::Text, true));
        assert!(!buffer.append(b"x", OutputKind::Text, true));
        assert!(!buffer.append(b"{}\n", OutputKind::Line, true));
        // The reserve.
        assert!(buffer.append(b"{}\n", OutputKind::KernelLine, true));
        assert_eq!(emptied(&mut buffer), "0123456789abcde\n{}\n");
        assert!(buffer.is_empty() && buffer.pop().is_none());
        assert!(!buffer.append(b"0123456789abcdefg", OutputKind::Text, true));
        // And a blank.
        assert!(buffer.append(b"{123456789abcde", OutputKind::Text, true));
    }

    #[test]
    fn bytes_come_out_in_order_however_often_the_ring_goes_round() {
        let mut buffer = OutputRing::<SIZE>::new();
        let (mut wanted, mut got) = (String::new(), String::new());
        for number in 0..2000 {
            let text = format!("{number};");
            wanted.push_str(&text);
            assert!(buffer.append(text.as_bytes(), OutputKind::Text, true));
            got.push_str(&emptied(&mut buffer));
        }
        assert_eq!(got, wanted);
    }
}
