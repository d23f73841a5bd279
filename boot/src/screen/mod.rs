//! Text on the screen left by a loader: letters (`font`), their places (`grid`), and the drawing.
//!
//! A screen's memory is slow to write. Few and long stores cost less, since a processor may gather
//! stores: the kernel maps the screen accordingly. After each letter, the gathered stores are sent.
//!
//! Letters are white on black, so that the order of the colours does not matter. They are as large
//! as possible with a hundred in a row.

pub mod font;
mod grid;

use crate::Framebuffer;

pub use grid::Grid;
use grid::{MOST_COLUMNS, MOST_ROWS};

/// A screen, and the way letters fill it.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    buffer: Framebuffer,
    /// Whether each pixel is a word of 32 bits.
    has_words: bool,
    /// The number of screen pixels, across and down, for a pixel of a letter.
    scale: usize,
    /// The number of letters in a row.
    pub columns: usize,
    /// The number of rows.
    pub rows: usize,
}

/// A letter's cell with the gaps around the letter, in the letter's pixels.
const CELL_WIDTH: usize = font::WIDTH + 1;
const CELL_HEIGHT: usize = font::HEIGHT + 2;

impl Screen {
    /// Returns a screen divided into cells for letters.
    ///
    /// # Safety
    ///
    /// 1. Later drawing goes to memory that is mapped, and belongs to nobody else.
    /// 2. A row's pixels fit into the pitch.
    pub unsafe fn new(buffer: Framebuffer) -> Self {
        const WANTED_COLUMNS: usize = 100;
        let (width, height) = (buffer.width as usize, buffer.height as usize);
        let scale = (width / (WANTED_COLUMNS * CELL_WIDTH)).max(1);
        let is_word = |bytes: u64| bytes.is_multiple_of(4);
        Self {
            buffer,
            has_words: buffer.pixel_bytes == 4
                && is_word(buffer.start)
                && is_word(buffer.pitch.into()),
            scale,
            columns: (width / (scale * CELL_WIDTH)).min(MOST_COLUMNS),
            rows: (height / (scale * CELL_HEIGHT)).min(MOST_ROWS),
        }
    }

    /// Blanks the whole screen.
    pub fn blank(&self) {
        let all = self.buffer.range();
        for at in (all.start..all.end / 8 * 8).step_by(8) {
            // SAFETY: conditions 1 and 2 of `new`.
            unsafe { (at as *mut u64).write_volatile(0) };
        }
    }

    /// Draws a letter, 0 as a blank, in the cell of this number.
    pub fn draw(&self, cell: usize, letter: u8) {
        let (row, column) = (cell / self.columns, cell % self.columns);
        let left =
            self.buffer.start + (column * CELL_WIDTH * self.scale * self.pixel_bytes()) as u64;
        let first = row * CELL_HEIGHT * self.scale;
        for y in 0..CELL_HEIGHT * self.scale {
            // The upper gap is as high as a single pixel of the letter.
            let down = (y / self.scale).wrapping_sub(1);
            let mut at = left + (first + y) as u64 * u64::from(self.buffer.pitch);
            for across in 0..CELL_WIDTH {
                let is_letter = letter != 0 && across < font::WIDTH && down < font::HEIGHT;
                let is_lit = is_letter && font::is_lit(letter, across, down);
                for _ in 0..self.scale {
                    self.set(at, is_lit);
                    at += self.pixel_bytes() as u64;
                }
            }
        }
        // SAFETY: the fence only orders; every 64-bit processor has it.
        unsafe { core::arch::x86_64::_mm_sfence() };
    }

    const fn pixel_bytes(&self) -> usize {
        self.buffer.pixel_bytes as usize
    }

    /// Sets the pixel at an address, by a single store if the pixel is a word.
    fn set(&self, at: u64, is_lit: bool) {
        if self.has_words {
            let colour = if is_lit { u32::MAX } else { 0 };
            // SAFETY: the pixel lies on the screen (conditions 1 and 2 of `new`), at a word's
            // address.
            return unsafe { (at as *mut u32).write_volatile(colour) };
        }
        for byte in at..at + self.pixel_bytes() as u64 {
            // SAFETY: the pixel lies on the screen (conditions 1 and 2 of `new`).
            unsafe { (byte as *mut u8).write_volatile(if is_lit { u8::MAX } else { 0 }) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_letter_is_drawn_in_its_cell_whatever_a_pixel_takes() {
        const HEIGHT: usize = 2 * CELL_HEIGHT;
        for (pixel_bytes, pitch) in [(2, 26), (3, 39), (4, 52), (4, 54)] {
            let mut bytes = vec![0x55; pitch * HEIGHT];
            let buffer = Framebuffer {
                start: bytes.as_mut_ptr() as u64,
                pitch: u32::try_from(pitch).unwrap(),
                width: 12,
                height: 20,
                pixel_bytes,
            };
            // SAFETY: the bytes are the test's, as many as rows need, and those fit the pitch.
            let screen = unsafe { Screen::new(buffer) };
            assert_eq!((screen.columns, screen.rows), (2, 2));
            screen.draw(3, b'g');
            for (place, byte) in bytes.iter().enumerate() {
                let (x, y) = (place % pitch / usize::from(pixel_bytes), place / pitch);
                let expected = match (x.checked_sub(CELL_WIDTH), y.checked_sub(CELL_HEIGHT)) {
                    (Some(x @ 0..font::WIDTH), Some(y @ 1..=font::HEIGHT)) => {
                        u8::MAX * u8::from(font::is_lit(b'g', x, y - 1))
                    }
                    (Some(0..CELL_WIDTH), Some(_)) => 0,
                    _ => 0x55,
                };
                assert_eq!(*byte, expected, "{pixel_bytes} {pitch}: {x}, {y}");
            }
        }
    }
}
