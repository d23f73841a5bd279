//! What had no room: which jobs' values of a channel, and whether anything else.
//!
//! Completions note them, one at a time; the drain tells of them before the channel's next value.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use crate::run::crossing::Recorded;

/// The most runs of jobs that are noted.
const MOST_RUNS: usize = 32;

/// Runs of lost jobs.
pub(super) struct LostJobs {
    /// The first and the last job of each.
    runs: [[AtomicU64; 2]; MOST_RUNS],
    /// How many have been written, and read, in all.
    written: AtomicUsize,
    read: AtomicUsize,
}

impl LostJobs {
    pub(super) const fn new() -> Self {
        Self {
            runs: [const { [const { AtomicU64::new(0) }; 2] }; MOST_RUNS],
            written: AtomicUsize::new(0),
            read: AtomicUsize::new(0),
        }
    }

    /// Notes a job, which is after those before; `false`: they are too many.
    pub(super) fn note(&self, job: u64) -> bool {
        let written = self.written.load(Ordering::Relaxed);
        let read = self.read.load(Ordering::Acquire);
        // The run before goes on. Nobody reads it yet, for that takes a value of a later job, and
        // between that and this one there would be a job.
        if written > read
            && let [_, last] = &self.runs[(written - 1) % MOST_RUNS]
            && last.load(Ordering::Relaxed) + 1 == job
        {
            last.store(job, Ordering::Release);
            return true;
        }
        if written - read == MOST_RUNS {
            return false;
        }
        for end in &self.runs[written % MOST_RUNS] {
            end.store(job, Ordering::Relaxed);
        }
        self.written.store(written + 1, Ordering::Release);
        true
    }

    /// Takes the next run if it comes before a job whose value is there, or at the end.
    pub(super) fn take(&self, before: Option<u64>) -> Option<(u64, u64)> {
        let read = self.read.load(Ordering::Relaxed);
        if read == self.written.load(Ordering::Acquire) {
            return None;
        }
        let ends = self.runs[read % MOST_RUNS].each_ref();
        let [first, last] = ends.map(|end| end.load(Ordering::Acquire));
        if before.is_some_and(|before| first >= before) {
            return None;
        }
        self.read.store(read + 1, Ordering::Release);
        Some((first, last))
    }
}

/// What is lost.
#[derive(Clone)]
pub(super) struct Lost {
    /// By channel.
    pub(super) values: Arc<[LostJobs]>,
    /// When something happened that had no room; `u64::MAX`: there was nothing.
    pub(super) rest_ns: Arc<AtomicU64>,
}

impl Lost {
    /// Notes a value. It happens at completions, under the scheduler's lock.
    #[cold]
    pub(super) fn note(&self, value: &Recorded<'_>, at_ns: u64) {
        let jobs = self.values.get(usize::from(value.channel));
        if jobs.is_some_and(|jobs| !jobs.note(value.job)) {
            self.end(at_ns);
        }
    }

    /// Ends the recording, unless it has ended before.
    #[cold]
    pub(super) fn end(&self, at_ns: u64) {
        self.rest_ns.fetch_min(at_ns, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_told_before_the_next_value_and_the_rest_at_the_end() {
        let lost = LostJobs::new();
        for job in [3, 4, 5, 7, 9, 10] {
            assert!(lost.note(job));
        }
        assert_eq!(lost.take(Some(2)), None);
        assert_eq!(lost.take(Some(8)), Some((3, 5)));
        assert_eq!(lost.take(Some(8)), Some((7, 7)));
        assert_eq!(lost.take(Some(8)), None);
        assert_eq!((lost.take(None), lost.take(None)), (Some((9, 10)), None));
        let noted = (0..100).filter(|run| lost.note(2 * run)).count();
        assert_eq!(noted, MOST_RUNS, "more are refused");
        assert!(lost.take(None).is_some() && lost.note(1000), "one is gone");
    }
}
