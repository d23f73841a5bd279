//! Waiting for another core.
//!
//! A DAG needs no events: in a DAG an instance becomes ready when its inputs are there. Events
//! serve programs outside the model, such as the publish/subscribe baseline in the comparison with
//! DAGs.
//!
//! An [`Event`] is a count that only goes up: its *version*. A waiter reads the version, then looks
//! for its condition. If the condition does not hold, the waiter waits until the version has
//! changed. Because the version is read before the condition, no later change is missed:
//!
//! ```no_run
//! # use kernel::{Event, Lock};
//! # fn take(_: &Lock<Vec<u32>>) -> Option<u32> { None }
//! # fn next(event: &Event, data: &Lock<Vec<u32>>) -> u32 {
//! loop {
//!     let seen = event.version();
//!     match take(data) {
//!         Some(value) => return value,
//!         None => event.wait(seen, u64::MAX),
//!     }
//! }
//! # }
//! ```
//!
//! A waiting core halts. Its instance keeps the core, because the scheduler knows nothing of the
//! wait.

use core::sync::atomic::{AtomicU64, Ordering};

use executive::machine::timer::{self, Alarm};
use executive::machine::{clock, interrupt_flag, this_core, time_slice};
use executive::text::console;

/// An event that cores can wait for.
///
/// ```no_run
/// use kernel::Event;
///
/// static NEWS: Event = Event::new();
///
/// /// Waits until somebody calls `NEWS.notify()`, at most to a time of `fass::now_ns`.
/// fn has_news(until_ns: u64) -> bool {
///     let seen = NEWS.version();
///     // look for what is wanted; if it is not there:
///     NEWS.wait(seen, until_ns);
///     NEWS.version() != seen
/// }
/// ```
#[derive(Debug, Default)]
pub struct Event {
    version: AtomicU64,
    /// The cores waiting now, or since the last notice, as bits.
    waiting: [AtomicU64; 4],
}

impl Event {
    /// Makes an event that has not happened.
    pub const fn new() -> Self {
        Self {
            version: AtomicU64::new(0),
            waiting: [const { AtomicU64::new(0) }; 4],
        }
    }

    /// Returns how often the event has happened.
    pub fn version(&self) -> u64 {
        self.version.load(Ordering::SeqCst)
    }

    /// Raises the version, and so lets all waiters go on.
    pub fn notify(&self) {
        self.version.fetch_add(1, Ordering::SeqCst);
        for (word, first) in self.waiting.iter().zip((0..).step_by(64)) {
            let mut left = word.swap(0, Ordering::SeqCst);
            while left != 0 {
                // For one waiter at a time: `wake_up` must stay on one core, and no section be
                // long.
                let were_enabled = interrupt_flag::disable();
                let core = &this_core::all()[first + left.trailing_zeros() as usize];
                // A core may have gone on to another context by now; leave that undisturbed.
                if core.context().awaits(self.address()) {
                    core.wake_up();
                }
                interrupt_flag::restore(were_enabled);
                left &= left - 1;
            }
        }
    }

    /// Halts the calling instance's core until the version differs from `seen` or the time
    /// `until_ns` has come, on the clock of [`fass::now_ns`]; `u64::MAX` means no limit. An idle
    /// core sends text waiting to be printed.
    ///
    /// No notice is lost. The waiter sets the context's note and the bit before comparing the
    /// version, and the notifier changes the version before taking the bits: at least one of the
    /// two sees the other (both orders are sequentially consistent). If the notifier sees the
    /// waiter, its interrupt comes after interrupts were disabled here, and so ends the halt. If
    /// the notifier finds another context on the core, the halt has ended already, and the version
    /// is compared again.
    pub fn wait(&self, seen: u64, until_ns: u64) {
        loop {
            interrupt_flag::disable();
            // Read in every round: in between, the instance may have moved to another core.
            let core = this_core::get();
            let here = core.index;
            let word = &self.waiting[(here / 64) as usize];
            core.context().note_awaited(self.address());
            word.fetch_or(1 << (here % 64), Ordering::SeqCst);
            if self.version() != seen || clock::now_ns() >= until_ns {
                // The bit stays set, but without the note it has no effect.
                core.context().note_awaited(0);
                time_slice::end_hold(core);
                time_slice::enter();
                interrupt_flag::enable();
                return;
            }
            if console::has_pending() {
                interrupt_flag::enable();
                console::send_pending_byte();
                continue;
            }
            time_slice::leave(core);
            timer::set(Alarm::Hold, until_ns);
            interrupt_flag::enable_and_halt();
        }
    }

    fn address(&self) -> usize {
        core::ptr::from_ref(self).addr()
    }
}
