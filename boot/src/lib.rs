//! Boot information: everything the machine tells the kernel at its start.
//!
//! A loader that speaks PVH (such as `qemu -kernel`) or Multiboot2 (such as GRUB) jumps to
//! `pvh_entry` of the crate `boot-entry` in 32-bit mode. `pvh_entry` enters 64-bit mode, collects
//! the loader's information in a [`BootInfo`], using this crate, and hands over to the image's
//! `kernel_main` for good.
//!
//! Terms: the *image* is the program as linked, the *boot processor* the processor started by the
//! firmware, an *application processor* any other.
//!
//! The state at the handover: interrupts are off, SSE is on, memory up to 4 GiB is identity-mapped
//! and writable, and the stack is part of the image and has no guard page. The kernel replaces
//! tables and stack as soon as it can.
//!
//! All code that interprets bytes ([`acpi`], [`multiboot2`], [`pvh`]) works on a borrowed view of
//! memory and is tested on the host; `unsafe` is confined to `physical`, `screen` and
//! `memory_functions`.

#![cfg_attr(not(test), no_std)]

pub mod acpi;
mod list;
#[allow(unsafe_code, reason = "C's memory functions take pointers")]
pub mod memory_functions;
mod memory_map;
pub mod multiboot2;
#[allow(unsafe_code, reason = "the loader leaves addresses, not references")]
pub mod physical;
pub mod power;
pub mod pvh;
#[allow(unsafe_code, reason = "pixels are at addresses")]
pub mod screen;

use physical::PhysicalMemory;

pub use list::{Full, List};
pub use memory_map::{MAX_REGIONS, MEMORY_END, MemoryMap, MemoryRegion};

/// The most processors told apart.
pub const MAX_PROCESSORS: usize = 255;

/// The most modules noted; loaders in use pass one.
pub const MAX_MODULES: usize = 4;

/// The most bytes kept of the loader's command line.
pub const MOST_COMMAND_LINE_BYTES: usize = 2048;

/// Information about the machine when the kernel takes over.
pub struct BootInfo {
    /// The command line passed by the loader, without interpretation.
    pub command_line: List<u8, MOST_COMMAND_LINE_BYTES>,
    /// Whether the loader's command line was longer.
    pub is_command_line_cut: bool,
    /// The physical memory map, as the loader told it until it is put in order.
    pub memory: MemoryMap,
    /// The files left in memory by the loader, in its order. Their places are the loader's word;
    /// the kernel compares them with the memory map.
    pub modules: List<Module, MAX_MODULES>,
    /// The screen, if the loader left one.
    pub screen: Option<Framebuffer>,
    /// The physical address of the ACPI root pointer, if the loader named it.
    pub rsdp: Option<u64>,
    /// The time stamp counter when Rust code began to run, in ticks.
    pub entry_tsc: u64,
}

/// A screen of coloured pixels in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Framebuffer {
    /// The physical address of the upper left pixel.
    pub start: u64,
    /// The bytes from a row to the next, at least those of the pixels.
    pub pitch: u32,
    /// The pixels of a row.
    pub width: u32,
    /// The rows.
    pub height: u32,
    /// The bytes of a pixel: 2 to 4.
    pub pixel_bytes: u8,
}

impl Framebuffer {
    /// Returns the range of memory taken by the screen.
    pub fn range(&self) -> core::ops::Range<u64> {
        let bytes = u64::from(self.pitch) * u64::from(self.height);
        self.start..self.start.saturating_add(bytes)
    }
}

/// A file left in memory by the loader: `qemu -initrd FILE`, GRUB's `module2 FILE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Module {
    /// The physical address of the first byte.
    pub start: u64,
    /// The physical address after the last byte, above `start`.
    pub end: u64,
}

/// The loader's information is collected piece by piece. Nothing here can fail: a loader that tells
/// less leaves lists empty, and the kernel, which can print, reports missing information.
impl BootInfo {
    /// Creates the information known without a loader's help: when Rust code began to run, in ticks
    /// of the time stamp counter.
    pub const fn new(entry_tsc: u64) -> Self {
        Self {
            command_line: List::new(0),
            is_command_line_cut: false,
            memory: MemoryMap::new(),
            modules: List::new(Module { start: 0, end: 0 }),
            screen: None,
            rsdp: None,
            entry_tsc,
        }
    }

    /// Takes the command line: the bytes from `start` on, up to the first 0. Keeps the first 2048
    /// bytes of a longer command line; the kernel refuses such a line.
    fn take_command_line(&mut self, memory: &impl PhysicalMemory, start: u64) {
        let text = (start..)
            .map_while(|at| memory.u8(at))
            .take_while(|byte| *byte != 0);
        for byte in text {
            if self.command_line.push(byte).is_err() {
                self.is_command_line_cut = true;
                return;
            }
        }
    }

    /// Takes an entry of a memory map. PVH and Multiboot2 entries begin alike: start, size and kind
    /// by E820's numbers. Returns `None` if the entry is missing or does not fit.
    fn take_region(&mut self, memory: &impl PhysicalMemory, entry: u64) -> Option<()> {
        /// The kind of ordinary memory.
        const USABLE: u32 = 1;
        let (start, size) = (memory.u64(entry)?, memory.u64(entry + 8)?);
        let kind = memory.u32(entry + 16)?;
        self.memory.add(start, size, kind == USABLE);
        (!self.memory.is_cut).then_some(())
    }

    /// Adds a module, unless it has no bytes.
    fn add_module(&mut self, start: u64, end: u64) -> Result<(), Full> {
        match start < end {
            true => self.modules.push(Module { start, end }),
            false => Ok(()),
        }
    }

    /// Returns the command line as text.
    ///
    /// # Errors
    ///
    /// If the command line is not UTF-8.
    pub fn command_line(&self) -> Result<&str, core::str::Utf8Error> {
        core::str::from_utf8(self.command_line.as_slice()).map(str::trim)
    }

    /// Returns the value of the option `key=value`, if the command line has it. Nothing is
    /// allocated, so options can be read before there is a heap.
    pub fn value(&self, key: &str) -> Option<&str> {
        let mut words = self.command_line().ok()?.split_whitespace();
        words.find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
    }
}
