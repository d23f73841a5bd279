//! The jobs of one DAG: ahead, waiting, in flight.
//!
//! Words: a job is *due* at its nominal release time O + kT. A due job is released at once,
//! skipped, or *waits*. From its release to the end of its last instance it is *in flight*. Jobs in
//! flight are known by sequence number (see [`vertices`](super::vertices)); they end in that order,
//! because each instance waits for the instance of the job before.
//!
//! The release of job k is *blocked* while job k - J, or an older job, is in flight, where J is the
//! largest number of jobs allowed in flight. Both jobs would use the same slot of every edge, the
//! job's number modulo J. Without skipped jobs, blocked means that J jobs are in flight.
//!
//! A periodic DAG's jobs are due on the grid. A sporadic DAG's next job is due once a signal has
//! come, at the earliest one minimum inter-arrival time after the job before (the module `signals`
//! has the rules). At most one signal is kept, pending or as a waiting job, so at most one sporadic
//! job waits: the latest due job.
//!
//! The module `judging` compares jobs with their deadlines.

mod judging;

use alloc::boxed::Box;
use core::ops::Range;

use super::phase::DagPhase;
use crate::ids::to_u32;
use crate::policies::Policy;
use crate::policy::JobOutcome;
use crate::task_set::Dag;
use judging::Deadline;

/// The kind of a DAG's next event, and the lane of the class for such events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TimerKind {
    /// The release of an even job.
    EvenRelease,
    /// The release of an odd job.
    OddRelease,
    /// A deadline.
    Deadline,
    /// The release of a blocked job.
    Other,
}

/// The jobs of one DAG.
#[derive(Clone, Debug, Hash)]
pub(super) struct JobTable {
    /// The jobs in flight, by slot of their sequence number.
    in_flight: Box<[Job]>,
    /// The most jobs in flight, J.
    limit: u64,
    /// The number of subtasks without successors.
    ends: u32,
    /// The policy's number, if the policy adds the release and all subtasks have the same number.
    number_ns: u64,
    /// The sequence number of the oldest job in flight.
    pub(super) oldest: u64,
    /// The sequence number of the next job to be released.
    pub(super) next: u64,
    /// The phase of the DAG's life.
    pub(super) phase: DagPhase,
    /// The first job that is not due yet.
    pub(super) next_due: u64,
    /// The nominal release time of `next_due`; `None`: there is no further job, or no signal for
    /// the next job of a sporadic DAG yet.
    next_due_ns: Option<u64>,
    /// The nominal release time of the latest due job.
    last_due_ns: u64,
    /// The first waiting job; all jobs from there to `next_due` wait.
    pub(super) first_waiting: u64,
    /// The first job that is not announced yet: neither released, nor skipped, nor queued. A due
    /// job making room for itself waits before it is announced.
    announced: u64,
    /// For each deadline, ascending, how far jobs are judged.
    pub(super) deadlines: Box<[Deadline]>,
}

/// A job in flight.
#[derive(Clone, Copy, Debug, Default, Hash)]
pub(super) struct Job {
    /// The job's number on the nominal grid.
    pub(super) number: u64,
    /// Its nominal release time.
    pub(super) release_ns: u64,
    /// The release time plus the [number](JobTable::number_ns).
    pub(super) sum_ns: u64,
    /// The instances without successors still to end. Each other instance ends before some of
    /// these.
    pub(super) unfinished: u32,
    /// Its slot, counted over all DAGs.
    pub(super) slot: u32,
    /// Whether its deadline has passed before it was complete.
    pub(super) missed: bool,
    /// The outcome of a *cut* job, which starts no further instance.
    pub(super) cut: Option<JobOutcome>,
}

impl JobTable {
    /// Makes the jobs of a DAG whose slots are counted from `first_slot`.
    #[inline]
    pub(super) fn new(dag: &Dag, policy: Policy, first_slot: u32) -> Self {
        let slots = (first_slot..).take(dag.slots()).map(|slot| Job {
            slot,
            ..Job::default()
        });
        let subtasks = dag.topological_order().iter();
        // A sink with successors, because of a shared state, does not count: it ends before these.
        let ends = subtasks.filter(|&&subtask| dag.successors(subtask).is_empty());
        let numbers = policy.adds_release().then(|| policy.numbers(dag));
        Self {
            in_flight: slots.collect(),
            limit: u64::from(dag.in_flight()),
            ends: to_u32(ends.count()),
            number_ns: numbers.map_or(0, |numbers| numbers[0]),
            oldest: 0,
            next: 0,
            phase: DagPhase::Running,
            next_due: dag.first_job(),
            next_due_ns: due_ns(dag, dag.first_job()),
            last_due_ns: 0,
            first_waiting: dag.first_job(),
            announced: dag.first_job(),
            deadlines: Deadline::all(dag),
        }
    }

