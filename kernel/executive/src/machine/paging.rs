//! The page table: one for all cores, identity-mapped, with no page both writable and executable,
//! and page 0 absent.
//!
//! Entries only ever change from absent to present, so no core can hold an outdated translation and
//! no core needs news of a change.

use core::ops::Range;

/// The smallest page, in bytes.
pub(crate) const PAGE: u64 = 4096;

/// The access allowed by a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PageAccess {
    /// Read only.
    Constant,
    /// Read and write.
    Data,
    /// Read and execute.
    Code,
    /// Read and write, uncached: a device's registers.
    Device,
    /// Read and write, uncached, where stores may be gathered: a screen.
    Screen,
}

impl PageAccess {
    const fn bits(self) -> u64 {
        const WRITABLE: u64 = 1 << 1;
        const UNCACHED: u64 = 1 << 3 | 1 << 4;
        /// Entry 1 of the page attributes, as `entry.s` of `boot-entry` sets it.
        const COMBINING: u64 = 1 << 3;
        const NO_EXECUTE: u64 = 1 << 63;
        match self {
            Self::Constant => NO_EXECUTE,
            Self::Data => WRITABLE | NO_EXECUTE,
            Self::Code => 0,
            Self::Device => WRITABLE | UNCACHED | NO_EXECUTE,
            Self::Screen => WRITABLE | COMBINING | NO_EXECUTE,
        }
    }
}

/// Why a page cannot be mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapError {
    /// No frame is left for the table itself.
    OutOfFrames,
    /// The page is mapped already.
    AlreadyMapped,
}

/// Says what is wrong with the machine if mapping its own memory and devices fails.
impl core::fmt::Display for MapError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::OutOfFrames => "the machine has too little memory: give it 16 MiB or more",
            Self::AlreadyMapped => {
                "the firmware has two of image, memory, registers and screen in one place; update it"
            }
        })
    }
}

const PRESENT: u64 = 1;
const WRITABLE: u64 = 1 << 1;
const LARGE: u64 = 1 << 7;
const ADDRESS: u64 = 0x000f_ffff_ffff_f000;

/// A page table and where its own pages come from.
///
/// **Table invariant**: every table page is a zeroed frame of its own, reachable
/// at its physical address, and linked from the root exactly once.
pub(crate) struct PageTable {
    root: u64,
}

impl PageTable {
    /// Creates an empty table.
    ///
    /// # Safety
    ///
    /// Frames from `new_frame` are unused, zeroed, and identity-mapped and
    /// writable now and under this table; the same holds for every later call.
    pub(crate) unsafe fn new(new_frame: &mut dyn FnMut() -> Option<u64>) -> Result<Self, MapError> {
        Ok(Self {
            root: new_frame().ok_or(MapError::OutOfFrames)?,
        })
    }

    /// Returns the physical address of the root.
    pub(crate) const fn root(&self) -> u64 {
        self.root
    }

    /// Maps the whole pages `virtual_range` to physical addresses from
    /// `physical` on, with the largest pages that fit.
    #[inline(never)]
    pub(crate) fn map(
        &mut self,
        virtual_range: Range<u64>,
        physical: u64,
        access: PageAccess,
        new_frame: &mut dyn FnMut() -> Option<u64>,
    ) -> Result<(), MapError> {
        const PAGE_2_MIB: u64 = 1 << 21;
        let offset = physical.wrapping_sub(virtual_range.start);
        let mut address = virtual_range.start;
        while address < virtual_range.end {
            let fits = |size: u64| {
                address.is_multiple_of(size)
                    && address.wrapping_add(offset).is_multiple_of(size)
                    && virtual_range.end - address >= size
            };
            let (size, level, large) = match fits(PAGE_2_MIB) {
                true => (PAGE_2_MIB, 1, LARGE),
                false => (PAGE, 0, 0),
            };
            let slot = self.entry(address, level, new_frame)?;
            // A present entry never changes: no core can hold a stale translation, so none is
            // flushed.
            if read_entry(slot) & PRESENT != 0 {
                return Err(MapError::AlreadyMapped);
            }
            write_entry(
                slot,
                address.wrapping_add(offset) | access.bits() | large | PRESENT,
            );
            address += size;
        }
        Ok(())
    }

    /// Returns the entry for `address` at `level` (0: 4 KiB pages, 1: 2 MiB),
    /// adding the table pages that lead there.
    fn entry(
        &mut self,
        address: u64,
        level: u32,
        new_frame: &mut dyn FnMut() -> Option<u64>,
    ) -> Result<TableEntry, MapError> {
        let mut table = self.root;
        for above in (level + 1..=3).rev() {
            let slot = TableEntry::of(table, address, above);
            let mut entry = read_entry(slot);
            if entry & PRESENT == 0 {
                // With all rights: the last level alone restricts them.
                entry = new_frame().ok_or(MapError::OutOfFrames)? | PRESENT | WRITABLE;
                write_entry(slot, entry);
            } else if entry & LARGE != 0 {
                return Err(MapError::AlreadyMapped);
            }
            table = entry & ADDRESS;
        }
        Ok(TableEntry::of(table, address, level))
    }
}

/// The place of an entry in a table page.
#[derive(Clone, Copy)]
struct TableEntry(*mut u64);

impl TableEntry {
    fn of(table: u64, address: u64, level: u32) -> Self {
        let index = address >> (12 + 9 * level) & 511;
        Self((table + 8 * index) as *mut u64)
    }
}

fn read_entry(entry: TableEntry) -> u64 {
    // SAFETY: the entry lies in a page of the table (table invariant).
    unsafe { entry.0.read_volatile() }
}

fn write_entry(entry: TableEntry, value: u64) {
    // SAFETY: the entry lies in a page of the table (table invariant); what it
    // newly maps is named by the caller of `PageTable::map`.
    unsafe { entry.0.write_volatile(value) };
}
