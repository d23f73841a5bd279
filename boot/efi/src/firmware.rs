//! As much of UEFI as it takes to get memory, to say a line, and to leave.
//!
//! The tables and calls are those of the UEFI specification 2.10, 4.3 (system table), 7.2
//! (memory), 7.4.6 (leaving), 9.1 (the loaded application), 12.4 (text) and 12.9 (screen). Of a
//! table the
//! fields up to the last one in use are listed.
//!
//! **Firmware invariant**: while the value [`Firmware`] lives the boot services are there, and
//! the tables are what the specification says.

use core::arch::asm;
use core::ffi::c_void;
use core::ptr::null_mut;

use boot::MemoryRegion;

/// The result of a call; 0 is success.
type Status = usize;
/// A handle of one of the firmware's objects.
pub(crate) type Handle = *mut c_void;
/// The name of a protocol or a table: the bytes of a GUID, in two halves.
type Guid = [u64; 2];

const LOADED_IMAGE: Guid = [0x11d2_9562_5b1b_31a1, 0x3b72_69c9_a000_3f8e];
const NEW_ACPI: Guid = [0x11d3_e4f1_8868_e871, 0x8188_3cc7_8000_22bc];
const GRAPHICS: Guid = [0x4a38_23dc_9042_a9de, 0x6a51_80d0_de7a_fb96];
const OLD_ACPI: Guid = [0x11d3_2d88_eb9d_2d30, 0x4dc1_3f27_9000_169a];

/// The table with which the firmware starts an application.
#[repr(C)]
pub(crate) struct SystemTable {
    header: [u64; 3],
    vendor: *const u16,
    revision: u32,
    input: [Handle; 2],
    output_handle: Handle,
    output: *mut TextOutput,
    errors: [Handle; 2],
    runtime: *const c_void,
    boot: *const BootServices,
    configuration_length: usize,
    configuration: *const Configuration,
}

/// A table that the firmware has for operating systems.
#[repr(C)]
struct Configuration {
    name: Guid,
    table: *const u8,
}

#[repr(C)]
struct TextOutput {
    reset: *const c_void,
    output: extern "efiapi" fn(*mut TextOutput, *const u16) -> Status,
}

#[repr(C)]
struct BootServices {
    header: [u64; 3],
    priorities: [*const c_void; 2],
    allocate_pages: extern "efiapi" fn(u32, u32, usize, *mut u64) -> Status,
    free_pages: *const c_void,
    memory_map: extern "efiapi" fn(*mut usize, *mut u8, *mut usize, *mut usize, *mut u32) -> Status,
    pools_and_events: [*const c_void; 8],
    protocols: [*const c_void; 3],
    handle_protocol: extern "efiapi" fn(Handle, *const Guid, *mut *mut c_void) -> Status,
    more_protocols: [*const c_void; 5],
    images: [*const c_void; 4],
    exit: extern "efiapi" fn(Handle, usize) -> Status,
    miscellaneous: [*const c_void; 10],
    locate_protocol: extern "efiapi" fn(*const Guid, *const c_void, *mut *mut c_void) -> Status,
}

#[repr(C)]
struct LoadedImage {
    revision: u32,
    parent: Handle,
    system: *const SystemTable,
    device: Handle,
    path: [*const c_void; 2],
    options_length: u32,
    options: *const c_void,
    start: *const u8,
    length: u64,
}

#[repr(C)]
struct GraphicsOutput {
    calls: [*const c_void; 3],
    mode: *const GraphicsMode,
}

#[repr(C)]
struct GraphicsMode {
    count: u32,
    number: u32,
    info: *const GraphicsInfo,
    info_length: usize,
    start: u64,
    length: usize,
}

#[repr(C)]
pub(crate) struct GraphicsInfo {
    version: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
    format: u32,
    masks: [u32; 4],
    /// The pixels from a row to the next.
    pub(crate) pitch: u32,
}

/// Which pages [`BootServices::allocate_pages`] is to give.
#[derive(Clone, Copy)]
pub(crate) enum Place {
    /// Any.
    Anywhere = 0,
    /// Those of which the last one is not above this address.
    Below = 1,
    /// Those from this address on.
    At = 2,
}

/// The firmware, before it is left.
pub(crate) struct Firmware {
    handle: Handle,
    system: *const SystemTable,
}

/// A range of memory, as the firmware describes it.
#[repr(C)]
struct Descriptor {
    kind: u32,
    start: u64,
    virtual_start: u64,
    pages: u64,
}

/// The memory map that [`Firmware::leave`] has left, in steps of `step` bytes.
pub(crate) struct MemoryMap {
    start: *const u8,
    length: usize,
    step: usize,
}

impl Firmware {
    /// Takes what the firmware has passed to the application.
    ///
    /// # Safety
    ///
    /// It is what the firmware has passed, and the boot services were not left.
    pub(crate) unsafe fn new(handle: Handle, system: *const SystemTable) -> Self {
        Self { handle, system }
    }

    fn system(&self) -> &SystemTable {
        // SAFETY: the firmware invariant.
        unsafe { &*self.system }
    }

    fn services(&self) -> &BootServices {
        // SAFETY: the firmware invariant.
        unsafe { &*self.system().boot }
    }

