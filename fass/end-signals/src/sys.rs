//! The system calls of the crate: its only `unsafe` code.
//!
//! The symbols belong to the C library, linked by the standard library anyway. Each function is
//! safe to call with any arguments.

use std::sync::atomic::{AtomicU32, Ordering};

unsafe extern "C" {
    fn kill(process: i32, signal: i32) -> i32;
    fn signal(number: i32, action: usize) -> usize;
    fn syscall(number: i64, ...) -> i64;
}

/// `struct timespec`.
#[repr(C)]
struct Time {
    s: i64,
    ns: i64,
}

#[cfg(target_arch = "x86_64")]
const SYS_FUTEX: i64 = 202;
#[cfg(not(target_arch = "x86_64"))]
const SYS_FUTEX: i64 = 98;

/// Sleeps until the word is woken, or until a time on the monotonic clock; not at all if the word
/// has another value. May return early.
pub fn wait(word: &AtomicU32, value: u32, until_ns: Option<u64>) {
    const WAIT_UNTIL: i32 = 9 | 128;
    let time = until_ns.map(|ns| Time {
        s: i64::try_from(ns / 1_000_000_000).unwrap_or(i64::MAX),
        ns: i64::try_from(ns % 1_000_000_000).unwrap_or(0),
    });
    let time = time.as_ref().map_or(std::ptr::null(), std::ptr::from_ref);
    let (none, any) = (std::ptr::null::<u32>(), u32::MAX);
    // SAFETY: FUTEX_WAIT_BITSET reads the word and, if there is one, the `timespec`; both
    // live through the call.
    unsafe { syscall(SYS_FUTEX, word.as_ptr(), WAIT_UNTIL, value, time, none, any) };
}

/// Wakes up to `most` threads waiting for the word.
pub fn wake(word: &AtomicU32, most: i32) {
    const WAKE: i32 = 1 | 128;
    // SAFETY: FUTEX_WAKE takes the word's address and reads nothing.
    unsafe { syscall(SYS_FUTEX, word.as_ptr(), WAKE, most) };
}

const SIGINT: i32 = 2;
const SIGTERM: i32 = 15;

/// The number of caught signals asking the program to end.
pub(crate) static ENDS_ASKED: AtomicU32 = AtomicU32::new(0);

/// The signals to catch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Catch {
    All,
    /// The next signal has its usual effect.
    First,
    None,
}

/// Counts SIGINT and SIGTERM in [`ENDS_ASKED`], or lets them end the program.
pub(crate) fn catch_ends(catch: Catch) {
    extern "C" fn count(_signal: i32) {
        ENDS_ASKED.fetch_add(1, Ordering::Release);
        wake(&ENDS_ASKED, i32::MAX);
    }
    extern "C" fn count_first(number: i32) {
        catch_ends(Catch::None);
        count(number);
    }
    const USUAL: usize = 0;
    let action = match catch {
        Catch::All => count as extern "C" fn(i32) as usize,
        Catch::First => count_first as extern "C" fn(i32) as usize,
        Catch::None => USUAL,
    };
    for number in [SIGINT, SIGTERM] {
        // SAFETY: a handler may be called in the middle of anything. These handlers change an
        // atomic number, wake threads and set handlers, and none of this takes a lock.
        unsafe { signal(number, action) };
    }
}

/// Sends a process SIGINT.
pub(crate) fn ask_to_end(process: u32) {
    let Ok(process @ 1..) = i32::try_from(process) else {
        return; // others would be groups
    };
    // SAFETY: the call takes numbers.
    unsafe { kill(process, SIGINT) };
}
