//! The interrupt vectors in use, one after the other.

/// The local timer.
pub const TIMER: u8 = 0x4c;
/// Another core has work for this core.
pub const WAKE: u8 = 0x4d;
/// The code running on this core asks for its own end, by an instruction.
pub const END: u8 = 0x4e;
/// The local APIC withdrew an interrupt; needs no acknowledgement. The low four bits of the number
/// are ones, as early processors allow no others (Intel SDM 3, 11.9).
pub const SPURIOUS: u8 = 0x4f;
/// The first of the devices' lines.
pub const DEVICE: u8 = 0x50;
/// The number of lines.
pub const DEVICES: u8 = 8;
/// Any other interrupt, requested by nobody.
pub const OTHER: u8 = DEVICE + DEVICES;
