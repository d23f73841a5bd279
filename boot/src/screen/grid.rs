//! The grid of the screen's cells, and the cells still to be drawn.
//!
//! Bytes are put into cells; a cell whose letter differs from the letter drawn there is *open*.
//! Putting a byte draws nothing. The grid is not for two cores at once. A core may still put bytes
//! after stopping another core in mid-step; this spoils a few cells and no more.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering::Relaxed};

/// The most columns and rows used.
pub(super) const MOST_COLUMNS: usize = 200;
pub(super) const MOST_ROWS: usize = 64;
const CELLS: usize = MOST_COLUMNS * MOST_ROWS;

/// Cells with letters; 0 is a blank cell, so an empty grid takes no place in the image.
pub struct Grid {
    wanted: [AtomicU8; CELLS],
    drawn: [AtomicU8; CELLS],
    row: AtomicUsize,
    column: AtomicUsize,
    /// Whether the line is a machine line, which gets a single row: its end is left out.
    is_cut: AtomicBool,
    /// No cell before `first`, and none from `end` on, is open.
    first: AtomicUsize,
    end: AtomicUsize,
}

impl Default for Grid {
    fn default() -> Self {
        Self::new()
    }
}

impl Grid {
    /// Creates a grid of blanks.
    pub const fn new() -> Self {
        Self {
            wanted: [const { AtomicU8::new(0) }; CELLS],
            drawn: [const { AtomicU8::new(0) }; CELLS],
            row: AtomicUsize::new(0),
            column: AtomicUsize::new(0),
            is_cut: AtomicBool::new(false),
            first: AtomicUsize::new(0),
            end: AtomicUsize::new(0),
        }
    }

    /// Puts a byte of text into a grid of this many columns and rows. For a character outside of
    /// ASCII, the first byte stands for all its bytes.
    pub fn put(&self, byte: u8, columns: usize, rows: usize) {
        let column = self.column.load(Relaxed);
        match byte {
            b'\n' => self.begin_line(columns, rows),
            b'\r' => self.column.store(0, Relaxed),
            b' '..=b'~' | 0xc0.. => {
                if column == 0 {
                    self.is_cut.store(byte == b'{', Relaxed);
                } else if column >= columns {
                    if self.is_cut.load(Relaxed) {
                        return;
                    }
                    self.begin_line(columns, rows);
                }
                let column = self.column.fetch_add(1, Relaxed);
                self.set(self.row.load(Relaxed) * columns + column, byte);
            }
            _ => {}
        }
    }

    /// Goes to the next row. On the last row, discards the upper half of the grid.
    fn begin_line(&self, columns: usize, rows: usize) {
        self.column.store(0, Relaxed);
        let row = self.row.load(Relaxed) + 1;
        self.row.store(row, Relaxed);
        if row < rows {
            return;
        }
        let gone = rows.div_ceil(2);
        self.row.store(rows - gone, Relaxed);
        for cell in 0..rows * columns {
            let from = self.wanted.get(cell + gone * columns);
            let is_left = cell < (rows - gone) * columns;
            let letter = from
                .filter(|_| is_left)
                .map_or(0, |from| from.load(Relaxed));
            self.set(cell, letter);
        }
    }

    fn set(&self, cell: usize, letter: u8) {
        let letter = if letter == b' ' { 0 } else { letter };
        if let Some(wanted) = self.wanted.get(cell) {
            wanted.store(letter, Relaxed);
            self.first.fetch_min(cell, Relaxed);
            self.end.fetch_max(cell + 1, Relaxed);
        }
    }

    /// Reports whether a cell may be open.
    pub fn has_open(&self) -> bool {
        self.first.load(Relaxed) < self.end.load(Relaxed)
    }

    /// Takes the next open cell, for the caller to draw: its number, and its letter.
    pub fn take_open(&self) -> Option<(usize, u8)> {
        let end = self.end.load(Relaxed).min(CELLS);
        let mut open = self.first.load(Relaxed)..end;
        let found = open.find_map(|cell| {
            let letter = self.wanted[cell].load(Relaxed);
            (self.drawn[cell].swap(letter, Relaxed) != letter).then_some((cell, letter))
        });
        self.first.store(open.start, Relaxed);
        if open.is_empty() {
            // No cell is open; the next cell that differs becomes both the first and the last.
            self.first.store(CELLS, Relaxed);
            self.end.store(0, Relaxed);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: usize = 4;
    const ROWS: usize = 3;

    /// Draws what is open and returns the rows.
    fn shown(grid: &Grid) -> Vec<String> {
        while grid.take_open().is_some() {}
        assert!(!grid.has_open());
        let cells = grid.drawn.iter().take(COLUMNS * ROWS);
        let letter = |cell: &AtomicU8| match cell.load(Relaxed) {
            0 => '.',
            letter @ 1..0x80 => char::from(letter),
            _ => '?',
        };
        let letters: Vec<char> = cells.map(letter).collect();
        letters
            .chunks(COLUMNS)
            .map(|row| row.iter().collect())
            .collect()
    }

    fn put(grid: &Grid, text: &str) {
        text.bytes().for_each(|byte| grid.put(byte, COLUMNS, ROWS));
    }

    #[test]
    fn text_goes_on_in_the_next_row_and_a_machine_line_does_not() {
        let grid = Grid::new();
        assert!(!grid.has_open());
        put(&grid, "abcdef\n{ghijk");
        assert_eq!(shown(&grid), ["abcd", "ef..", "{ghi"]);
        let other = Grid::new();
        put(&other, "a {b\n\u{b5}s\rx");
        assert_eq!(shown(&other), ["a.{b", "xs..", "...."]);
    }

    #[test]
    fn what_no_longer_fits_pushes_the_upper_half_out() {
        let grid = Grid::new();
        put(&grid, "1\n2\n3");
        assert_eq!(shown(&grid), ["1...", "2...", "3..."]);
        put(&grid, "\n");
        assert_eq!(shown(&grid), ["3...", "....", "...."]);
        put(&grid, "4\n5");
        assert_eq!(shown(&grid), ["3...", "4...", "5..."]);
    }

    #[test]
    fn only_what_differs_is_open() {
        let grid = Grid::new();
        put(&grid, "ab");
        assert_eq!(grid.take_open(), Some((0, b'a')));
        put(&grid, "\rab\rac");
        assert_eq!(grid.take_open(), Some((1, b'c')));
        assert_eq!(grid.take_open(), None);
    }
}