    /// Returns the job in flight with a sequence number.
    #[inline]
    pub(super) fn job(&self, sequence: u64) -> &Job {
        &self.in_flight[self.slot(sequence)]
    }

    #[inline]
    pub(super) fn job_mut(&mut self, sequence: u64) -> &mut Job {
        &mut self.in_flight[self.slot(sequence)]
    }

    #[inline]
    fn slot(&self, sequence: u64) -> usize {
        // A mask, as the number of slots is a power of two.
        let slot = sequence & (self.in_flight.len() as u64 - 1);
        #[allow(clippy::cast_possible_truncation, reason = "a count of slots fits")]
        {
            slot as usize
        }
    }

    /// Reports whether no job is in flight, waiting, or ahead: the DAG is closed or ended, or has
    /// come to its limit of jobs, or is sporadic without a limit and has no signal.
    #[inline]
    pub(super) fn are_over(&self, dag: &Dag) -> bool {
        // A sporadic DAG without a limit keeps no run going, unless a signal is pending.
        let none_ahead = match dag.jobs() {
            Some(jobs) => self.next_due >= jobs,
            None => dag.is_sporadic() && self.next_due_ns.is_none(),
        };
        self.oldest == self.next && self.waiting() == 0 && (self.is_closed() || none_ahead)
    }

    /// Returns the job that a signal is for, or for which a signal is kept.
    #[inline]
    pub(super) fn signal_job(&self) -> u64 {
        // A waiting sporadic job is the job before `next_due`, and represents the kept signal.
        self.next_due - self.waiting().min(1)
    }

    /// Makes the next job of a sporadic DAG due at `now_ns`, or as soon afterwards as the minimum
    /// inter-arrival time allows, and returns that time. Returns `None` if the signal is dropped:
    /// an earlier signal is still kept, or no job is left.
    #[inline]
    pub(super) fn signal(&mut self, dag: &Dag, now_ns: u64) -> Option<u64> {
        let limit_reached = dag.jobs().is_some_and(|jobs| self.next_due >= jobs);
        if self.is_closed() || limit_reached || self.waiting() > 0 || self.next_due_ns.is_some() {
            return None;
        }
        let earliest_ns = match self.next_due {
            // Before the first job there is no other job to keep a distance from.
            0 => dag.offset_ns(),
            _ => self.last_due_ns.checked_add(dag.period_ns())?,
        };
        // Never earlier than one minimum inter-arrival time after the job before: the analysis's
        // bounds rest on it.
        let release_ns = now_ns.max(earliest_ns);
        // A job whose deadline is beyond the last representable time is never due: its signal is
        // dropped.
        let deadline_ns = release_ns.checked_add(dag.relative_deadline_ns())?;
        self.next_due_ns = (deadline_ns < u64::MAX).then_some(release_ns);
        self.next_due_ns
    }

    /// Reports whether a job was due before `now_ns` and has not been dealt with.
    #[inline]
    pub(super) fn is_overdue(&self, now_ns: u64) -> bool {
        self.next_due_ns.is_some_and(|due_ns| due_ns < now_ns)
    }

    #[inline]
    pub(super) fn waiting(&self) -> u64 {
        self.next_due - self.first_waiting
    }

    #[inline]
    pub(super) fn is_waiting(&self, number: u64) -> bool {
        (self.first_waiting..self.next_due).contains(&number)
    }

    /// Reports whether no job is in flight, and none waits.
    #[inline]
    pub(super) fn are_at_rest(&self) -> bool {
        self.oldest == self.next && self.first_waiting == self.next_due
    }

    /// Reports whether a job waits, and the first waiting job is not blocked.
    #[inline]
    pub(super) fn are_releasable(&self) -> bool {
        let number = self.first_waiting;
        // By numbers, not by how many are in flight: skipped jobs have used no slot, but their
        // numbers count. Mostly none waits, so that is checked first.
        number < self.next_due
            && (self.oldest == self.next || number - self.job(self.oldest).number < self.limit)
    }

    /// Makes the next job due at `now_ns` wait, and returns the job with its nominal release time.
    #[inline]
    pub(super) fn take_due(&mut self, dag: &Dag, now_ns: u64) -> Option<(u64, u64)> {
        let release_ns = self
            .next_due_ns
            .filter(|&release_ns| release_ns <= now_ns)?;
        let number = self.next_due;
        // The next sporadic job keeps its distance from this one.
        self.last_due_ns = release_ns;
        self.next_due += 1;
        // For a sporadic DAG this is `None`: the next signal sets the time.
        self.next_due_ns = due_ns(dag, self.next_due);
        Some((number, release_ns))
    }

