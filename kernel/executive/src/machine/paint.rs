//! Measures by paint how much of a stack has been used.
//!
//! A stack's *paint* is a word that code does not write by chance, in every place below the used
//! part. The part between the lowest place without paint and the top has been used.

use super::this_core;

/// The paint.
const PAINT: u64 = 0x5ac4_71ed_0f00_d1e5;

/// The bytes of its own stack the painting code may use, the red zone included.
const OWN_BYTES: u64 = 1024;

/// Returns how many bytes of the running context's stack have been used since the last call, and
/// paints the stack again: `None` if the stack was not painted, as at the first call on a stack.
///
/// Calls no function that would need much of that stack.
pub fn take_used_bytes() -> Option<u64> {
    let local = 0_u64;
    let stack = this_core::get().context().stack();
    let end = (&raw const local) as u64 / 8 * 8 - OWN_BYTES;
    let mut lowest = stack.start;
    let was_painted = is_painted(lowest);
    while was_painted && lowest < end && is_painted(lowest) {
        lowest += 8;
    }
    let mut word = lowest;
    while word < end {
        // SAFETY: the word is of this context's own stack, and below what is in use of it:
        // interrupts run on other stacks.
        unsafe { (word as *mut u64).write_volatile(PAINT) };
        word += 8;
    }
    was_painted.then(|| stack.end - lowest)
}

/// Makes the next measurement begin anew on a stack not in use.
pub(super) fn spoil(stack: &core::ops::Range<u64>) {
    // SAFETY: the word is the lowest of a stack, and nothing runs there (context invariant).
    unsafe { (stack.start as *mut u64).write_volatile(0) };
}

fn is_painted(word: u64) -> bool {
    // SAFETY: the caller passes a word of its own stack, which can be read as a number.
    unsafe { (word as *const u64).read_volatile() == PAINT }
}
