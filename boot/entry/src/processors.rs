//! Starts the application processors.
//!
//! Each processor starts at the trampoline, finds its stack by its APIC id and calls the entry
//! function named by the kernel. All of them may start at once: they share nothing but read-only
//! data.
//!
//! The kernel carries out a start, because the interrupts are sent with its local APIC: first
//! [`prepare`], then the INIT and startup interrupts (Intel SDM volume 3, 9.4.4), whose vector is
//! the trampoline's page.

use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use boot::MAX_PROCESSORS;

/// The entry function: called with the processor's APIC id, never to return.
pub type Entry = extern "C" fn(apic_id: u32) -> !;

/// The APIC id of each processor, and the top of its stack, read by `entry.s`.
pub(crate) static STACKS: [[AtomicU64; 2]; MAX_PROCESSORS] =
    [const { [const { AtomicU64::new(0) }; 2] }; MAX_PROCESSORS];

/// The address of the entry function, 0 before [`prepare`].
static ENTRY: AtomicUsize = AtomicUsize::new(0);

unsafe extern "C" {
    safe static trampoline_start: u8;
    safe static trampoline_root_table: u8;
    safe static trampoline_end: u8;
}

/// Lays the trampoline at page number `page`, so that processors can be started there.
///
/// # Panics
///
/// If `root_table` is not below 4 GiB, where 32-bit code can load it.
///
/// # Safety
///
/// 1. `root_table` is the physical address of a page table that identity-maps the image and maps
///    all stacks.
/// 2. The page is mapped writable and holds nothing of use.
pub unsafe fn prepare(root_table: u64, page: u8, entry: Entry) {
    ENTRY.store(entry as usize, Ordering::Release);
    let root_table = u32::try_from(root_table).expect("the root page table lies below 4 GiB");
    let start = core::ptr::from_ref(&trampoline_start);
    let length = core::ptr::from_ref(&trampoline_end) as usize - start as usize;
    let field = core::ptr::from_ref(&trampoline_root_table) as usize - start as usize;
    let page = (usize::from(page) << 12) as *mut u8;
    // SAFETY: the source is the trampoline's bytes between two symbols of one section, the
    // destination is the page of condition 2.
    unsafe { page.copy_from_nonoverlapping(start, length) };
    // SAFETY: the field lies within the copied bytes, on the page of condition 2.
    unsafe {
        page.wrapping_add(field)
            .cast::<u32>()
            .write_unaligned(root_table)
    };
}

/// Gives processor `apic_id` its stack, which grows down from `top`. Each processor has a place,
/// and places are taken from 0 on.
///
/// # Panics
///
/// If `place` is not below [`MAX_PROCESSORS`].
pub fn set_stack(place: usize, apic_id: u32, top: u64) {
    let [id, stack] = &STACKS[place];
    id.store(u64::from(apic_id), Ordering::Release);
    stack.store(top, Ordering::Release);
}

/// Continues `entry.s` on an application processor's own stack.
pub(crate) extern "C" fn rust_entry(apic_id: u32) -> ! {
    let entry = ENTRY.load(Ordering::Acquire);
    // SAFETY: `prepare` stored a function of this type, and ran before any processor was started.
    let entry = unsafe { core::mem::transmute::<usize, Entry>(entry) };
    entry(apic_id)
}
