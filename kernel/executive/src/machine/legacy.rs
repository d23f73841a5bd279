//! Silences the interrupt controllers of a PC that interrupt no core here: the 8259s of the first
//! PCs, and the I/O APICs.

use super::port;

/// Masks every line of the two 8259s, after moving their vectors away from the exceptions' vectors:
/// a spurious interrupt can come even from a masked controller.
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

/// Masks every line of the I/O APIC whose registers are at `base`. A firmware may have left lines
/// on, with vectors of no meaning here.
///
/// # Safety
///
/// `base` is an I/O APIC's address, mapped uncached and writable, and nobody else uses it.
pub unsafe fn mask_io_apic(base: u64) {
    /// Registers of the 82093AA (its data sheet, 3.2): the number of lines, and the first line.
    const VERSION: u32 = 1;
    const FIRST_LINE: u32 = 0x10;
    const MASKED: u32 = 1 << 16;
    let select = base as *mut u32;
    let data = (base + 0x10) as *mut u32;
    // SAFETY: the caller vouches for the registers; here and below.
    let choose = |register: u32| unsafe { select.write_volatile(register) };
    choose(VERSION);
    // SAFETY: as above.
    let last = unsafe { data.read_volatile() } >> 16 & 0xff;
    for line in 0..=last {
        choose(FIRST_LINE + 2 * line);
        // SAFETY: as above.
        let entry = unsafe { data.read_volatile() };
        // SAFETY: as above.
        unsafe { data.write_volatile(entry | MASKED) };
    }
}