    /// Marks all due jobs as announced.
    #[inline]
    pub(super) fn announce(&mut self) {
        self.announced = self.next_due;
    }

    /// Releases the next job, due between `resumed_ns` and `now_ns`, if nothing else is to be done:
    /// no job is in flight, waits or is due next, and no deadline has passed. Returns the job's
    /// sequence number and the next event.
    #[inline]
    pub(super) fn release_alone(
        &mut self,
        dag: &Dag,
        resumed_ns: u64,
        now_ns: u64,
    ) -> Option<(u64, (u64, TimerKind))> {
        let release_ns = self.next_due_ns?;
        let is_due = resumed_ns <= release_ns && release_ns <= now_ns;
        let late_ns = self.first_deadline_ns(release_ns) + 1;
        let next_due_ns = due_ns(dag, self.next_due + 1);
        let kind = release_kind(self.next_due + 1);
        let event = sooner(next_due_ns.map(|due_ns| (due_ns, kind)), late_ns);
        let is_alone = is_due && self.phase == DagPhase::Running && self.are_at_rest();
        // A late driver finds the deadline or the next release due as well: then their order
        // counts.
        if !is_alone || event.0 <= now_ns {
            return None;
        }
        (self.last_due_ns, self.next_due_ns) = (release_ns, next_due_ns);
        let number = self.next_due;
        self.next_due += 1;
        (self.first_waiting, self.announced) = (self.next_due, self.next_due);
        Some((self.put_in_flight(number, release_ns, false), event))
    }

    /// Releases the first waiting job and returns its sequence number.
    #[inline]
    pub(super) fn release_waiting(&mut self, dag: &Dag) -> u64 {
        let number = self.first_waiting;
        let release_ns = self.waiting_release_ns(dag, number);
        self.first_waiting += 1;
        // A job that waited beyond its deadline is a miss already, and must not be counted twice.
        let missed = self.deadlines[0].has_judged_waiting(number);
        for deadline in &mut self.deadlines {
            deadline.release(number, self.next);
        }
        self.put_in_flight(number, release_ns, missed)
    }

    /// Takes a job into flight, and returns its sequence number.
    #[inline]
    fn put_in_flight(&mut self, number: u64, release_ns: u64, missed: bool) -> u64 {
        let sequence = self.next;
        self.next += 1;
        // The job is complete when this many instances without successors have ended (R4).
        let (unfinished, number_ns) = (self.ends, self.number_ns);
        let job = self.job_mut(sequence);
        *job = Job {
            number,
            release_ns,
            sum_ns: release_ns + number_ns,
            unfinished,
            // The slot belongs to the place, not to the job; keys are made from it.
            slot: job.slot,
            missed,
            cut: None,
        };
        sequence
    }

    /// Drops the first waiting job and returns it with its nominal release time.
    #[inline]
    pub(super) fn skip_waiting(&mut self, dag: &Dag) -> (u64, u64) {
        let number = self.first_waiting;
        let release_ns = self.waiting_release_ns(dag, number);
        self.first_waiting += 1;
        (number, release_ns)
    }

    /// Drops all waiting jobs, and returns their numbers.
    #[inline]
    pub(super) fn skip_all_waiting(&mut self) -> Range<u64> {
        let waiting = self.first_waiting..self.next_due;
        self.first_waiting = self.next_due;
        waiting
    }

    /// Returns the nominal release time of a waiting job, or of a job that has been skipped since.
    #[inline]
    pub(super) fn waiting_release_ns(&self, dag: &Dag, number: u64) -> u64 {
        if dag.is_sporadic() {
            debug_assert_eq!(number + 1, self.next_due, "one sporadic job waits");
            self.last_due_ns
        } else {
            dag.offset_ns() + dag.period_ns() * number
        }
    }

    /// Returns the first job from this number on that is in flight or may still be released.
    pub(super) fn next_open(&self, dag: &Dag, number: i64) -> Option<u64> {
        let from = u64::try_from(number).unwrap_or(0);
        let mut in_flight = (self.oldest..self.next).map(|sequence| self.job(sequence).number);
        in_flight.find(|open| *open >= from).or_else(|| {
            let next = from.max(self.first_waiting);
            let has_limit = dag.jobs().is_some_and(|jobs| next >= jobs);
            (!self.is_closed() && !has_limit).then_some(next)
        })
    }

