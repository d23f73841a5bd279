//! How a worker waits: by polling, and politely when that takes long.

use std::thread::yield_now;

/// Rounds of polling after which the host may give the processor to another thread.
///
/// Some ten microseconds: longer than a hand-off between processors, much shorter
/// than the host's time slices, which matter where there are more workers than
/// processors. There is no `spin_loop` in a round: on many processors that takes as
/// long as half a hand-off.
const PATIENCE: u32 = 8_000;

/// Returns once `done` says so.
#[inline]
pub(crate) fn poll<T>(mut done: impl FnMut() -> Option<T>) -> T {
    let mut rounds = 0;
    loop {
        if let Some(value) = done() {
            return value;
        }
        rounds += 1;
        if rounds == PATIENCE {
            rounds = 0;
            yield_now();
        }
    }
}
