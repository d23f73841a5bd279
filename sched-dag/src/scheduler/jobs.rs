//! The jobs of one DAG: ahead, waiting, in flight.
//!
//! Words: a job is *due* at its nominal release time O + kT. A due job is
//! released at once, skipped, or *waits*. From its release to the end of its
//! last instance it is *in flight*. Jobs in flight are known by sequence number
//! (see [`joins`](super::joins)); they end in that order, because each instance
//! waits for that of the job before.
//!
//! A job's release is *blocked* while the job with its number minus the jobs in
//! flight, J, or an older one, is in flight: both would use the same slot of
//! every edge, which is the job's number modulo J. Without skipped jobs this is
//! the same as J jobs being in flight.
//!
//! *Judging* a job is to find out whether it meets its deadline; jobs are
//! judged in the order of their numbers, each once.

use alloc::boxed::Box;
use alloc::vec;

use super::joins::slot;
use crate::task_set::Dag;

/// The jobs of one DAG.
#[derive(Debug)]
pub(super) struct Jobs {
    /// The jobs in flight, by slot of their sequence number.
    in_flight: Box<[Job]>,
    /// The sequence number of the oldest job in flight.
    pub(super) oldest: u64,
    /// The sequence number of the next job to be released.
    pub(super) next: u64,
    /// The sequence number of the first job in flight that is not judged.
    judged: u64,
    /// The sequence number of the first job in flight that is not aborted.
    pub(super) aborted: u64,
    /// Whether the DAG is ended: no job is released, and none in flight starts
    /// a further instance.
    ended: bool,
    /// The first job that is not due yet.
    next_due: u64,
    /// Its nominal release time; `None`: there is no further job.
    next_due_ns: Option<u64>,
    /// The first job that waits; all up to `next_due` do.
    first_waiting: u64,
    /// The first waiting job that is not judged.
    judged_waiting: u64,
}

/// A job in flight.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Job {
    /// The job's number on the nominal grid.
    pub(super) number: u64,
    /// The instances that have not ended.
    pub(super) unfinished: u32,
    /// Whether its deadline has passed before it was complete.
    pub(super) missed: bool,
}

impl Jobs {
    pub(super) fn new(dag: &Dag) -> Self {
        Self {
            in_flight: vec![Job::default(); dag.in_flight() as usize].into_boxed_slice(),
            oldest: 0,
            next: 0,
            judged: 0,
            aborted: 0,
            ended: false,
            next_due: 0,
            next_due_ns: due_ns(dag, 0),
            first_waiting: 0,
            judged_waiting: 0,
        }
    }

    /// Returns the job in flight with a sequence number.
    pub(super) fn job(&self, sequence: u64) -> &Job {
        &self.in_flight[slot(sequence, self.in_flight.len() as u64)]
    }

    pub(super) fn job_mut(&mut self, sequence: u64) -> &mut Job {
        &mut self.in_flight[slot(sequence, self.in_flight.len() as u64)]
    }

    /// Reports whether there is neither a job in flight, nor one waiting, nor
    /// one ahead: the DAG is ended, or has a limit of jobs and is there.
    pub(super) fn are_over(&self, dag: &Dag) -> bool {
        self.oldest == self.next
            && self.waiting() == 0
            && (self.ended || dag.jobs().is_some_and(|jobs| self.next_due >= jobs))
    }

    pub(super) fn waiting(&self) -> u64 {
        self.next_due - self.first_waiting
    }

    pub(super) fn is_waiting(&self, number: u64) -> bool {
        (self.first_waiting..self.next_due).contains(&number)
    }

    /// Returns the first waiting job, if there is one and it is not blocked.
    pub(super) fn releasable(&self) -> Option<u64> {
        let number = self.first_waiting;
        let blocked = self.oldest < self.next
            && number - self.job(self.oldest).number >= self.in_flight.len() as u64;
        (self.waiting() > 0 && !blocked).then_some(number)
    }

    /// Lets the next job that is due at `now_ns` wait, and returns it with its
    /// nominal release time.
    pub(super) fn take_due(&mut self, dag: &Dag, now_ns: u64) -> Option<(u64, u64)> {
        let release_ns = self
            .next_due_ns
            .filter(|&release_ns| release_ns <= now_ns)?;
        let number = self.next_due;
        self.next_due += 1;
        self.next_due_ns = due_ns(dag, self.next_due);
        Some((number, release_ns))
    }

