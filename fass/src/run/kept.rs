//! States that are written down, so that a replay can begin with a later job than the first one.
//!
//! The first subtask that may change a state in a job finds there what all jobs before have left.
//! So much is written down every so many jobs, before its function is called, and goes to the
//! platform as a sample does: when the instance is complete, or has failed.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU32, Ordering};

use recording::{Recordable, Schema};

use super::effect::Effect;
use super::line::{Found, Line};
use super::plan::{Replacement, Subtask};
use super::reset::Resettable;
use super::sampling::Around;

/// A state that is written down, of whatever type.
pub(crate) trait AnyState: Send + Sync {
    fn schema(&self) -> Schema;

    /// Writes down what it is now, unless somebody changes it.
    fn stage(&self, line: &Line, job: u64);

    /// Makes it what was written down; `false`: it cannot be.
    fn restore(&self, bytes: &[u8]) -> bool;
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

/// A state that is written down, and how often.
pub(crate) struct KeptState {
    pub(crate) state: Arc<dyn AnyState>,
    /// It is written down in each job whose number is a multiple of that.
    every: AtomicU32,
}

impl KeptState {
    pub(crate) fn new(state: Arc<dyn AnyState>, every: u32) -> Self {
        Self {
            state,
            every: AtomicU32::new(every.max(1)),
        }
    }

    /// Has it written down every so many jobs, if that is more often.
    pub(crate) fn keep_every(&self, jobs: u32) {
        self.every.fetch_min(jobs.max(1), Ordering::Relaxed);
    }

    /// Returns what is put around the first subtask that may change it in a job.
    pub(super) fn around(self: Arc<Self>, line: Arc<Line>) -> Around {
        Box::new(move |body| {
            let effect: Box<dyn Effect> = Box::new(Found(Arc::clone(&line)));
            let keep = |subtask| {
                Box::new(Keeping {
                    subtask,
                    kept: self,
                    line,
                }) as _
            };
            let mut body = body.wrapped(keep);
            body.add_effects([effect]);
            body
        })
    }
}

/// A subtask that writes a state down before it may change that.
struct Keeping {
    subtask: Box<dyn Subtask>,
    kept: Arc<KeptState>,
    line: Arc<Line>,
}

impl Subtask for Keeping {
    fn take_turn(&mut self, job: u64) {
        if job.is_multiple_of(self.kept.every.load(Ordering::Relaxed).into()) {
            self.kept.state.stage(&self.line, job);
        }
        self.subtask.take_turn(job);
    }

    fn discard(&mut self, job: u64) {
        self.subtask.discard(job);
    }

    fn replacement(&self) -> Option<Replacement> {
        self.subtask.replacement()
    }

    fn replace(&mut self) {
        self.subtask.replace();
    }

    fn forget(self: Box<Self>) {
        self.subtask.forget();
    }
}
