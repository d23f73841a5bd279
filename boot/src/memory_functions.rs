//! The few functions that compiled code calls implicitly, by their C names.
//!
//! The [`memory_functions!`](crate::memory_functions!) macro defines them in a freestanding
//! program, not in this library, so that host programs linked with the library keep their own.

use core::arch::asm;

/// Defines the functions assumed by the compiler to exist, by their C names.
#[doc(hidden)]
#[macro_export]
macro_rules! memory_functions {
    () => {
        // SAFETY: each function has the signature and the meaning that the compiler assumes of its
        // name (ISO C, 7.24; `bcmp`: POSIX.1-2001).
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, length: usize) -> *mut u8 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::memory_functions::copy_up(to, from, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memmove(to: *mut u8, from: *const u8, length: usize) -> *mut u8 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::memory_functions::copy_any(to, from, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memset(to: *mut u8, value: i32, length: usize) -> *mut u8 {
            // SAFETY: the caller vouches for the range.
            unsafe { $crate::memory_functions::fill(to, value, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn memcmp(left: *const u8, right: *const u8, length: usize) -> i32 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::memory_functions::compare(left, right, length) }
        }

        // SAFETY: as for `memcpy`.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn bcmp(left: *const u8, right: *const u8, length: usize) -> i32 {
            // SAFETY: the caller vouches for both ranges.
            unsafe { $crate::memory_functions::compare(left, right, length) }
        }

        // SAFETY: named by unwinding tables only, which the image discards.
        #[unsafe(no_mangle)]
        extern "C" fn rust_eh_personality() {}

        // SAFETY: called by the landing pads of the precompiled library only, and nothing unwinds:
        // a panic ends where it happens.
        #[unsafe(no_mangle)]
        extern "C" fn _Unwind_Resume() -> ! {
            unreachable!("nothing unwinds")
        }
    };
}

/// Copies bytes in ascending order.
///
/// # Safety
///
/// `length` bytes are readable at `from` and writable at `to`; if the ranges overlap, `to` is the
/// lower one.
#[inline]
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
#[inline]
pub unsafe fn copy_any(to: *mut u8, from: *const u8, length: usize) -> *mut u8 {
    if (to as usize).wrapping_sub(from as usize) >= length {
        // SAFETY: the caller vouches for the ranges, and `to` does not lie within the source, so
        // ascending order reads each byte before it is overwritten.
        return unsafe { copy_up(to, from, length) };
    }
    // SAFETY: the caller vouches for the ranges; the direction flag is set for this copy alone.
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
#[inline]
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

/// Compares bytes as unsigned numbers, and returns a negative number, 0 or a positive number.
///
/// # Safety
///
/// `length` bytes are readable at `left` and at `right`.
#[inline]
pub unsafe fn compare(left: *const u8, right: *const u8, length: usize) -> i32 {
    let word = |of: *const u8, offset| {
        // SAFETY: the caller vouches for the range, which has these eight bytes.
        unsafe { of.wrapping_add(offset).cast::<u64>().read_unaligned() }
    };
    let mut same = 0;
    while same + 8 <= length && word(left, same) == word(right, same) {
        same += 8;
    }
    for offset in same..length {
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
        for at in 0..19 {
            let mut other = [7; 19];
            other[at] = 9;
            // SAFETY: both arrays have 19 bytes.
            let order = unsafe { compare(other.as_ptr(), [7; 19].as_ptr(), 19) };
            assert_eq!(order, 2, "{at}");
        }
    }
}
