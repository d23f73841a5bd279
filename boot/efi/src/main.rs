//! The application: what the firmware starts.
//!
//! It reserves the memory where the image belongs before it writes there, takes some below
//! 4 GiB for what the image is told, leaves the firmware and enters the image. A failure is
//! said on the firmware's console, in one line.

#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "the firmware's tables are pointers")]

mod firmware;
mod switch;

use boot_efi::file::{self, IMAGE, MODULE, Segment, WORDS};
use boot_efi::list::List;
use firmware::{Firmware, Handle, Place, SystemTable};

boot::memory_functions!();

/// Room for growth of the memory map while memory is taken and the firmware ends, in bytes.
const MAP_SLACK: usize = 4096;

/// The most bytes that the list of tags takes besides words and memory map.
const TAGS: usize = 512;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    firmware::halt()
}

// SAFETY: no other symbol of the program has the name.
#[unsafe(no_mangle)]
extern "efiapi" fn efi_main(handle: Handle, system: *const SystemTable) -> ! {
    // SAFETY: this is the entry, so the firmware has passed them.
    let firmware = unsafe { Firmware::new(handle, system) };
    let file = firmware.file().unwrap_or_default();
    let image = file::section(file, IMAGE).unwrap_or_default();
    let Some(entry) = file::entry(image).filter(|_| file::is_whole(file)) else {
        firmware.fail("this file is damaged, or was read wrongly: try again, or make it anew");
    };
    load(&firmware, image);
    let words = file::section(file, WORDS).unwrap_or_default();
    let module = file::section(file, MODULE).unwrap_or_default();

    let map_bytes = firmware.map_bytes().saturating_add(MAP_SLACK);
    // A descriptor of the firmware's is longer than an entry of the list.
    let list_bytes = TAGS.saturating_add(words.len()).saturating_add(map_bytes);
    let module_at = switch::BYTES
        .saturating_add(list_bytes)
        .next_multiple_of(4096);
    let low_bytes = module_at.saturating_add(module.len());
    const HIGHEST: u64 = (1 << 32) - 1;
    let low = firmware.allocate_pages(Place::Below, HIGHEST, low_bytes as u64);
    let buffer = firmware.allocate_pages(Place::Anywhere, 0, map_bytes as u64);
    let (Some(low), Some(buffer)) = (low, buffer) else {
        firmware.fail("not enough memory below 4 GiB for the memory map and the file: give less");
    };
    // SAFETY: the module's pages were taken for it.
    unsafe { copy(low.wrapping_add(module_at), module) };
    let list_at = low.wrapping_add(switch::BYTES.next_multiple_of(8));
    // SAFETY: the list's bytes lie in pages that were taken for it.
    let bytes = unsafe { core::slice::from_raw_parts_mut(list_at, list_bytes) };
    let mut list = List::new(bytes);
    list.command_line(words);
    if !module.is_empty() {
        let start = low.wrapping_add(module_at);
        list.module(address(start), address(start.wrapping_add(module.len())));
    }
    if let Some((start, shape)) = firmware.screen() {
        let pitch = shape.pitch.saturating_mul(4);
        list.screen(start, pitch, shape.width, shape.height);
    }
    if let Some((copy, is_new)) = firmware.root_pointer() {
        list.root_pointer(copy, is_new);
    }
    // SAFETY: the buffer was taken for this, in whole pages.
    let map = match unsafe { firmware.leave(buffer, map_bytes) } {
        Ok(map) => map,
        Err(firmware) => {
            firmware.fail("the firmware does not let go: its memory map changes each time")
        }
    };
    list.memory_map(map.ranges());
    let _ = list.finish();
    // SAFETY: 1. `leave` has succeeded. 2. `load` has laid out the image. 3. The page was taken
    // below 4 GiB, as code.
    unsafe { switch::enter(low, address(list_at), entry) }
}

/// Lays out an image where it belongs.
fn load(firmware: &Firmware, image: &[u8]) {
    let start = file::segments(image).map(|part| part.start).min();
    let end = file::segments(image).map(|part| part.end).max();
    let (start, end) = (start.unwrap_or(0) / 4096 * 4096, end.unwrap_or(0));
    if firmware
        .allocate_pages(Place::At, start, end.saturating_sub(start))
        .is_none()
    {
        firmware.fail("the memory where the image belongs, from 2 MiB on, is not free: use an ISO");
    }
    for Segment { start, end, bytes } in file::segments(image) {
        let to = start as *mut u8;
        // SAFETY: all that the segments span was taken above.
        unsafe { copy(to, bytes) };
        let rest = usize::try_from(end - start)
            .unwrap_or(0)
            .saturating_sub(bytes.len());
        // SAFETY: likewise.
        unsafe { to.wrapping_add(bytes.len()).write_bytes(0, rest) };
    }
}

/// Copies `bytes` to where they fit.
///
/// # Safety
///
/// As many bytes from `to` on are the caller's.
unsafe fn copy(to: *mut u8, bytes: &[u8]) {
    // SAFETY: the caller vouches for the place, which is not the file's.
    unsafe { to.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
}

/// Returns an address below 4 GiB.
fn address(low: *mut u8) -> u32 {
    low as u32
}
