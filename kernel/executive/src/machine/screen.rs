//! Text on the screen left by the loader, if there is a screen.
//!
//! Output to the serial port is put here, too. Putting writes a byte into a table; drawing is
//! another step, a cell at a time, about as costly as a byte at the serial port, and is left to the
//! cores sending such bytes.

use core::sync::atomic::{AtomicBool, Ordering};

use boot::Framebuffer;
use boot::screen::{Grid, Screen};

use fass::platform::SetOnce;

static GRID: Grid = Grid::new();
static SCREEN: SetOnce<Screen> = SetOnce::new();
/// Whether a core is drawing.
static IS_DRAWING: AtomicBool = AtomicBool::new(false);

/// Blanks a screen, and from now on shows all text put.
///
/// # Safety
///
/// 1. Its memory is mapped as is, now and for good, and nobody else uses it.
/// 2. A row's pixels fit into the pitch.
#[inline(never)]
pub unsafe fn initialize(buffer: Framebuffer) {
    // SAFETY: conditions 1 and 2.
    let screen = unsafe { Screen::new(buffer) };
    screen.blank();
    if screen.columns > 0 && screen.rows > 0 {
        SCREEN.set(screen);
    }
}

/// Puts a byte of text into the table, if there is a screen.
#[inline(never)]
pub fn put(byte: u8) {
    if let Some(screen) = SCREEN.get() {
        GRID.put(byte, screen.columns, screen.rows);
    }
}

/// Reports whether any cell remains to be drawn.
pub fn is_behind() -> bool {
    GRID.has_open()
}

/// Takes a cell for [`draw`], unless another core draws.
#[inline(never)]
pub fn take_cell() -> Option<(usize, u8)> {
    // One core draws at a time: of two letters for a cell, the later one must stay.
    if IS_DRAWING.swap(true, Ordering::Acquire) {
        return None;
    }
    let cell = GRID.take_open();
    if cell.is_none() {
        IS_DRAWING.store(false, Ordering::Release);
    }
    cell
}

/// Draws a taken cell.
#[inline(never)]
pub fn draw((cell, letter): (usize, u8)) {
    if let Some(screen) = SCREEN.get() {
        screen.draw(cell, letter);
    }
    IS_DRAWING.store(false, Ordering::Release);
}

/// Draws all text put so far, as the only running core.
#[inline(never)]
pub fn draw_all() {
    while let Some(cell) = GRID.take_open() {
        draw(cell);
    }
}