    /// Returns the application's file as it lies in memory.
    pub(crate) fn file(&self) -> Option<&'static [u8]> {
        let mut found = null_mut();
        let handle_protocol = self.services().handle_protocol;
        if handle_protocol(self.handle, &LOADED_IMAGE, &mut found) != 0 {
            return None;
        }
        // SAFETY: by the firmware invariant that is what this protocol leads to.
        let loaded = unsafe { &*found.cast::<LoadedImage>() };
        let length = usize::try_from(loaded.length).ok()?;
        // SAFETY: the firmware has put the file there, and nothing writes to it: this
        // application has no variables.
        Some(unsafe { core::slice::from_raw_parts(loaded.start, length) })
    }

    /// Returns a copy's worth of the ACPI root pointer, and whether it is of ACPI 2.0 or later.
    pub(crate) fn root_pointer(&self) -> Option<(&'static [u8], bool)> {
        let (start, length) = (
            self.system().configuration,
            self.system().configuration_length,
        );
        // SAFETY: the firmware invariant.
        let tables = unsafe { core::slice::from_raw_parts(start, length) };
        let find = |name: Guid| tables.iter().find(|table| table.name == name);
        let (table, bytes) = match find(NEW_ACPI) {
            Some(new) => (new.table, 36),
            None => (find(OLD_ACPI)?.table, 20),
        };
        // SAFETY: the firmware invariant: there is a root pointer of at least that length
        // (ACPI 6.5, 5.2.5.3).
        Some((
            unsafe { core::slice::from_raw_parts(table, bytes) },
            bytes == 36,
        ))
    }

    /// Returns the screen's address and shape, if it has pixels of 32 bits in memory.
    pub(crate) fn screen(&self) -> Option<(u64, &'static GraphicsInfo)> {
        let mut found = null_mut();
        let locate = self.services().locate_protocol;
        if locate(&GRAPHICS, null_mut(), &mut found) != 0 {
            return None;
        }
        // SAFETY: by the firmware invariant that is what this protocol leads to.
        let output = unsafe { &*found.cast::<GraphicsOutput>() };
        // SAFETY: likewise.
        let mode = unsafe { &*output.mode };
        // SAFETY: likewise.
        let info = unsafe { &*mode.info };
        // Both formats of 8 bits a colour.
        (info.format <= 1).then_some((mode.start, info))
    }

    /// Takes pages for at least `bytes`, which become ordinary memory when the firmware is left.
    /// They may be executed.
    pub(crate) fn allocate_pages(&self, place: Place, address: u64, bytes: u64) -> Option<*mut u8> {
        const APPLICATION_CODE: u32 = 1;
        let mut address = address;
        let pages = usize::try_from(bytes.div_ceil(4096)).ok()?;
        let allocate = self.services().allocate_pages;
        let status = allocate(place as u32, APPLICATION_CODE, pages, &mut address);
        (status == 0).then_some(address as *mut u8)
    }

    /// Returns how many bytes the memory map takes now.
    pub(crate) fn map_bytes(&self) -> usize {
        let (mut length, mut step) = (0, 0);
        self.read_map(null_mut(), &mut length, &mut step);
        length
    }

    /// Reads the memory map, and returns the key without which the firmware cannot be left.
    fn read_map(&self, to: *mut u8, length: &mut usize, step: &mut usize) -> Option<usize> {
        let (mut key, mut version) = (0, 0);
        let read = self.services().memory_map;
        (read(length, to, &mut key, step, &mut version) == 0).then_some(key)
    }

    /// Leaves the firmware, and returns its last memory map, which is written to `buffer`.
    ///
    /// # Safety
    ///
    /// `length` bytes from `buffer` on are the caller's, at a multiple of 8.
    pub(crate) unsafe fn leave(self, buffer: *mut u8, length: usize) -> Result<MemoryMap, Self> {
        // The map may change while the firmware ends what it does in the background.
        for _ in 0..16 {
            let (mut used, mut step) = (length, 0);
            let Some(key) = self.read_map(buffer, &mut used, &mut step) else {
                return Err(self);
            };
            if (self.services().exit)(self.handle, key) == 0 {
                return Ok(MemoryMap {
                    start: buffer,
                    length: used,
                    step: step.max(size_of::<Descriptor>()),
                });
            }
        }
        Err(self)
    }

    /// Says a line on the firmware's console, and [halts](halt).
    pub(crate) fn fail(&self, line: &str) -> ! {
        for byte in b"\r\n".iter().chain(line.as_bytes()).chain(b"\r\n") {
            let text = [u16::from(*byte), 0];
            let output = self.system().output;
            // SAFETY: the firmware invariant.
            let write = unsafe { &*output }.output;
            write(output, text.as_ptr());
        }
        halt()
    }
}

/// Ends: QEMU with a failure, a PC halted.
pub(crate) fn halt() -> ! {
    // SAFETY: the port is that of QEMU's `isa-debug-exit`, or nobody's.
    unsafe { asm!("out 0xf4, al", in("al") 0x11_u8, options(nomem, nostack)) };
    loop {
        // SAFETY: halting changes nothing, whether or not an interrupt ends it.
        unsafe { asm!("hlt", options(nomem, nostack)) };
    }
}

impl MemoryMap {
    /// Returns all ranges, in the firmware's order.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = MemoryRegion> {
        (0..self.length / self.step).map(|index| {
            let at = self.start.wrapping_add(index * self.step);
            // SAFETY: the firmware has written that many descriptors there, each of `step` bytes.
            let range = unsafe { &*at.cast::<Descriptor>() };
            MemoryRegion {
                start: range.start,
                end: range.start.saturating_add(range.pages.saturating_mul(4096)),
                // Of applications, of the boot services, of nobody: free by now.
                usable: matches!(range.kind, 1..=4 | 7),
            }
        })
    }
}
