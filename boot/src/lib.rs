//! What the machine tells the kernel at its start.
//!
//! A loader that speaks PVH (`qemu -kernel` does) jumps to `pvh_entry` of the crate
//! `boot-entry` in 32-bit mode, which enters 64-bit mode, has what the loader tells
//! collected here in a [`BootInfo`] and hands over to the image's `kernel_main` for
//! good.
//!
//! Words: the *image* is the program as linked, the *boot processor* the one
//! that the firmware started, an *application processor* any other.
//!
//! What holds at the handover: interrupts are off, SSE is on, memory up to
//! 4 GiB is identity-mapped and writable, and the stack is part of the image and
//! has no guard page. The kernel replaces tables and stack as soon as it can.
//!
//! Everything that interprets bytes ([`acpi`], [`pvh`]) works on a borrowed view
//! of memory and is tested on the host; `unsafe` is in `physical` only.

#![cfg_attr(not(test), no_std)]

pub mod acpi;
mod list;
#[allow(
    unsafe_code,
    reason = "what the loader left is at addresses, not in references"
)]
pub mod physical;
pub mod pvh;

pub use list::{Full, List};

/// The most processors that are told apart: the 8-bit APIC ids, less broadcast.
pub const MAX_PROCESSORS: usize = 255;

/// The most modules that are noted; loaders in use pass one.
pub const MAX_MODULES: usize = 4;

/// The most bytes of the loader's words that are kept.
pub const MOST_COMMAND_LINE_BYTES: usize = 2048;

/// What is known of the machine when the kernel takes over.
#[derive(Debug)]
pub struct BootInfo {
    /// The words that the loader passed, without interpretation.
    pub command_line: List<u8, MOST_COMMAND_LINE_BYTES>,
    /// Whether the loader passed more than that.
    pub is_command_line_cut: bool,
    /// The physical memory map.
    pub memory: List<MemoryRegion, 64>,
    /// The files that the loader left in memory, in its order.
    pub modules: List<Module, MAX_MODULES>,
    /// The physical address of the ACPI root pointer, if the loader named it.
    pub rsdp: Option<u64>,
    /// The time stamp counter when Rust code began to run, in ticks.
    pub entry_tsc: u64,
}

/// A range of physical memory of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRegion {
    /// The address of its first byte.
    pub start: u64,
    /// The address after its last byte.
    pub end: u64,
    /// Whether it is ordinary memory that nobody uses.
    pub usable: bool,
}

/// A file that the loader left in memory: `qemu -initrd FILE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Module {
    /// The physical address of its first byte.
    pub start: u64,
    /// The physical address after its last byte, above `start`.
    pub end: u64,
}

impl BootInfo {
    /// Returns the command line as text.
    ///
    /// # Errors
    ///
    /// If it is not UTF-8.
    pub fn command_line(&self) -> Result<&str, core::str::Utf8Error> {
        core::str::from_utf8(self.command_line.as_slice()).map(str::trim)
    }
}
