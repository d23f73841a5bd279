//! A lock of the kernel's, misused.

use core::hint::black_box;

use faults::crimes::Unpunished;
use kernel::Lock;

// A fault ends the section, and with it the lock: each attack has its own.
static TAKEN_TWICE: Lock<u32> = Lock::new(0);
static HELD: Lock<u32> = Lock::new(0);

/// Takes the lock that it holds.
pub(super) fn lock_twice() -> Unpunished {
    TAKEN_TWICE.with(|_| TAKEN_TWICE.with(|shared| *shared += 1));
    Unpunished
}

/// Holds the lock without end.
pub(super) fn loop_in_section() -> Unpunished {
    HELD.with(|shared| {
        while black_box(true) {
            *shared = shared.wrapping_add(1);
            core::hint::spin_loop();
        }
    });
    Unpunished
}
