//! The times that bodies have read.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

/// The times of all stamping bodies of a DAG, in nanoseconds on the clock of
/// [`fass::now_ns`].
#[derive(Clone, Debug, Default)]
pub struct Stamps {
    /// By subtask; job by job, within a job first and last instruction.
    times: Vec<Arc<[AtomicU64]>>,
}

/// What one body writes its times with.
#[derive(Debug)]
pub struct Pen {
    times: Arc<[AtomicU64]>,
    next: usize,
}

impl Pen {
    /// Makes a pen by itself with room for a given number of times.
    #[must_use]
    pub fn new(times: usize) -> Self {
        Self {
            times: (0..times).map(|_| AtomicU64::new(0)).collect(),
            next: 0,
        }
    }

    /// Reads the clock and keeps the time, as long as there is room.
    #[inline]
    pub fn stamp(&mut self) {
        self.put(fass::now_ns());
    }

    /// Keeps a time, as long as there is room.
    #[inline]
    pub fn put(&mut self, time_ns: u64) {
        if let Some(place) = self.times.get(self.next) {
            place.store(time_ns, Ordering::Relaxed);
        }
        self.next += 1;
    }

    /// Returns all times.
    pub fn times(&self) -> impl Iterator<Item = u64> + Clone {
        self.times.iter().map(|time| time.load(Ordering::Relaxed))
    }
}

impl Stamps {
    /// Makes a pen for the next subtask's body, which writes twice a job.
    #[must_use]
    pub fn pen(&mut self, jobs: u64) -> Pen {
        let pen = Pen::new(
            usize::try_from(jobs)
                .unwrap_or(usize::MAX)
                .saturating_mul(2),
        );
        self.times.push(Arc::clone(&pen.times));
        pen
    }

    /// Leaves the next subtask without times.
    pub(crate) fn no_pen(&mut self) {
        self.times.push(Arc::new([]));
    }

    /// Returns when a body's first instruction was, if it stamped.
    #[must_use]
    pub fn first(&self, subtask: usize, job: u64) -> Option<u64> {
        self.time(subtask, job, 0)
    }

    /// Returns when a body's last instruction was, if it stamped.
    #[must_use]
    pub fn last(&self, subtask: usize, job: u64) -> Option<u64> {
        self.time(subtask, job, 1)
    }

    fn time(&self, subtask: usize, job: u64, which: usize) -> Option<u64> {
        let index = usize::try_from(job).ok()?.checked_mul(2)? + which;
        let time = self.times.get(subtask)?.get(index)?.load(Ordering::Relaxed);
        (time > 0).then_some(time)
    }
}
