//! The last words of a kernel that cannot go on, straight to the port.
//!
//! To be used only when all other cores are stopped: one of them, or the caller
//! itself, may hold the buffer's lock and never release it. Nothing said here has a lock, and all
//! of it is bounded: a message of megabytes is cut off.

use core::fmt::{self, Display, Write};

use front::console::{Kind, Pieces};

use super::BUFFER;
use crate::machine::{screen, serial};

/// The most bytes of one text.
const MOST_BYTES: usize = 8 * 1024;

/// Writes text, which begins a line.
pub fn write_in_emergency(text: fmt::Arguments<'_>) {
    send(Kind::Text, text);
}

/// Writes a machine line, and its end.
pub fn write_line_in_emergency(line: &dyn Display) {
    send(Kind::KernelLine, format_args!("{line}"));
}

fn send(kind: Kind, text: fmt::Arguments<'_>) {
    if let Some(mut buffer) = BUFFER.try_lock() {
        core::iter::from_fn(|| buffer.pop()).for_each(send_byte);
    }
    let mut pieces = Pieces::new(kind, |piece: &[u8], begins| {
        let before = kind == Kind::Text && begins && piece[0] == b'{';
        let before: &[u8] = if before { b" " } else { b"" };
        before.iter().chain(piece).copied().for_each(send_byte);
    });
    // It fails where it is cut off.
    let _ = AtMost(&mut pieces, MOST_BYTES).write_fmt(text);
    pieces.end();
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
