//! The path of text to the platform's output.
//!
//! Text and machine lines are told apart: only [`json`](super::json) can print a line that begins
//! with `{`. Printed text goes to the platform's output function, which the program's entry names
//! by [`output!`](crate::output). The function is bound at link time: a pointer to it would cost
//! each image some bytes, and each line a lookup.
//!
//! # From a value's `Display` to the bytes handed over
//!
//! An app's `Display` may take long, print, or panic. Text is therefore formatted outside every
//! lock, in a buffer on the stack of the printing context, with interrupts left as they are. All
//! consequences stay with that context. A full buffer is handed over as a *piece*. Up to
//! [`LONGEST`] bytes form a single piece, and stay together.

use core::fmt;

#[allow(unsafe_code, reason = "one symbol, which another crate defines")]
mod bound {
    use core::fmt;

    use super::OutputKind;

    // SAFETY: `output!` alone defines the symbol, as a safe function of exactly this type; the
    // linker refuses a program with none or two.
    unsafe extern "Rust" {
        pub(super) safe fn front_output(kind: OutputKind, text: fmt::Arguments<'_>);
    }
}

/// Makes a function of the platform, `fn(OutputKind, fmt::Arguments<'_>)`, the destination of all
/// text of the program. Use exactly once in a program.
#[macro_export]
macro_rules! output {
    ($write:path) => {
        #[unsafe(no_mangle)]
        fn front_output(kind: $crate::console::OutputKind, text: ::core::fmt::Arguments<'_>) {
            $write(kind, text);
        }
    };
}

/// Writes text. The text of a single call stays together, up to 1 KiB. A line beginning with `{`
/// gets a blank in front. For [`print!`](crate::print).
pub fn write(text: fmt::Arguments<'_>) {
    bound::front_output(OutputKind::Text, text);
}

/// Writes a machine line and its line end, on a line of its own.
pub(super) fn write_line(kind: OutputKind, line: &dyn fmt::Display) {
    bound::front_output(kind, format_args!("{line}"));
}

/// Prints text: on the serial line of the machine, on the standard output of Linux.
///
/// The caller's context formats the text, so a `Display` that panics or takes long affects only the
/// caller.
#[macro_export]
macro_rules! print {
    ($($text:tt)*) => { $crate::console::write(::core::format_args!($($text)*)) };
}

/// Prints a line of text, as [`print!`](crate::print) does.
#[macro_export]
macro_rules! println {
    () => { $crate::print!("\n") };
    ($($text:tt)*) => { $crate::print!("{}\n", ::core::format_args!($($text)*)) };
}

#[cfg(test)]
#[allow(unsafe_code, reason = "the symbol, for a program of tests")]
mod output {
    crate::output!(forget);

    fn forget(_: super::OutputKind, _: core::fmt::Arguments<'_>) {}
}

/// The most bytes handed over at once.
pub const LONGEST: usize = 1024;

/// The kind of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// Text for people.
    Text,
    /// A machine line of an app.
    Line,
    /// A machine line of the kernel's own.
    KernelLine,
}

/// Collects text and hands it over in pieces. `hand_over` gets each piece, and a flag that marks
/// the first one.
pub struct TextPieces<F: FnMut(&[u8], bool)> {
    bytes: [u8; LONGEST],
    length: usize,
    kind: OutputKind,
    begins: bool,
    hand_over: F,
}

impl<F: FnMut(&[u8], bool)> TextPieces<F> {
    /// Begins a text, or a line.
    pub const fn new(kind: OutputKind, hand_over: F) -> Self {
        Self {
            bytes: [0; LONGEST],
            length: 0,
            kind,
            begins: true,
            hand_over,
        }
    }

    /// Ends the text, or the line.
    pub fn finish(mut self) {
        if self.kind != OutputKind::Text {
            self.push(b'\n');
        }
        self.flush();
    }

    /// Hands over the collected bytes.
    fn flush(&mut self) {
        if self.length > 0 {
            (self.hand_over)(&self.bytes[..self.length], self.begins);
            self.begins = false;
            self.length = 0;
        }
    }

    fn push(&mut self, byte: u8) {
        /// Room for a blank and the longest character: no piece ends within a character.
        const MARGIN: usize = 5;
        let begins_character = byte & 0xc0 != 0x80;
        if self.length + MARGIN > LONGEST && begins_character {
            self.flush();
        }
        self.bytes[self.length] = byte;
        self.length += 1;
    }
}

impl<F: FnMut(&[u8], bool)> fmt::Write for TextPieces<F> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            match (self.kind, byte) {
                // The platform does the same at the seam of two pieces.
                (OutputKind::Text, b'{') if self.bytes[..self.length].ends_with(b"\n") => {
                    self.push(b' ');
                }
                _ => {}
            }
            let is_end = self.kind != OutputKind::Text && byte == b'\n';
            // In JSON a line end is white space between two parts, nothing else.
            self.push(if is_end { b' ' } else { byte });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use core::fmt::Write;

    use super::*;

    fn pieces(kind: OutputKind, text: &str) -> Vec<String> {
        let mut all = Vec::new();
        let mut pieces = TextPieces::new(kind, |piece, _| {
            all.push(String::from_utf8(piece.to_vec()).expect("whole characters"));
        });
        pieces.write_str(text).expect("it cannot fail");
        pieces.finish();
        all
    }

    #[test]
    fn a_brace_after_a_line_end_gets_a_blank_in_text_alone() {
        assert_eq!(pieces(OutputKind::Text, "a{\n{b\n\n{"), ["a{\n {b\n\n {"]);
        assert_eq!(pieces(OutputKind::Line, "[1,\n{}]"), ["[1, {}]\n"]);
        assert_eq!(pieces(OutputKind::KernelLine, "\n{"), [" {\n"]);
    }

    #[test]
    fn long_text_is_cut_between_characters() {
        let text = "äöü€🦀".repeat(300);
        let all = pieces(OutputKind::Text, &text);
        assert!(all.len() > 1 && all.iter().all(|piece| piece.len() <= LONGEST));
        assert_eq!(all.concat(), text);
    }

    #[test]
    fn only_the_first_piece_begins() {
        let mut begun = Vec::new();
        let mut pieces = TextPieces::new(OutputKind::Text, |_: &[u8], begins| begun.push(begins));
        pieces.flush();
        write!(pieces, "{}", "x".repeat(3000)).expect("it cannot fail");
        pieces.finish();
        assert_eq!(begun, [true, false, false]);
    }
}