    /// Reports whether an instance may still start, now or later: the instance of the job with this
    /// number, for a vertex with this progress that has not started it.
    pub(super) fn may_start(&self, dag: &Dag, number: i64, progress: u64) -> bool {
        let is_open = self.next_open(dag, number).map(u64::cast_signed) == Some(number);
        let is_it = |sequence: &u64| self.job(*sequence).number.cast_signed() == number;
        let sequence = (self.oldest..self.next).find(is_it);
        let has_instance = |sequence| progress <= sequence && self.job(sequence).cut.is_none();
        is_open && sequence.is_none_or(has_instance)
    }

    /// Returns the sequence number of the oldest job in flight that is not cut.
    #[inline]
    pub(super) fn oldest_uncut(&self) -> Option<u64> {
        let mut in_flight = self.oldest..self.next;
        in_flight.find(|&sequence| self.job(sequence).cut.is_none())
    }

    /// Cuts a job in flight, and reports whether it was not cut before.
    #[inline]
    pub(super) fn cut(&mut self, sequence: u64, outcome: JobOutcome) -> bool {
        let cut = &mut self.job_mut(sequence).cut;
        let is_first = cut.is_none();
        // The first cut decides the outcome.
        cut.get_or_insert(outcome);
        is_first
    }

    /// Reports whether no further job will be due.
    #[inline]
    pub(super) fn is_closed(&self) -> bool {
        self.phase >= DagPhase::Closed
    }

    /// Drops all jobs ahead, for good.
    #[inline]
    pub(super) fn close(&mut self, phase: DagPhase) {
        self.phase = phase;
        self.next_due_ns = None;
    }

    /// Drops all waiting jobs and all jobs ahead, and lets jobs in flight start no further
    /// instance. Returns the number of jobs in flight not cut before, and the number of waiting
    /// jobs.
    #[inline]
    pub(super) fn end_all(&mut self) -> (u64, u64) {
        let mut cut_short = 0;
        // At most J jobs, a number fixed at commit.
        for sequence in self.oldest..self.next {
            cut_short += u64::from(self.cut(sequence, JobOutcome::DagEnded));
        }
        let dropped = self.waiting();
        self.close(DagPhase::Ended);
        // All waiting jobs are dropped at once, however many there are: only numbers are kept.
        self.first_waiting = self.next_due;
        (cut_short, dropped)
    }

    /// Takes the oldest job out of flight. All its instances have ended.
    #[inline]
    pub(super) fn end_oldest(&mut self) {
        self.oldest += 1;
    }

    /// Returns the time and kind of the next event of these jobs without a completion: a release
    /// becomes due, or a deadline has passed. A release no longer blocked is due at `now_ns`.
    #[inline]
    pub(super) fn next_event(&self, dag: &Dag, now_ns: u64) -> Option<(u64, TimerKind)> {
        let release = self
            .next_due_ns
            .map(|due_ns| (due_ns, release_kind(self.next_due)));
        // Usually the only job has just ended.
        if self.are_at_rest() {
            return release;
        }
        // Not at its nominal time, which is past: the release was blocked then.
        if self.are_releasable() {
            return Some((now_ns, TimerKind::Other));
        }
        match self.late_ns(dag) {
            Some(late_ns) => Some(sooner(release, late_ns)),
            None => release,
        }
    }
}

/// Returns the earlier of a release and the instant after a deadline.
#[inline]
fn sooner(release: Option<(u64, TimerKind)>, late_ns: u64) -> (u64, TimerKind) {
    let release = release.filter(|&(due_ns, _)| due_ns <= late_ns);
    release.unwrap_or((late_ns, TimerKind::Deadline))
}

/// Returns the kind of a job's release.
#[inline]
fn release_kind(number: u64) -> TimerKind {
    match number % 2 {
        0 => TimerKind::EvenRelease,
        _ => TimerKind::OddRelease,
    }
}

/// Returns a job's nominal release time. Returns `None` beyond the DAG's limit of jobs, if the
/// instant after the deadline overflows, or if only a signal determines the time.
#[inline]
fn due_ns(dag: &Dag, number: u64) -> Option<u64> {
    if dag.is_sporadic() || dag.jobs().is_some_and(|jobs| number >= jobs) {
        return None;
    }
    let release_ns = dag
        .period_ns()
        .checked_mul(number)?
        .checked_add(dag.offset_ns())?;
    let deadline_ns = release_ns.checked_add(dag.relative_deadline_ns())?;
    (deadline_ns < u64::MAX).then_some(release_ns)
}
