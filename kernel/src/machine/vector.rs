//! The interrupt vectors in use.

/// The local timer.
pub(crate) const TIMER: u8 = 0x40;
/// Another core has work for this one.
pub(crate) const WAKE: u8 = 0x41;
/// The local APIC withdrew an interrupt; needs no acknowledgement.
pub(crate) const SPURIOUS: u8 = 0xff;
