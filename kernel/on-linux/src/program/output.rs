//! Text on the standard output.
//!
//! As on the machine, text is split into pieces, on the stack of the printing thread and outside
//! the lock. Printing therefore allocates nothing, and a value's `Display` affects only its own
//! thread. Text and machine lines are told apart: only `json` can print a line that begins with
//! `{`.

use std::fmt::{self, Write as _};
use std::io::{Write as _, stdout};
use std::sync::{Mutex, PoisonError};

use front::console::{OutputKind, TextPieces};

/// Whether the output is at the beginning of a line.
static BEGINS: Mutex<bool> = Mutex::new(true);

/// Takes all text of a program; the program's entry names this function to [`front::output!`].
pub fn write_as(kind: OutputKind, text: fmt::Arguments<'_>) {
    let mut pieces = TextPieces::new(kind, |piece, is_first| hand_over(piece, kind, is_first));
    // Only a `Display` that fails of its own accord can fail here.
    let _ = pieces.write_fmt(text);
    pieces.finish();
}

fn hand_over(piece: &[u8], kind: OutputKind, is_first: bool) {
    let mut begins = BEGINS.lock().unwrap_or_else(PoisonError::into_inner);
    let before: &[u8] = match (kind, *begins) {
        (OutputKind::Text, true) if piece.starts_with(b"{") => b" ",
        (OutputKind::Line | OutputKind::KernelLine, false) if is_first => b"\n",
        _ => b"",
    };
    *begins = piece.ends_with(b"\n");
    let mut out = stdout().lock();
    // If nobody reads any more, nobody misses the text.
    let written = out.write_all(before).and_then(|()| out.write_all(piece));
    let _ = written.and_then(|()| out.flush());
}