    /// Releases the first waiting job and returns its sequence number.
    pub(super) fn release_waiting(&mut self, subtasks: u32) -> u64 {
        let sequence = self.next;
        let number = self.first_waiting;
        self.first_waiting += 1;
        self.next += 1;
        let missed = number < self.judged_waiting;
        *self.job_mut(sequence) = Job {
            number,
            unfinished: subtasks,
            missed,
        };
        if missed {
            // Judged in order: so all in flight are.
            self.judged = self.next;
        }
        sequence
    }

    /// Drops the first waiting job and returns it.
    pub(super) fn skip_waiting(&mut self) -> u64 {
        self.first_waiting += 1;
        self.first_waiting - 1
    }

    /// Marks the oldest job in flight that is not aborted, and returns its
    /// sequence number. It is judged by that.
    pub(super) fn abort_oldest(&mut self) -> Option<u64> {
        let sequence = self.aborted.max(self.oldest);
        if sequence == self.next {
            return None;
        }
        self.aborted = sequence + 1;
        self.judged = self.judged.max(self.aborted);
        Some(sequence)
    }

    pub(super) fn is_aborted(&self, sequence: u64) -> bool {
        sequence < self.aborted
    }

    /// Reports whether a job starts no further instance: it is aborted, or the
    /// DAG is ended.
    pub(super) fn is_cut(&self, sequence: u64) -> bool {
        self.ended || self.is_aborted(sequence)
    }

    pub(super) fn is_ended(&self) -> bool {
        self.ended
    }

    /// Drops all that waits and all that is ahead, and lets those in flight
    /// start no further instance. All jobs are judged by that. Returns how many
    /// were in flight and not aborted, and how many waited.
    pub(super) fn end_all(&mut self) -> (u64, u64) {
        let cut_short = self.next - self.aborted.max(self.oldest);
        let dropped = self.waiting();
        self.ended = true;
        self.judged = self.next;
        self.next_due_ns = None;
        self.first_waiting = self.next_due;
        (cut_short, dropped)
    }

    /// Takes the oldest job out of flight, all of whose instances have ended.
    pub(super) fn end_oldest(&mut self) {
        self.oldest += 1;
        self.judged = self.judged.max(self.oldest);
    }

    /// Returns the first job that is not judged and is in flight or waits, with
    /// its deadline.
    fn first_unjudged(&self, dag: &Dag) -> Option<(u64, u64)> {
        let number = if self.judged < self.next {
            self.job(self.judged).number
        } else {
            self.first_waiting.max(self.judged_waiting)
        };
        (number < self.next_due).then(|| (number, deadline_ns(dag, number)))
    }

    /// Judges the next job whose deadline has passed before `now_ns`: it is
    /// late. Returns it with its deadline.
    pub(super) fn take_late(&mut self, dag: &Dag, now_ns: u64) -> Option<(u64, u64)> {
        let late = self
            .first_unjudged(dag)
            .filter(|&(_, deadline_ns)| deadline_ns < now_ns)?;
        if self.judged < self.next {
            self.job_mut(self.judged).missed = true;
            self.judged += 1;
        } else {
            self.judged_waiting = late.0 + 1;
        }
        Some(late)
    }

    /// Returns when something happens to these jobs without a completion: a
    /// release becomes due, or a deadline has passed. A release that no longer
    /// is blocked is due at `now_ns`.
    pub(super) fn next_event_ns(&self, dag: &Dag, now_ns: u64) -> Option<u64> {
        if self.releasable().is_some() {
            return Some(now_ns);
        }
        // The deadline itself is still in time; the next instant is not.
        let late_ns = self
            .first_unjudged(dag)
            .map(|(_, deadline_ns)| deadline_ns + 1);
        match (self.next_due_ns, late_ns) {
            (Some(due_ns), Some(late_ns)) => Some(due_ns.min(late_ns)),
            (due_ns, late_ns) => due_ns.or(late_ns),
        }
    }
}

/// Returns a job's nominal release time; `None` beyond the DAG's limit of jobs,
/// or if the instant after its deadline is not a time.
fn due_ns(dag: &Dag, number: u64) -> Option<u64> {
    if dag.jobs().is_some_and(|jobs| number >= jobs) {
        return None;
    }
    let release_ns = dag
        .period_ns()
        .checked_mul(number)?
        .checked_add(dag.offset_ns())?;
    let deadline_ns = release_ns.checked_add(dag.relative_deadline_ns())?;
    (deadline_ns < u64::MAX).then_some(release_ns)
}

/// Returns the nominal release time of a job that is or was due.
pub(super) fn release_ns(dag: &Dag, number: u64) -> u64 {
    dag.offset_ns() + dag.period_ns() * number
}

/// Returns the absolute deadline of a job that is or was due.
pub(super) fn deadline_ns(dag: &Dag, number: u64) -> u64 {
    release_ns(dag, number) + dag.relative_deadline_ns()
}
