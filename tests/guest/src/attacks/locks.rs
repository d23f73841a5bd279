//! A lock of the kernel's, misused.

use core::hint::black_box;

use faults::crimes::Unpunished;
use kernel::Lock;

static SHARED: Lock<u32> = Lock::new(0);

/// Takes the lock that it holds.
pub(super) fn lock_twice() -> Unpunished {
    SHARED.with(|_| SHARED.with(|shared| *shared += 1));
    Unpunished
}

/// Holds the lock without end.
pub(super) fn loop_in_section() -> Unpunished {
    SHARED.with(|shared| {
        while black_box(true) {
            *shared = shared.wrapping_add(1);
            core::hint::spin_loop();
        }
    });
    Unpunished
}
