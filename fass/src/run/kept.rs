//! States that are written down, so that a replay can begin with a later job than the first one.
//!
//! The first subtask that may change a state in a job finds there what all jobs before have left.
//! So much is written down every so many jobs, before its function is called, and goes to the
//! platform as a sample does: when the instance is complete, or has failed.

use alloc::boxed::Box;
use alloc::sync::Arc;

use recording::{Recordable, Schema};

use super::effect::Effect;
use super::line::{AnyState, Found, KeptState, Line};
use super::plan::{Replacement, Subtask};
use super::reset::Resettable;
use super::sampling::Around;

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

/// Returns what is put around the first subtask that may change a state in a job.
pub(super) fn around(kept: Arc<KeptState>, line: Arc<Line>) -> Around {
    Box::new(move |body| {
        let effect: Box<dyn Effect> = Box::new(Found(Arc::clone(&line)));
        let keep = |subtask| {
            Box::new(Keeping {
                subtask,
                kept,
                line,
            }) as _
        };
        let mut body = body.wrapped(keep);
        body.add_effects([effect]);
        body
    })
}

/// A subtask that writes a state down before it may change that.
struct Keeping {
    subtask: Box<dyn Subtask>,
    kept: Arc<KeptState>,
    line: Arc<Line>,
}

impl Subtask for Keeping {
    fn take_turn(&mut self, job: u64) {
        if self.kept.is_due(job) {
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
