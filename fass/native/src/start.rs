//! The common start of all workers: nobody begins before all are pinned.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use crate::pin::{Pinning, pin, processors};
use crate::relax::poll;

thread_local! {
    static WORKER: Cell<Option<u32>> = const { Cell::new(None) };
}

/// Returns the calling worker's number, from 0; `None` outside of subtasks.
#[must_use]
pub fn worker() -> Option<u32> {
    WORKER.get()
}

/// What the workers of a run wait for.
pub(crate) struct Start {
    processors: Vec<u32>,
    to_come: AtomicU32,
    all_pinned: AtomicBool,
}

impl Start {
    /// Makes it for so many workers.
    pub(crate) fn new(workers: u32) -> Self {
        let processors = processors();
        let enough = processors.len() >= workers as usize;
        Self {
            processors,
            to_come: AtomicU32::new(workers),
            all_pinned: AtomicBool::new(enough),
        }
    }

    /// Pins the calling worker, and returns when all have done so.
    pub(crate) fn ready(&self, worker: u32) {
        WORKER.set(Some(worker));
        let is_pinned = self.all_pinned.load(Ordering::Relaxed)
            && self
                .processors
                .get(worker as usize)
                .is_some_and(|&processor| pin(processor));
        if !is_pinned {
            self.all_pinned.store(false, Ordering::Relaxed);
        }
        self.to_come.fetch_sub(1, Ordering::AcqRel);
        poll(|| (self.to_come.load(Ordering::Acquire) == 0).then_some(()));
    }

    /// Reports whether all were pinned.
    pub(crate) fn pinning(&self) -> Pinning {
        if self.all_pinned.load(Ordering::Relaxed) {
            Pinning::Pinned
        } else {
            Pinning::Free
        }
    }
}
