//! What only the image itself can define: its entry, allocator, panic handler
//! and the few functions that compiled code calls without being asked.
//!
//! The [`entry!`](crate::entry) macro defines them in the app's binary, not in
//! this library, so that host programs that use the library keep their own.

use core::arch::asm;
use core::panic::PanicInfo;

pub use boot::BootInfo;

/// Makes an app's function the one that the image runs.
///
/// To be called once, in the `main.rs` of a `#![no_std] #![no_main]` binary
/// whose `build.rs` calls `boot_link::link_image()`:
///
/// ```ignore
/// kernel::entry!(main);
///
/// fn main(machine: &kernel::Machine) -> Result<(), kernel::Ending> { Ok(()) }
/// ```
#[macro_export]
macro_rules! entry {
    ($app:path) => {
        #[cfg(not(linked_as_image))]
        compile_error!(
            "the image is linked as a program of the host: let `build.rs` call \
             `boot_link::link_image()`, with `boot-link` in `[build-dependencies]`"
        );
        #[cfg(test)]
        compile_error!(
            "an image is compiled as a test: write `test = false` below `[[bin]]` in `Cargo.toml`"
        );
        #[cfg(not(any(test, panic = "abort")))]
        compile_error!(
            "an image cannot unwind: write `panic = \"abort\"` below `[profile.dev]` and below \
             `[profile.release]` in the `Cargo.toml` of the workspace"
        );

        #[global_allocator]
        static HEAP: $crate::KernelHeap = $crate::KernelHeap;

        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
            $crate::entry::panic(info)
        }

        // SAFETY: the linker script makes the section part of the notes, and this is one.
        #[used]
        #[unsafe(link_section = ".note.app")]
        static APP_NOTE: $crate::entry::AppNote =
            $crate::entry::AppNote::new(env!("CARGO_PKG_NAME"));

        // SAFETY: `boot` declares the function with this signature and calls it
        // once; no other symbol has the name.
        #[unsafe(no_mangle)]
        fn kernel_main(info: &'static $crate::entry::BootInfo) -> ! {
            $crate::entry::start(info, env!("CARGO_PKG_NAME"), $app)
        }

        $crate::memory_functions!();
    };
}

