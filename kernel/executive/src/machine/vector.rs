//! The interrupt vectors in use.

/// The local timer.
pub const TIMER: u8 = 0x40;
/// Another core has work for this one.
pub const WAKE: u8 = 0x41;
/// The code that this core runs asks for its own end, by an instruction.
pub const END: u8 = 0x42;
/// The local APIC withdrew an interrupt; needs no acknowledgement. The low four bits of its
/// number are ones, as early processors have no others (Intel SDM 3, 11.9).
pub const SPURIOUS: u8 = 0x4f;
/// Any interrupt of a higher number; nobody asked for one.
pub const OTHER: u8 = 0x50;
