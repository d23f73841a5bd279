//! The jobs of one DAG that are due and not released, as runs of consecutive numbers.
//!
//! Under overload any number of jobs waits, and for most of them the same events are known: they
//! were queued, missed their deadlines, or were skipped. So jobs with consecutive numbers and the
//! same events form one *run*, with the moments of the job that joined the run last. The number of
//! runs stays near the number of kinds of events, however many jobs wait.

use alloc::collections::BTreeMap;

use super::StepTime;
use super::jobs::JobState;

/// Runs by their first numbers.
#[derive(Default)]
pub(super) struct Backlog(BTreeMap<u64, WaitingRun>);

#[derive(Clone, Copy)]
struct WaitingRun {
    /// The number after the run's last job.
    end: u64,
    queued: Option<StepTime>,
    skipped: Option<StepTime>,
    missed: Option<StepTime>,
}

impl WaitingRun {
    fn is_like(&self, other: &Self) -> bool {
        let happened = |run: &Self| [run.queued, run.skipped, run.missed].map(|at| at.is_some());
        happened(self) == happened(other)
    }
}

impl Backlog {
    /// Returns the run of a job, and its first number.
    fn find(&self, job: u64) -> Option<(u64, WaitingRun)> {
        let (&first, &run) = self.0.range(..=job).next_back()?;
        (job < run.end).then_some((first, run))
    }

    pub(super) fn contains(&self, job: u64) -> bool {
        self.find(job).is_some()
    }

    /// Takes a job out, and splits its run if needed.
    pub(super) fn take(&mut self, job: u64) -> Option<JobState> {
        let (first, run) = self.find(job)?;
        self.0.remove(&first);
        if first < job {
            self.0.insert(first, WaitingRun { end: job, ..run });
        }
        if job.saturating_add(1) < run.end {
            self.0.insert(job.saturating_add(1), run);
        }
        Some(JobState {
            queued: run.queued,
            skipped: run.skipped,
            missed: run.missed,
            ..JobState::default()
        })
    }

    /// Adds a new job, and joins runs with the same events.
    pub(super) fn put(&mut self, job: u64, state: &JobState) {
        let (mut first, mut run) = (
            job,
            WaitingRun {
                end: job.saturating_add(1),
                queued: state.queued,
                skipped: state.skipped,
                missed: state.missed,
            },
        );
        if let Some((before, earlier)) = job.checked_sub(1).and_then(|before| self.find(before))
            && earlier.is_like(&run)
        {
            first = before;
        }
        if let Some(later) = self
            .0
            .get(&run.end)
            .copied()
            .filter(|later| later.is_like(&run))
        {
            self.0.remove(&run.end);
            run.end = later.end;
        }
        self.0.insert(first, run);
    }

    /// Forgets skipped jobs before a complete job, starting with the first run.
    pub(super) fn forget_before(&mut self, job: u64) {
        while let Some(entry) = self.0.first_entry()
            && *entry.key() < job
            && entry.get().skipped.is_some()
        {
            let run = entry.remove();
            if job < run.end {
                self.0.insert(job, run);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::CoreId;

    #[test]
    fn jobs_of_which_the_same_is_known_are_one_run() {
        let (mut backlog, at) = (Backlog::default(), |time_ns| {
            let core = CoreId(0);
            let step = 0;
            Some(StepTime {
                time_ns,
                core,
                step,
            })
        });
        let queued = JobState {
            queued: at(1),
            ..JobState::default()
        };
        (0..100_000).for_each(|job| backlog.put(job, &queued));
        assert_eq!(backlog.0.len(), 1);
        for job in 0..50_000 {
            let mut missed = backlog.take(job).expect("it waits");
            missed.missed = at(job);
            backlog.put(job, &missed);
        }
        assert_eq!(backlog.0.len(), 2, "those that are late, and the others");
        let taken = backlog.take(70_000).expect("it waits");
        assert!(taken.queued.is_some() && taken.missed.is_none());
        assert!(!backlog.contains(70_000) && backlog.contains(69_999) && backlog.contains(70_001));
        assert!(backlog.take(70_000).is_none());
        backlog.put(
            70_000,
            &JobState {
                skipped: at(2),
                ..taken
            },
        );
        assert_eq!(backlog.0.len(), 4);
        for job in 0..50_000 {
            let mut skipped = backlog.take(job).expect("it waits");
            skipped.skipped = at(3);
            backlog.put(job, &skipped);
        }
        backlog.forget_before(40_000);
        assert!(!backlog.contains(39_999) && backlog.contains(40_000));
        assert_eq!(backlog.0.len(), 4);
    }
}
