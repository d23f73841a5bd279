//! Text on the screen that a loader has left: letters (`font`), where they stand (`grid`), and
//! how they are drawn.
//!
//! Letters are white on black, so that the order of the colours does not matter, and as large
//! as a hundred fit into a row.

pub mod font;
mod grid;

use crate::Framebuffer;

pub use grid::Grid;
use grid::{MOST_COLUMNS, MOST_ROWS};

/// A screen, and how letters fill it.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    buffer: Framebuffer,
    /// How many pixels, across and down, a pixel of a letter has.
    scale: usize,
    /// How many letters a row has.
    pub columns: usize,
    /// How many rows there are.
    pub rows: usize,
}

/// A letter's place with the gaps around it, in its own pixels.
const CELL_WIDTH: usize = font::WIDTH + 1;
const CELL_HEIGHT: usize = font::HEIGHT + 2;

impl Screen {
    /// Returns how letters fill a screen.
    ///
    /// # Safety
    ///
    /// 1. What is drawn later goes to memory that is mapped, and nobody else's.
    /// 2. A row's pixels fit into the pitch.
    #[must_use]
    pub unsafe fn new(buffer: Framebuffer) -> Self {
        const WANTED_COLUMNS: usize = 100;
        let (width, height) = (buffer.width as usize, buffer.height as usize);
        let scale = (width / (WANTED_COLUMNS * CELL_WIDTH)).max(1);
        Self {
            buffer,
            scale,
            columns: (width / (scale * CELL_WIDTH)).min(MOST_COLUMNS),
            rows: (height / (scale * CELL_HEIGHT)).min(MOST_ROWS),
        }
    }

    /// Blanks all of it.
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
        for y in 0..CELL_HEIGHT * self.scale {
            for x in 0..CELL_WIDTH * self.scale {
                // The upper gap is one pixel of the letter's.
                let (across, down) = (x / self.scale, (y / self.scale).wrapping_sub(1));
                let is_letter = letter != 0 && across < font::WIDTH && down < font::HEIGHT;
                let is_lit = is_letter && font::is_lit(letter, across, down);
                let x = column * CELL_WIDTH * self.scale + x;
                let y = row * CELL_HEIGHT * self.scale + y;
                self.set(x, y, is_lit);
            }
        }
    }

    fn set(&self, x: usize, y: usize, is_lit: bool) {
        let Framebuffer {
            start,
            pitch,
            pixel_bytes,
            ..
        } = self.buffer;
        let at = start + y as u64 * u64::from(pitch) + x as u64 * u64::from(pixel_bytes);
        for byte in at..at + u64::from(pixel_bytes) {
            // SAFETY: the pixel lies on the screen (conditions 1 and 2 of `new`).
            unsafe { (byte as *mut u8).write_volatile(if is_lit { u8::MAX } else { 0 }) };
        }
    }
}
