//! Attacks misusing a lock of the kernel's.

use core::hint::black_box;

use faults::crimes::{LOCKS, Unpunished};

/// Takes the lock while holding it.
pub(super) fn lock_twice() -> Unpunished {
    LOCKS[2].with(|_| LOCKS[2].with(|shared| *shared += 1));
    Unpunished
}

/// Holds the lock without end.
pub(super) fn loop_in_section() -> Unpunished {
    LOCKS[3].with(|shared| {
        while black_box(true) {
            *shared = shared.wrapping_add(1);
            core::hint::spin_loop();
        }
    });
    Unpunished
}
