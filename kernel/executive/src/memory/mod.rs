//! Memory: frames, the address space, stacks and the heap.
//!
//! Virtual and physical addresses are equal, with two exceptions. Stacks live in a window of their
//! own, so that each can have an absent guard page below, where an overflow faults at once; the
//! loader's module has a window, too, because the module may lie in page 0.

pub(crate) mod frames;
pub mod heap;
mod tlsf;

use core::ops::Range;

use boot::{MEMORY_END, MemoryRegion, Module};

use crate::machine::paging::{MapError, PAGE, PageAccess, PageTable};
use crate::machine::spinlock::SpinLock;
use frames::{FRAME, FreeFrames, less};

/// The start of the stacks' window: beyond the used memory.
const STACK_WINDOW: u64 = MEMORY_END;

/// The start of the module's window: the module is at its physical address plus this address.
pub const MODULE_WINDOW: u64 = 1 << 40;

/// The physical memory, with the address space over the memory.
struct PhysicalMemory {
    frames: FreeFrames,
    table: PageTable,
    next_stack: u64,
    /// The ranges of registers mapped since the boot.
    registers: [Range<u64>; 16],
}

static MEMORY: SpinLock<Option<PhysicalMemory>> = SpinLock::new(None);

/// The memory layout found and built by [`initialize`].
#[derive(Clone, Copy, Debug)]
pub struct MemoryLayout {
    /// The page table's root, to be loaded by every core.
    pub root_table: u64,
    /// The bytes of usable memory.
    pub total_bytes: u64,
}

/// Builds the address space and the heap, and switches to the new space.
///
/// # Safety
///
/// 1. The boot page table is in use, and `map` is the machine's memory map, in order.
/// 2. The boot processor calls this function once, before any allocation.
/// 3. `module`, if any, [lies in memory](lies_in_memory) by that map.
/// 4. At `devices` there are registers, and `screen`, whole pages, is a screen.
pub unsafe fn initialize(
    map: &[MemoryRegion],
    module: Option<Module>,
    devices: &[u64],
    screen: Range<u64>,
) -> Result<MemoryLayout, MapError> {
    let mut frames = FreeFrames::new(map, &[boot_entry::image::whole(), pages_of(module)]);
    let total_bytes = frames.total_bytes();
    let heap = frames.take_heap().ok_or(MapError::OutOfFrames)?;
    let mut new_frame = || take_zeroed(&mut frames);
    // SAFETY: frames are unused and zeroed (`take_zeroed`), in memory that the
    // boot table maps (condition 1) and `map_all` maps too.
    let mut table = unsafe { PageTable::new(&mut new_frame) }?;
    map_all(&mut table, map, pages_of(module), &mut new_frame)?;
    map_devices(&mut table, map, devices, &mut new_frame)?;
    table.map(
        screen.clone(),
        screen.start,
        PageAccess::Screen,
        &mut new_frame,
    )?;
    let root_table = table.root();
    // SAFETY: image, data (so the boot stack) and all usable memory are mapped
    // to where they were.
    unsafe { crate::machine::cpu::set_page_table(root_table) };
    // Only under the new table: the heap may lie beyond the 4 GiB of the boot table.
    // SAFETY: the range was taken from the frames and is mapped as data; by
    // condition 2 the heap has no memory yet.
    unsafe { heap::add_memory(heap) };
    *MEMORY.lock() = Some(PhysicalMemory {
        frames,
        table,
        next_stack: STACK_WINDOW,
        registers: [const { 0..0 }; 16],
    });
    Ok(MemoryLayout {
        root_table,
        total_bytes,
    })
}

/// Returns the whole pages around a module, reserved for the module alone.
fn pages_of(module: Option<Module>) -> Range<u64> {
    module.map_or(0..0, |module| {
        module.start / PAGE * PAGE..module.end.next_multiple_of(PAGE)
    })
}

/// Returns the number of the page where processors start: the highest page of usable memory within
/// reach of real mode and free of modules.
pub fn trampoline_page(map: &[MemoryRegion], modules: &[Module]) -> Option<u8> {
    /// A PC's firmware and adapters begin here, even if the map says otherwise.
    const END: u64 = 640 << 10;
    let is_free = |page: &Range<u64>| {
        let lies = |region: &MemoryRegion| {
            region.usable && region.start <= page.start && page.end <= region.end
        };
        let is_hit = |module: &Module| module.start < page.end && page.start < module.end;
        map.iter().any(lies) && !modules.iter().any(is_hit)
    };
    let pages = (1..END / PAGE).map(|number| number * PAGE..(number + 1) * PAGE);
    let page = pages.rev().find(is_free)?;
    u8::try_from(page.start / PAGE).ok()
}

