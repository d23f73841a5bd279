//! The I/O APICs, put to silence: no device is to interrupt a core.

/// Masks every line of the I/O APIC whose registers are at `base`. A firmware may have
/// left lines on, and their vectors mean nothing here.
///
/// # Safety
///
/// `base` is an I/O APIC's address, mapped uncached and writable, and nobody else uses it.
pub unsafe fn mask_all(base: u64) {
    /// Registers of the 82093AA (its data sheet, 3.2): which lines there are, and the first one.
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
