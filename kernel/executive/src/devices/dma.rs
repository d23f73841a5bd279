//! Memory for a device to read and write.
//!
//! **DMA invariant**: a [`DmaMemory`] is whole pages of the heap, where addresses are physical
//! addresses; nothing else has these pages, and they are never given back, as a device cannot be
//! made to forget an address.

use core::alloc::Layout;

/// A device's page.
const PAGE: usize = 4096;

/// Memory read and written by a device, for good.
pub struct DmaMemory {
    start: u64,
    length: usize,
}

macro_rules! access {
    ($read:ident, $write:ident, $kind:ty) => {
        /// Reads a word that the device may write.
        ///
        /// # Panics
        ///
        /// Panics if the word is outside the memory, or not aligned.
        #[inline]
        #[must_use]
        pub fn $read(&self, offset: usize) -> $kind {
            let place = self.place(offset, size_of::<$kind>()) as *const $kind;
            // SAFETY: it is aligned and within (DMA invariant).
            unsafe { place.read_volatile() }
        }

        /// Writes a word that the device may read.
        ///
        /// # Panics
        ///
        /// Panics if the word is outside the memory, or not aligned.
        #[inline]
        pub fn $write(&mut self, offset: usize, value: $kind) {
            let place = self.place(offset, size_of::<$kind>()) as *mut $kind;
            // SAFETY: it is aligned and within (DMA invariant).
            unsafe { place.write_volatile(value) };
        }
    };
}

impl DmaMemory {
    /// Takes zeroed memory, rounded up to whole pages, before the commit. Returns `None` if no
    /// memory is left.
    pub fn new(length: usize) -> Option<Self> {
        let length = length.max(1).checked_next_multiple_of(PAGE)?;
        let layout = Layout::from_size_align(length, PAGE).ok()?;
        // SAFETY: the length is not 0.
        let start = unsafe { alloc::alloc::alloc_zeroed(layout) };
        (!start.is_null()).then_some(Self {
            start: start as u64,
            length,
        })
    }

    /// Returns the memory's address for the device.
    pub const fn address(&self) -> u64 {
        self.start
    }

    #[inline]
    #[track_caller]
    fn place(&self, offset: usize, size: usize) -> u64 {
        let is_within = offset < self.length && size <= self.length - offset;
        assert!(
            is_within && offset.is_multiple_of(size),
            "a driver names memory beyond its own"
        );
        self.start + offset as u64
    }

    access!(read16, write16, u16);
    access!(read32, write32, u32);
    access!(read64, write64, u64);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_has_whole_zeroed_pages_and_an_end() {
        let mut memory = DmaMemory::new(1).unwrap();
        assert!(memory.address().is_multiple_of(4096));
        assert_eq!(memory.read64(4088), 0);
        memory.write16(4094, 7);
        assert_eq!(memory.read32(4092), 7 << 16);
        for (offset, size) in [(4096, 1), (4094, 4), (2, 4), (usize::MAX, 8)] {
            let place = std::panic::catch_unwind(|| memory.place(offset, size));
            assert!(place.is_err(), "{offset}");
        }
        assert!(DmaMemory::new(usize::MAX).is_none());
    }
}
