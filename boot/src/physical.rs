//! Reading physical memory, behind a trait so that its readers run on the host.

/// A view of physical memory.
pub trait PhysicalMemory {
    /// Returns `length` bytes from physical address `address` on, or `None` if the view does not
    /// cover them.
    fn bytes(&self, address: u64, length: usize) -> Option<&[u8]>;

    /// Returns the little-endian 8-bit value at `address`.
    fn u8(&self, address: u64) -> Option<u8> {
        self.bytes(address, 1)?.first().copied()
    }

    /// Returns the little-endian 32-bit value at `address`, aligned or not.
    fn u32(&self, address: u64) -> Option<u32> {
        Some(u32::from_le_bytes(self.bytes(address, 4)?.try_into().ok()?))
    }

    /// Returns the little-endian 64-bit value at `address`, aligned or not.
    fn u64(&self, address: u64) -> Option<u64> {
        Some(u64::from_le_bytes(self.bytes(address, 8)?.try_into().ok()?))
    }
}

/// The machine's own memory below 4 GiB, through its second mapping in the boot page table. No
/// address is null there, and a loader may leave its information at address 0.
#[derive(Clone, Copy, Debug)]
pub struct LowMemory(());

/// The address of the second mapping: `entry.s` makes the second entry of the root table the
/// first's twin.
const WINDOW: usize = 1 << 39;

impl LowMemory {
    /// Grants reading.
    ///
    /// # Safety
    ///
    /// 1. The boot page table is in use for as long as the value, a copy of it, or a slice obtained
    ///    from it is.
    /// 2. Meanwhile nothing writes to the memory read through the value.
    pub const unsafe fn new() -> Self {
        Self(())
    }
}

impl PhysicalMemory for LowMemory {
    fn bytes(&self, address: u64, length: usize) -> Option<&[u8]> {
        let end = address.checked_add(u64::try_from(length).ok()?)?;
        if end > 1 << 32 {
            return None;
        }
        let start = (WINDOW + usize::try_from(address).ok()?) as *const u8;
        // SAFETY: the range lies below 4 GiB; conditions 1 and 2 of `new` make it readable and
        // constant.
        Some(unsafe { core::slice::from_raw_parts(start, length) })
    }
}

/// A machine of so many bytes.
#[cfg(test)]
impl PhysicalMemory for Vec<u8> {
    fn bytes(&self, address: u64, length: usize) -> Option<&[u8]> {
        let start = usize::try_from(address).ok()?;
        self.get(start..start.checked_add(length)?)
    }
}
