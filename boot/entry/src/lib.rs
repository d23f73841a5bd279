//! The image's first instructions on every processor, and the places of its parts.
//!
//! The loader jumps to `entry.s`, which maps the first 4 GiB one to one, enters 64-bit mode and
//! calls `rust_entry`. `rust_entry` hands over to the image's `kernel_main` for good. Later the
//! kernel starts the other processors through [`processors`].
//!
//! This is a crate of its own, without anything else, for the sake of host programs that link the
//! kernel's logic: the code here has fixed addresses, so it fits into no other program than an
//! image. A linker keeps the code only for an image, which asks for `pvh_entry` (`image.ld`).

#![no_std]
#![allow(
    unsafe_code,
    reason = "from the reset to Rust, there is nothing safe to stand on"
)]

pub mod image;
pub mod processors;

use core::arch::{asm, global_asm};

use boot::physical::LowMemory;
use boot::{BootInfo, multiboot2, pvh};

global_asm!(
    include_str!("entry.s"),
    rust_entry = sym rust_entry,
    stacks = sym processors::STACKS,
    stacks_bytes = const size_of_val(&processors::STACKS),
    processor_rust_entry = sym processors::rust_entry,
);
global_asm!(include_str!("trampoline.s"), options(att_syntax));

unsafe extern "Rust" {
    /// Takes over the machine; the image's `entry!` macro defines this function.
    safe fn kernel_main(info: &'static BootInfo) -> !;
}

/// Collects the loader's information and hands over to the kernel.
///
/// The information is at address `told`. PVH's start info begins with a magic number; Multiboot2's
/// list begins with its own length, and no list is as long as that number.
extern "C" fn rust_entry(told: u32) -> ! {
    let entry_tsc = time_stamp();
    // SAFETY: 1. `entry.s` has loaded the boot page table, and the view is dropped before the
    // kernel loads its own. 2. Only this processor runs, and it writes to its stack alone, which
    // the loader's data does not overlap.
    let memory = unsafe { LowMemory::new() };
    let mut info = BootInfo::new(entry_tsc);
    if !pvh::read(&memory, u64::from(told), &mut info) {
        multiboot2::read(&memory, u64::from(told), &mut info);
    }
    info.memory.put_in_order();
    // SAFETY: this frame is never left (`kernel_main` does not return), and the boot stack is part
    // of the image: `info` lives as long as the machine runs.
    let info: &'static BootInfo = unsafe { &*core::ptr::from_ref(&info) };
    kernel_main(info)
}

fn time_stamp() -> u64 {
    let (low, high): (u32, u32);
    // SAFETY: RDTSC only writes the two registers; every 64-bit processor has it.
    unsafe { asm!("rdtsc", out("eax") low, out("edx") high, options(nomem, nostack)) };
    u64::from(high) << 32 | u64::from(low)
}
