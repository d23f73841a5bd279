//! The places of the image's parts in memory, from the linker script's symbols.
//!
//! Addresses are virtual and physical at once: the image is identity-mapped.

use core::ops::Range;

unsafe extern "C" {
    safe static image_start: u8;
    safe static image_end: u8;
    safe static image_rodata_start: u8;
    safe static image_rodata_end: u8;
    safe static image_text_start: u8;
    safe static image_text_end: u8;
    safe static image_data_start: u8;
    safe static image_data_end: u8;
}

fn between(start: &'static u8, end: &'static u8) -> Range<u64> {
    core::ptr::from_ref(start) as u64..core::ptr::from_ref(end) as u64
}

/// Returns the range of the whole image, in whole pages.
pub fn whole() -> Range<u64> {
    between(&image_start, &image_end)
}

/// Returns the range of the code: to be executed and read.
pub fn text() -> Range<u64> {
    between(&image_text_start, &image_text_end)
}

/// Returns the range of the constants: to be read only.
pub fn rodata() -> Range<u64> {
    between(&image_rodata_start, &image_rodata_end)
}

/// Returns the range of the variables: to be read and written.
pub fn data() -> Range<u64> {
    between(&image_data_start, &image_data_end)
}
