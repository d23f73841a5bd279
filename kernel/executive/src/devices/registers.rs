//! Registers of a device in memory, uncached.
//!
//! **Register invariant**: a [`Registers`] covers pages mapped as a device's for good, and no
//! memory; or memory of a fake device, which is its own for good.

use core::ops::Range;

use super::pci::{Function, PciError};
use crate::memory;

/// A range of registers. Each access stays within the range.
#[derive(Clone, Copy, Debug)]
pub struct Registers {
    start: u64,
    length: u64,
}

macro_rules! access {
    ($read:ident, $write:ident, $kind:ty) => {
        /// Reads a register.
        ///
        /// # Panics
        ///
        /// Panics if the register is outside the range, or not aligned.
        #[inline]
        #[track_caller]
        #[must_use]
        pub fn $read(&self, offset: u64) -> $kind {
            let address = self.address(offset, size_of::<$kind>() as u64) as *const $kind;
            // SAFETY: it is aligned and within mapped registers (register invariant).
            unsafe { address.read_volatile() }
        }

        /// Writes a register.
        ///
        /// # Panics
        ///
        /// Panics if the register is outside the range, or not aligned.
        #[inline]
        #[track_caller]
        pub fn $write(&self, offset: u64, value: $kind) {
            let address = self.address(offset, size_of::<$kind>() as u64) as *mut $kind;
            // SAFETY: it is aligned and within mapped registers (register invariant); what it has
            // the device do to memory is the promise of `Function::enable_reach`.
            unsafe { address.write_volatile(value) };
        }
    };
}

impl Registers {
    /// Maps a range of a function, before the function may [reach memory](Function::enable_reach):
    /// later, any holder of the registers could make the device write anywhere.
    ///
    /// # Errors
    ///
    /// [`PciError`].
    pub fn of(function: &Function<'_>, bar: u8) -> Result<Self, PciError> {
        match function.reaches() {
            true => Err(PciError::Driven),
            false => Self::in_bar(function, bar),
        }
    }

    /// Maps a range of a function, regardless of the function's reach.
    pub(super) fn in_bar(function: &Function<'_>, bar: u8) -> Result<Self, PciError> {
        Self::map(function.range(bar)?).ok_or(PciError::Taken(bar))
    }

    /// Makes registers from memory, for a fake device.
    #[doc(hidden)]
    pub fn over(memory: &'static mut [u64]) -> Self {
        Self {
            length: size_of_val(memory) as u64,
            start: memory.as_mut_ptr().expose_provenance() as u64,
        }
    }

    /// Maps a range, unless the place belongs to something else.
    pub(super) fn map(range: Range<u64>) -> Option<Self> {
        memory::map_registers(range.clone()).ok()?;
        Some(Self {
            start: range.start,
            length: range.end - range.start,
        })
    }

    /// Returns a part of the range, if within the range.
    pub fn part(&self, offset: u64, length: u64) -> Option<Self> {
        (offset.checked_add(length)? <= self.length).then_some(Self {
            start: self.start + offset,
            length,
        })
    }

    #[inline]
    #[track_caller]
    fn address(&self, offset: u64, size: u64) -> u64 {
        let is_within = offset < self.length && size <= self.length - offset;
        assert!(
            is_within && (self.start + offset).is_multiple_of(size),
            "a driver names a register beyond its device's"
        );
        self.start + offset
    }

    access!(read8, write8, u8);
    access!(read16, write16, u16);
    access!(read32, write32, u32);
    access!(read64, write64, u64);
}