/// Defines the functions that the compiler assumes to exist, by their C names.
#[doc(hidden)]
#[macro_export]
macro_rules! memory_functions {
    () => {
        // SAFETY: each function has the signature and the meaning that the
        // compiler assumes of its name (ISO C, 7.24; `bcmp`: POSIX.1-2001).
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, length: usize) -> *mut u8 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::entry::copy_up(to, from, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memmove(to: *mut u8, from: *const u8, length: usize) -> *mut u8 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::entry::copy_any(to, from, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memset(to: *mut u8, value: i32, length: usize) -> *mut u8 {
            // SAFETY: the caller vouches for the range.
            unsafe { $crate::entry::fill(to, value, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memcmp(left: *const u8, right: *const u8, length: usize) -> i32 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::entry::compare(left, right, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn bcmp(left: *const u8, right: *const u8, length: usize) -> i32 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::entry::compare(left, right, length) }
        }

        // SAFETY: named by unwinding tables only, which the image discards.
        #[unsafe(no_mangle)]
        extern "C" fn rust_eh_personality() {}

        // SAFETY: called by the landing pads of the precompiled library only,
        // and nothing unwinds: a panic ends where it happens.
        #[unsafe(no_mangle)]
        extern "C" fn _Unwind_Resume() -> ! {
            unreachable!("nothing unwinds")
        }
    };
}

/// The note of the image that names its app: an ELF note, which the host reads without a
/// boot.
#[repr(C)]
pub struct AppNote {
    owner_bytes: u32,
    content_bytes: u32,
    kind: u32,
    owner: [u8; 4],
    content: [u8; 64],
}

impl AppNote {
    /// Names the app.
    ///
    /// # Panics
    ///
    /// While the app is compiled, if the name is longer than 64 bytes.
    #[must_use]
    pub const fn new(app: &str) -> AppNote {
        assert!(app.len() <= 64, "an app's name has 64 bytes at most");
        let mut content = [0; 64];
        let (name, _) = content.split_at_mut(app.len());
        name.copy_from_slice(app.as_bytes());
        AppNote {
            owner_bytes: 4,
            content_bytes: 64,
            kind: 1,
            owner: *b"App\0",
            content,
        }
    }
}

/// Runs `kernel_main` of the image.
pub fn start(
    info: &'static BootInfo,
    name: &'static str,
    app: fn(&crate::Machine) -> Result<(), crate::Ending>,
) -> ! {
    crate::start::start(info, name, app)
}

/// Runs the image's panic handler.
pub fn panic(info: &PanicInfo<'_>) -> ! {
    crate::watch::panic::panic(info)
}

/// Copies bytes in ascending order.
///
/// # Safety
///
/// `length` bytes are readable at `from` and writable at `to`; if the ranges
/// overlap, `to` is the lower one.
pub unsafe fn copy_up(to: *mut u8, from: *const u8, length: usize) -> *mut u8 {
    // SAFETY: the caller vouches for the ranges; the direction flag is clear.
    unsafe {
        asm!(
            "rep movsb",
            inout("rcx") length => _, inout("rdi") to => _, inout("rsi") from => _,
            options(nostack, preserves_flags),
        );
    };
    to
}

/// Copies bytes between ranges that may overlap either way.
///
/// # Safety
///
/// `length` bytes are readable at `from` and writable at `to`.
pub unsafe fn copy_any(to: *mut u8, from: *const u8, length: usize) -> *mut u8 {
    if (to as usize).wrapping_sub(from as usize) >= length {
        // SAFETY: the caller vouches for the ranges, and `to` does not lie
        // within the source, so ascending order reads each byte before it is
        // overwritten.
        return unsafe { copy_up(to, from, length) };
    }
    // SAFETY: the caller vouches for the ranges; the direction flag is set for
    // this copy alone.
    unsafe {
        asm!(
            "std", "rep movsb", "cld",
            inout("rcx") length => _,
            inout("rdi") to.wrapping_add(length).wrapping_sub(1) => _,
            inout("rsi") from.wrapping_add(length).wrapping_sub(1) => _,
            options(nostack),
        );
    };
    to
}

/// Fills bytes with the low 8 bits of `value`.
///
/// # Safety
///
/// `length` bytes are writable at `to`.
pub unsafe fn fill(to: *mut u8, value: i32, length: usize) -> *mut u8 {
    // SAFETY: the caller vouches for the range; the direction flag is clear.
    unsafe {
        asm!(
            "rep stosb",
            inout("rcx") length => _, inout("rdi") to => _, in("eax") value,
            options(nostack, preserves_flags),
        );
    };
    to
}

/// Compares bytes as unsigned numbers: negative, 0 or positive.
///
/// # Safety
///
/// `length` bytes are readable at `left` and at `right`.
pub unsafe fn compare(left: *const u8, right: *const u8, length: usize) -> i32 {
    for offset in 0..length {
        // SAFETY: the caller vouches for the range.
        let left = unsafe { left.wrapping_add(offset).read() };
        // SAFETY: likewise.
        let right = unsafe { right.wrapping_add(offset).read() };
        if left != right {
            return i32::from(left) - i32::from(right);
        }
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_overlapping_ranges_either_way() {
        let mut bytes = *b"abcdef";
        // SAFETY: four bytes lie at both places of the array.
        unsafe { copy_any(bytes.as_mut_ptr().wrapping_add(2), bytes.as_ptr(), 4) };
        assert_eq!(&bytes, b"ababcd");
        // SAFETY: likewise.
        unsafe { copy_any(bytes.as_mut_ptr(), bytes.as_ptr().wrapping_add(2), 4) };
        assert_eq!(&bytes, b"abcdcd");
    }

    #[test]
    fn fills_and_compares() {
        let mut bytes = [1u8; 4];
        // SAFETY: the array has four bytes.
        unsafe { fill(bytes.as_mut_ptr(), 0x1ff, 3) };
        assert_eq!(bytes, [255, 255, 255, 1]);
        // SAFETY: both arrays have four bytes.
        let order = unsafe { compare(bytes.as_ptr(), [255u8, 255, 255, 2].as_ptr(), 4) };
        assert!(order < 0);
    }
}
