//! Lock sections, made mutually exclusive by a mutex and a condition variable.
//!
//! A section's holder can be preempted. The holder then gets its core back when nothing else has
//! the core, and gives the lock back. A thread whose instance is ended in a section may never do
//! so, and is *given up*: nobody waits for the thread any more. Since the thread keeps its claim on
//! the data until its function returns, the next thread entering sees that the lock is lost.

use std::cell::Cell;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use fass::platform::LockWords;

use crate::clock;

/// The threads given up. Locked by any thread reading or changing a lock's words.
static GIVEN_UP: Mutex<Vec<u32>> = Mutex::new(Vec::new());
static RELEASED: Condvar = Condvar::new();

thread_local! {
    static IS_IN_SECTION: Cell<bool> = const { Cell::new(false) };
    /// The number of this thread, never 0 and never used by another thread.
    static OWN: u32 = {
        static LATEST: AtomicU32 = AtomicU32::new(0);
        LATEST.fetch_add(1, Relaxed) + 1
    };
}

/// Returns the number of the calling thread.
pub(crate) fn own() -> u32 {
    OWN.with(|own| *own)
}

/// Makes room for so many given-up threads.
pub(crate) fn make_room(threads: usize) {
    given_up().reserve(threads);
}

/// Gives a thread up: nobody waits for its present section, and it enters no further one.
pub(crate) fn give_up(thread: u32) {
    given_up().push(thread);
    // All, as the waiting threads may want different locks.
    RELEASED.notify_all();
}

/// Notes that the calling thread, perhaps given up, is about to end.
pub(crate) fn forget() {
    given_up().retain(|thread| *thread != own());
}

/// Waits for a lock, and calls `section` under the lock. Returns the duration of the call in
/// nanoseconds; `None`, without a call, if the caller is in a section already.
pub(crate) fn with(lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
    if IS_IN_SECTION.replace(true) {
        return None;
    }
    let (own, mut given_up) = (own(), given_up());
    loop {
        assert!(
            !given_up.contains(&own),
            "an instance whose budget is exceeded enters a section; state a longer budget"
        );
        let holder = lock.state.load(Relaxed);
        if holder == 0 || given_up.contains(&holder) {
            break;
        }
        given_up = (RELEASED.wait(given_up)).unwrap_or_else(PoisonError::into_inner);
    }
    lock.state.store(own, Relaxed);
    drop(given_up);
    // A panic ends the section, too.
    let _held = Held(lock);
    let entered_ns = clock::now_ns();
    section();
    Some(clock::now_ns().saturating_sub(entered_ns))
}

fn given_up() -> MutexGuard<'static, Vec<u32>> {
    GIVEN_UP.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Held<'l>(&'l LockWords);

impl Drop for Held<'_> {
    fn drop(&mut self) {
        let words = given_up();
        // If this thread was given up, the lock may belong to another thread by now.
        let _ = (self.0.state).compare_exchange(own(), 0, Relaxed, Relaxed);
        drop(words);
        RELEASED.notify_all();
        IS_IN_SECTION.set(false);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU64;
    use std::sync::mpsc;
    use std::thread;

    use super::*;

    #[test]
    fn one_that_is_given_up_holds_nobody_up_and_gives_back_nobody_elses_lock() {
        let lock = &LockWords {
            state: AtomicU32::new(0),
            waiting: [const { AtomicU64::new(0) }; 4],
        };
        thread::scope(|scope| {
            let (tell, told) = mpsc::channel();
            let (end, ends) = mpsc::channel::<()>();
            let late = scope.spawn(move || {
                with(lock, &mut || {
                    tell.send(own()).unwrap();
                    // It ends with an error, as the sender is gone.
                    let _ = ends.recv();
                })
            });
            give_up(told.recv().unwrap());
            let mut late = Some((end, late));
            let entered = with(lock, &mut || {
                if let Some((end, late)) = late.take() {
                    drop(end);
                    late.join().unwrap();
                }
                assert_eq!(lock.state.load(Relaxed), own());
            });
            assert!(entered.is_some());
        });
        assert_eq!(lock.state.load(Relaxed), 0);
    }
}