/// Reports whether a module lies in one range of usable memory, apart from the image.
pub fn lies_in_memory(module: Module, map: &[MemoryRegion], image: &Range<u64>) -> bool {
    let fits = |region: &MemoryRegion| {
        region.usable && region.start <= module.start && module.end <= region.end
    };
    // The module's last page belongs to the module alone, so the page has to be whole.
    let Some(end) = module.end.checked_next_multiple_of(PAGE) else {
        return false;
    };
    module.start < module.end
        && (end <= image.start || module.start / PAGE * PAGE >= image.end)
        && map.iter().any(fits)
}

/// Maps the image with its rights, the module as constant in its window, all other usable memory as
/// data.
fn map_all(
    table: &mut PageTable,
    map: &[MemoryRegion],
    module: Range<u64>,
    new_frame: &mut dyn FnMut() -> Option<u64>,
) -> Result<(), MapError> {
    let image = boot_entry::image::whole();
    let sections = [
        (boot_entry::image::rodata(), PageAccess::Constant),
        (boot_entry::image::text(), PageAccess::Code),
        (boot_entry::image::data(), PageAccess::Data),
    ];
    for (range, access) in sections {
        table.map(range.clone(), range.start, access, new_frame)?;
    }
    let shown = MODULE_WINDOW + module.start..MODULE_WINDOW + module.end;
    table.map(shown, module.start, PageAccess::Constant, new_frame)?;
    for region in map.iter().filter(|region| region.usable) {
        // Page 0 stays absent, so that a null pointer faults.
        let start = region.start.max(PAGE).next_multiple_of(PAGE);
        let end = region.end / PAGE * PAGE;
        for part in less(start..end, &[image.clone(), module.clone()]) {
            table.map(part.clone(), part.start, PageAccess::Data, new_frame)?;
        }
    }
    Ok(())
}

/// Maps the pages of devices' registers at these addresses, each page once.
fn map_devices(
    table: &mut PageTable,
    map: &[MemoryRegion],
    devices: &[u64],
    new_frame: &mut dyn FnMut() -> Option<u64>,
) -> Result<(), MapError> {
    let page = |address: &u64| address / PAGE * PAGE;
    for (index, start) in devices.iter().map(page).enumerate() {
        let is_memory = |region: &MemoryRegion| {
            region.usable && region.start < start + PAGE && start < region.end
        };
        let is_mapped = devices[..index].iter().any(|before| page(before) == start);
        // A firmware that puts a device into memory is mistaken in one of the two.
        if !is_mapped && !map.iter().any(is_memory) {
            table.map(start..start + PAGE, start, PageAccess::Device, new_frame)?;
        }
    }
    Ok(())
}

/// Returns the whole pages of a screen in `range`, unless a mistaken firmware puts the screen into
/// memory, or into the place of something else.
#[inline(never)]
pub fn pages_of_screen(range: Range<u64>, map: &[MemoryRegion]) -> Option<Range<u64>> {
    let pages = range.start / PAGE * PAGE..range.end.checked_next_multiple_of(PAGE)?;
    let is_hit = |region: &MemoryRegion| {
        region.usable && region.start < pages.end && pages.start < region.end
    };
    (pages.end <= STACK_WINDOW && !map.iter().any(is_hit)).then_some(pages)
}

fn take_zeroed(frames: &mut FreeFrames) -> Option<u64> {
    let frame = frames.allocate(1)?;
    let bytes = usize::try_from(FRAME).ok()?;
    // SAFETY: the frame was just taken, so nobody uses it; usable memory is
    // identity-mapped and writable under the boot table and under ours.
    unsafe { core::ptr::write_bytes(frame as *mut u8, 0, bytes) };
    Some(frame)
}

/// Maps the whole pages of a device's registers, once.
///
/// # Errors
///
/// [`MapError::AlreadyMapped`] if the range holds memory or something else.
pub fn map_registers(range: Range<u64>) -> Result<(), MapError> {
    let end = range.end.checked_next_multiple_of(PAGE);
    let pages = range.start / PAGE * PAGE..end.unwrap_or(u64::MAX);
    // Page 0 stays absent for null pointers, and the windows above are not the devices'.
    if pages.start == 0 || pages.end > STACK_WINDOW {
        return Err(MapError::AlreadyMapped);
    }
    let mut memory = MEMORY.lock();
    let memory = memory.as_mut().ok_or(MapError::OutOfFrames)?;
    let PhysicalMemory {
        frames,
        table,
        registers,
        ..
    } = memory;
    let covers = |known: &Range<u64>| known.start <= pages.start && pages.end <= known.end;
    if registers.iter().any(covers) {
        return Ok(());
    }
    let place = registers.iter_mut().find(|known| known.is_empty());
    let place = place.ok_or(MapError::OutOfFrames)?;
    let mut new_frame = || take_zeroed(frames);
    table.map(
        pages.clone(),
        pages.start,
        PageAccess::Device,
        &mut new_frame,
    )?;
    *place = pages;
    Ok(())
}

