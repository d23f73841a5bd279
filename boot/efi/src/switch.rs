//! From the firmware's 64-bit mode to where a Multiboot2 loader enters an image: 32-bit mode
//! with paging off, flat segments, interrupts off, the list's address in `ebx`.
//!
//! That also ends five-level paging, which cannot be turned off in 64-bit mode. The last
//! instructions run below 4 GiB, where the application itself need not be.

use core::arch::asm;

/// The segments: none, 32-bit code, data.
const SEGMENTS: [u64; 3] = [0, 0x00cf_9b00_0000_ffff, 0x00cf_9300_0000_ffff];

/// Where a table of segments is, as `lgdt` takes it.
#[repr(C, packed)]
struct SegmentTable {
    /// The offset of its last byte.
    limit: u16,
    start: u64,
}

/// The code that runs below 4 GiB, in 32-bit mode.
const CODE: [u8; 21] = [
    0xb8, 0x10, 0, 0, 0, // mov eax, 0x10: the data segment
    0x8e, 0xd8, // mov ds, eax
    0x8e, 0xc0, // mov es, eax
    0x8e, 0xd0, // mov ss, eax
    0xb8, 0x11, 0, 0, 0, // mov eax, 0x11: protected mode, no paging
    0x0f, 0x22, 0xc0, // mov cr0, eax
    0xff, // jmp edx
    0xe2,
];

/// How many bytes of the page below 4 GiB are used.
pub(crate) const BYTES: usize = SEGMENTS_AT + 8 * SEGMENTS.len();
const SEGMENTS_AT: usize = 32;

/// Enters an image at `entry`, with a list at `list`, for good.
///
/// # Safety
///
/// 1. The firmware has been left; it mapped memory to where it is (UEFI 2.10, 2.3.4).
/// 2. The image is where it belongs, and the list is one that it reads.
/// 3. From `page` on [`BYTES`] are the caller's, may be executed, and lie below 4 GiB.
pub(crate) unsafe fn enter(page: *mut u8, list: u32, entry: u32) -> ! {
    let segments = page.wrapping_add(SEGMENTS_AT);
    // SAFETY: condition 3.
    unsafe { page.cast::<[u8; 21]>().write_unaligned(CODE) };
    // SAFETY: condition 3.
    unsafe { segments.cast::<[u64; 3]>().write_unaligned(SEGMENTS) };
    let table = SegmentTable {
        limit: 8 * 3 - 1,
        start: segments as u64,
    };
    // SAFETY: conditions 1 to 3. `CODE` runs with the same page table until it turns paging
    // off, and nothing of this application is used again.
    unsafe {
        asm!(
            "cli",
            "cld",
            "lgdt [{table}]",
            "mov ebx, {list:e}",
            "push 0x08",
            "push {page}",
            "retfq",
            table = in(reg) &raw const table,
            list = in(reg) list,
            page = in(reg) page,
            in("edx") entry,
            options(noreturn),
        )
    }
}
