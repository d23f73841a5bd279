//! The interrupt controllers of the first PCs, put to silence.

use super::port;

/// Masks every line of the two 8259s, after moving their vectors away from the
/// exceptions': a spurious interrupt can come even from a masked controller.
pub fn silence_interrupt_controllers() {
    /// Initialisation words (Intel 8259A data sheet): start, vector base,
    /// wiring, mode; then the mask.
    const FIRST: [(u16, u8); 5] = [
        (0x20, 0x11),
        (0x21, 0x20),
        (0x21, 4),
        (0x21, 1),
        (0x21, 0xff),
    ];
    const SECOND: [(u16, u8); 5] = [
        (0xa0, 0x11),
        (0xa1, 0x28),
        (0xa1, 2),
        (0xa1, 1),
        (0xa1, 0xff),
    ];
    for (register, value) in FIRST.into_iter().chain(SECOND) {
        // SAFETY: the ports are the 8259s', which nothing else here uses; on a
        // machine without them the writes go nowhere.
        unsafe { port::write_u8(register, value) };
    }
}