/// Creates a stack of `bytes`, whole pages, with a guard page below, and returns the stack's top.
/// The stack can later grow down to `room` bytes.
pub fn new_stack(bytes: u64, room: u64) -> Result<u64, MapError> {
    let mut memory = MEMORY.lock();
    let memory = memory.as_mut().ok_or(MapError::OutOfFrames)?;
    let top = memory.next_stack + PAGE + bytes.max(room);
    memory.map_stack(top - bytes..top)?;
    memory.next_stack = top;
    Ok(top)
}

/// Extends a stack with room down from `from` to `to`.
pub fn grow_stack(from: u64, to: u64) -> Result<(), MapError> {
    let mut memory = MEMORY.lock();
    memory
        .as_mut()
        .ok_or(MapError::OutOfFrames)?
        .map_stack(to..from)
}

impl PhysicalMemory {
    /// Puts frames below a part of the window, whole pages.
    #[inline(never)]
    fn map_stack(&mut self, part: Range<u64>) -> Result<(), MapError> {
        let PhysicalMemory { frames, table, .. } = self;
        let pages = (part.end - part.start) / PAGE;
        let physical = frames.allocate(pages).ok_or(MapError::OutOfFrames)?;
        table.map(part, physical, PageAccess::Data, &mut || {
            take_zeroed(frames)
        })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;

    #[test]
    fn registers_at_the_end_of_all_addresses_are_refused() {
        let end = u64::MAX - 0xfff;
        assert_eq!(map_registers(end..end + 16), Err(MapError::AlreadyMapped));
    }

    #[test]
    fn processors_start_at_the_highest_low_page_that_is_free() {
        let region = |start, end, usable| MemoryRegion { start, end, usable };
        let module = |start, end| Module { start, end };
        let ordinary = [
            region(0, 0x9_fc00, true),
            region(0x9_fc00, MIB, false),
            region(MIB, 8 * MIB, true),
        ];
        let page = |modules: &[Module]| trampoline_page(&ordinary, modules);
        assert_eq!(page(&[]), Some(0x9e), "a whole page");
        assert_eq!(page(&[module(4 * MIB, 5 * MIB)]), Some(0x9e));
        assert_eq!(page(&[module(0x1_4000, 0x9_e001)]), Some(0x13));
        let two = [module(0x9_e800, 0x9_e900), module(0x9_d000, 0x9_d001)];
        assert_eq!(page(&two), Some(0x9c));
        assert_eq!(page(&[module(0x1000, 0x9_fc00)]), None, "page 0 is none");
        let high = [region(0, MIB, true)];
        assert_eq!(trampoline_page(&high, &[]), Some(0x9f), "below 640 KiB");
        assert_eq!(trampoline_page(&[region(MIB, 8 * MIB, true)], &[]), None);
    }

    #[test]
    fn believes_a_module_only_where_memory_is_free() {
        let region = |start, end, usable| MemoryRegion { start, end, usable };
        let map = [
            region(0, 640 << 10, true),
            region(MIB, 8 * MIB, true),
            region(8 * MIB, 9 * MIB, false),
            region(9 * MIB, u64::MAX, true),
        ];
        let image = 2 * MIB..3 * MIB;
        let lies = |start, end| lies_in_memory(Module { start, end }, &map, &image);
        assert!(lies(4 * MIB, 5 * MIB));
        assert!(lies(MIB, 2 * MIB));
        assert!(lies(8 * MIB - 1, 8 * MIB));
        // Below the first MiB, as GRUB does.
        assert!(lies(64 << 10, 65 << 10));
        assert!(lies(0, 8192), "in page 0, as GRUB does under UEFI");
        assert!(!lies(639 << 10, 641 << 10), "into the firmware's");
        assert!(!lies(MIB, 2 * MIB + 1), "into the image");
        assert!(!lies(3 * MIB - 1, 4 * MIB), "out of the image");
        assert!(!lies(8 * MIB - 1, 8 * MIB + 1), "into reserved memory");
        assert!(!lies(4 * MIB, 4 * MIB), "empty");
        assert!(!lies(u64::MAX - 1, u64::MAX), "at the end of all addresses");
        assert_eq!(
            pages_of(Some(Module {
                start: 5000,
                end: 8193
            })),
            4096..12288
        );
    }
}
