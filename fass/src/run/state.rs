//! A state's value, and those that take its place after faults.
//!
//! A subtask that a fault has ended may have left a state half changed, and its claim of
//! the value is never given back. So the value is given up with it: the next use finds
//! the next of the values that the app has given for that, all made at the commit.
//!
//! A state may be written down, so that a replay can begin with a later job than the first one. The
//! first subtask that may change a state in a job finds there what all jobs before have left.
//! So much is written down every so many jobs, before its function is called, and goes to the
//! platform as a sample does: when the instance is complete, or has failed.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicUsize, Ordering};

use recording::{Recordable, Schema};

use super::cell::{SetOnce, Shared};
use super::line::{AnyState, Line};

/// The values of a state, one after the other.
#[doc(hidden)]
pub struct Resettable<T> {
    first: Shared<T>,
    /// The values after faults; none where no fault is survived.
    others: SetOnce<Box<[Shared<T>]>>,
    resets: AtomicUsize,
}

/// A state of whatever type.
#[doc(hidden)]
pub trait Reset: Send + Sync {
    /// Gives up the present value.
    fn reset(&self);
}

impl<T> Resettable<T> {
    pub(crate) const fn new(first: T) -> Self {
        Self {
            first: Shared::new(first),
            others: SetOnce::new(),
            resets: AtomicUsize::new(0),
        }
    }

    /// Provides the values after faults, once.
    pub(crate) fn provide(&self, values: impl Iterator<Item = T>) {
        self.others.set(values.map(Shared::new).collect());
    }

    /// Returns the present value. There is one for each fault that is survived.
    #[inline]
    pub(crate) fn present(&self) -> &Shared<T> {
        match self.resets.load(Ordering::Acquire) {
            0 => &self.first,
            resets => self.after(resets),
        }
    }

    #[cold]
    fn after(&self, resets: usize) -> &Shared<T> {
        let value = self.others.get().and_then(|others| others.get(resets - 1));
        value.unwrap_or(&self.first)
    }
}

impl<T: Send + Sync> Reset for Resettable<T> {
    fn reset(&self) {
        self.resets.fetch_add(1, Ordering::Release);
    }
}

impl<T: Recordable + Send + Sync> AnyState for Resettable<T> {
    fn schema(&self) -> Schema {
        T::schema()
    }

    fn stage(&self, line: &Line, job: u64) {
        if let Some(value) = self.present().look() {
            line.stage::<T>(job, |out| value.encode(out));
        }
    }

    fn restore(&self, bytes: &[u8]) -> bool {
        let restored = T::from_bytes(bytes).ok().zip(self.present().change());
        let restored = restored.map(|(value, mut place)| *place = value);
        restored.is_some()
    }
}
