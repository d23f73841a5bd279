//! Text that waits to be sent: a ring of bytes that takes whole pieces or none.
//!
//! What is cut in the middle is worse than what is missing: half a machine line
//! would make a run a failure. So a piece that does not fit is refused as a whole.
//!
//! Two promises are kept here, because only the ring knows what came before:
//!
//! - A *machine line* begins in column 0, even if a line was begun before it.
//! - *Text* never has a `{` in column 0; it gets a blank before it. So no text can be
//!   taken for a machine line.

use front::console::Kind;

/// How many bytes are kept from apps' output, for what the kernel itself has to say.
const RESERVE: usize = 4096;

/// A ring of `N` bytes.
pub(super) struct Buffer<const N: usize> {
    bytes: [u8; N],
    /// The place of the oldest byte.
    start: usize,
    length: usize,
    /// Whether the next byte stands behind another one of its line. (So said, an empty
    /// buffer is nothing but zeros, and takes no place in the image.)
    is_within_line: bool,
    /// How many bytes have been refused for good.
    pub(super) dropped: u64,
}

impl<const N: usize> Buffer<N> {
    pub(super) const fn new() -> Self {
        Self {
            bytes: [0; N],
            start: 0,
            length: 0,
            is_within_line: false,
            dropped: 0,
        }
    }

    /// Takes a piece, unless there is no room for all of it. `begins`: it is the first
    /// one of its text or line.
    pub(super) fn take(&mut self, piece: &[u8], kind: Kind, begins: bool) -> bool {
        let Some(last) = piece.last() else {
            return true;
        };
        let before: &[u8] = match kind {
            Kind::Text if !self.is_within_line && piece[0] == b'{' => b" ",
            Kind::Line | Kind::KernelLine if begins && self.is_within_line => b"\n",
            _ => b"",
        };
        let kept = if kind == Kind::KernelLine { 0 } else { RESERVE };
        if self.length + before.len() + piece.len() + kept > N {
            return false;
        }
        self.copy(before);
        self.copy(piece);
        self.is_within_line = *last != b'\n';
        true
    }

    /// Appends bytes, for which there is room.
    fn copy(&mut self, bytes: &[u8]) {
        let end = (self.start + self.length) % N;
        let (first, second) = bytes.split_at(bytes.len().min(N - end));
        self.bytes[end..end + first.len()].copy_from_slice(first);
        self.bytes[..second.len()].copy_from_slice(second);
        self.length += bytes.len();
    }

    /// Takes out the oldest byte.
    pub(super) fn pop(&mut self) -> Option<u8> {
        self.length = self.length.checked_sub(1)?;
        let byte = self.bytes[self.start];
        self.start = (self.start + 1) % N;
        Some(byte)
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.length == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = RESERVE + 16;

    /// Takes all of these and returns what is then to be sent.
    fn sent(pieces: &[(&str, Kind, bool)]) -> String {
        let mut buffer = Buffer::<SIZE>::new();
        for (text, kind, begins) in pieces {
            assert!(buffer.take(text.as_bytes(), *kind, *begins), "{text}");
        }
        emptied(&mut buffer)
    }

    fn emptied(buffer: &mut Buffer<SIZE>) -> String {
        let bytes: Vec<u8> = core::iter::from_fn(|| buffer.pop()).collect();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn no_text_looks_like_a_machine_line() {
        use Kind::{KernelLine, Line, Text};
        assert_eq!(sent(&[("{a\n", Text, true)]), " {a\n");
        assert_eq!(sent(&[("a", Text, true), ("{b\n", Text, true)]), "a{b\n");
        assert_eq!(
            sent(&[("a\n", Text, true), ("{", Text, false)]),
            "a\n {",
            "at the seam of two pieces"
        );
        assert_eq!(sent(&[("{}\n", Line, true)]), "{}\n");
        assert_eq!(
            sent(&[("a", Text, true), ("{}\n", KernelLine, true)]),
            "a\n{}\n",
            "a machine line begins in column 0"
        );
        assert_eq!(
            sent(&[("{\"a\":", Line, true), ("{}}\n", Line, false)]),
            "{\"a\":{}}\n",
            "the second piece of a line goes on in it"
        );
    }

    #[test]
    fn a_piece_that_does_not_fit_is_refused_as_a_whole() {
        let mut buffer = Buffer::<SIZE>::new();
        assert!(buffer.take(b"0123456789abcde\n", Kind::Text, true));
        assert!(!buffer.take(b"x", Kind::Text, true));
        assert!(!buffer.take(b"{}\n", Kind::Line, true));
        assert!(buffer.take(b"{}\n", Kind::KernelLine, true), "the reserve");
        assert_eq!(emptied(&mut buffer), "0123456789abcde\n{}\n");
        assert!(buffer.is_empty() && buffer.pop().is_none());
        assert!(!buffer.take(b"0123456789abcdefg", Kind::Text, true));
        assert!(
            buffer.take(b"{123456789abcde", Kind::Text, true),
            "and a blank"
        );
    }

    #[test]
    fn bytes_come_out_in_order_however_often_the_ring_goes_round() {
        let mut buffer = Buffer::<SIZE>::new();
        let (mut wanted, mut got) = (String::new(), String::new());
        for number in 0..2000 {
            let text = format!("{number};");
            wanted.push_str(&text);
            assert!(buffer.take(text.as_bytes(), Kind::Text, true));
            got.push_str(&emptied(&mut buffer));
        }
        assert_eq!(got, wanted);
    }
}
