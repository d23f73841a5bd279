//! The life of a DAG: pausing, closing and ending it early, and its state at an instant. The
//! scenarios of the rules, in `tests/scenarios/lifecycle.txt` and `ending.txt`, bear their numbers.
//!
//! # Pausing: no releases for a while, on the same grid afterwards
//!
//! A person, or a mode of the system, wants a DAG to rest and to go on later.
//!
//! - **P1, no release.** A paused DAG releases no job. Each job that becomes due is skipped at that
//!   instant, whatever the overrun policy. This includes the instant of the pause, since pauses
//!   come before releases. Numbers and the grid O + kT go on. Of a sporadic DAG, the job requested
//!   by a signal is skipped.
//! - **P2, no backlog.** Releases waiting for an older job are skipped at the pause, however many
//!   there are. They are reported from the oldest on: one at once, and [`SKIPS_A_STEP`] more of all
//!   DAGs in that step and in each later step, every [`SKIPS_EVERY_NS`]. If the DAG is paused once
//!   more before all are reported, the rest is counted only.
//! - **P3, in flight.** Released jobs go on as ever, to their end.
//! - **P4, resuming.** The first job due at the instant of the resumption or later is released at
//!   its nominal release time, unless it is blocked.
//! - **P5, the end.** Skipped jobs count towards the limit of jobs, so a paused periodic DAG with a
//!   limit comes to its end; a paused sporadic DAG needs its signals for that. A closed or ended
//!   DAG is neither paused nor resumed.
//!
//! To the other rules a pause is nothing new: a job is skipped as with
//! [`OverrunPolicy::Skip`](crate::OverrunPolicy::Skip).
//!
//! # Closing: its last jobs come to their end
//!
//! An orderly shutdown of a machine closes its DAGs: no further job begins, and the jobs already
//! released are finished.
//!
//! - **C1, no release.** A closed DAG releases no further job, not even at the instant of the
//!   closing, since closings come before releases. No further job is due, so none is skipped
//!   either; a signal kept for a job is forgotten.
//! - **C2, no backlog.** Releases waiting for an older job are skipped at the closing, and reported
//!   as at a pause.
//! - **C3, in flight.** Released jobs go on as ever, to their end, and may be late.
//! - **C4, over.** The DAG is over when nothing of it is in flight. Signals to the DAG are dropped,
//!   and counted.
//! - **C5, finality.** The DAG is neither paused nor resumed any more. A fault, or a request, ends
//!   it like any other DAG (E1 to E8).
//!
//! To the other rules a closing is nothing new: it acts like a limit of jobs, reached at that
//! instant.
//!
//! # Ending: by a fault of one of its instances, or a request
//!
//! An instance *fails* when a fault has ended it: its function will never return. A DAG is *ended*
//! by its first failing instance, unless the fault costs the job only (see below), or by a
//! *request*, which needs no fault. The DAG stays ended. It is *over* when nothing of it is in
//! flight or to come.
//!
//! - **E1, failure.** A failing instance has started. It ends at that instant: its core is free for
//!   the dispatch of the same instant. The scheduler may already regard the instance as preempted,
//!   as with a finish.
//! - **E2, no release.** An ended DAG releases no job, not even at the instant of its end, since
//!   ends come before releases. Waiting releases are dropped: counted, but not reported
//!   individually.
//! - **E3, no start.** No instance of an ended DAG starts. Ready and waiting instances are
//!   cancelled at once, the others when they would become ready: each once, and after all its
//!   predecessors have ended.
//! - **E4, started instances.** The DAG's other started instances go on, preempted ones at their
//!   key, until they complete or fail, too. In an ended DAG nothing depends on them any more, so a
//!   driver able to take an instance's context away for good may complete it at once.
//! - **E5, jobs.** Each job in flight ends when no instance of the job is left, with
//!   [`JobOutcome::DagEnded`], or as aborted if it was aborted before.
//! - **E6, deadlines.** A deadline that has passed before the instant of the end is a miss, unless
//!   the job was cut before. No later deadline of the DAG is a miss, and the run of consecutive
//!   misses stays as it is.
//! - **E7, others.** Nothing changes for other DAGs, except that cores are free for them: their
//!   releases, keys, joins and deadlines are independent of the end. From that instant on the
//!   schedule equals the schedule of a set in which the ended DAG has no work left but its started
//!   instances.
//! - **E8, finality.** The scheduler never begins an ended DAG again, because a failed subtask may
//!   have left its data in any state. A new scheduler may.
//!
//! Not here: whether a fault did harm beyond its instance, and the fate of the instance's stack and
//! values. Both are up to the driver.
//!
//! # Faults that cost a job: the DAG goes on with the next job
//!
//! A robot cannot do without its DAG because of one broken frame. So a DAG may state that it
//! *survives* faults ([`OnFault::DropJob`]). The job is then *cut*: it starts no further instance,
//! and the failed subtask goes on with another function, supplied by the driver. The scenarios of
//! the rules, in `tests/scenarios/faults.txt`, bear their numbers:
//!
//! - **D1, which faults.** A fault in job k is survived if the DAG says so and is not ended, the
//!   driver has another function for the subtask, fewer than A faults were survived before, and the
//!   N-th survived fault before this one was in job k - W or earlier, or does not exist. (N faults
//!   in a window of W jobs, A in all.) Any other fault ends the DAG (E1 to E8).
//! - **D2, the instance.** The failing instance ends as in E1. The subtask's next instance may
//!   start at that instant.
//! - **D3, its job.** Unless it is cut already, the job is cut: ready and waiting instances are
//!   cancelled at once, the others when they would become ready; running and preempted instances go
//!   on, unless they begin to wait (W6), at their key, to their end. The job ends when no instance
//!   of the job is left, with [`JobOutcome::Failed`].
//! - **D4, other jobs.** Nothing changes for them: jobs in flight go on, and the next jobs are
//!   released as ever, on the same grid.
//! - **D5, deadlines.** A deadline that has passed before the instant of the fault is a miss,
//!   unless the job was cut before. No later deadline of the job is a miss, and the run of
//!   consecutive misses stays as it is.
//! - **D6, one instant.** Several faults of one instant count in the order in which the driver
//!   reports them; the first fault not survived ends the DAG.
//! - **D7, others.** Nothing changes for other DAGs, except that cores are free for them.
//!
//! An aborted job may have a fault, too, in an instance started before: it counts as a fault, and
//! the job stays aborted.

use alloc::boxed::Box;
use alloc::vec;

use super::{DagStatistics, Scheduler};
use crate::ids::{DagId, Instance};
use crate::journal::{Event, EventKind};
use crate::policy::{JobOutcome, OnFault};

/// The largest number of skips reported in one step, besides one for each DAG whose backlog the
/// step skips. Reporting them takes no longer than the releases of a few DAGs.
pub const SKIPS_A_STEP: usize = 32;

/// The time from one step reporting skips to the next, in nanoseconds. Meanwhile the reports leave
/// all cores to the instances.
pub const SKIPS_EVERY_NS: u64 = 100_000;

/// A phase of a DAG's life.
///
/// ```text
///               1
///   +---------+ ------> +---------+
///   | Running |         | Paused  |
///   +---------+ <------ +---------+
///     |     |   2         |     |
///     |   3 |             | 3   |
///     |     |  +--------+ |     |
///     |     +->| Closed |<+     |
///   4 |        +--------+       | 4
///     |             | 4         |
///     |             v           |
///     |         +-------+       |
///     +-------->| Ended |<------+
///               +-------+
/// ```
///
/// 1. A pause, any number of times: [`Request::Pause`](crate::lifecycle::Request::Pause), a request
///    for a mode, if the DAG is only in other modes, or a pause stated for the beginning (L4).
/// 2. The end of the pause: [`Request::Resume`](crate::lifecycle::Request::Resume), or a mode is
///    entered with the DAG in it.
/// 3. A closing: [`Request::Close`](crate::lifecycle::Request::Close), also as part of a shutdown
///    of the run.
/// 4. An end: [`Request::End`](crate::lifecycle::Request::End), or a fault the DAG does not survive
///    ([`Moment::fail`](super::Moment::fail),
///    [`Moment::fail_replaceable`](super::Moment::fail_replaceable)). In the scheduler of one
///    cluster, the DAGs of other clusters are `Ended` from the beginning.
///
/// A closed DAG is never paused or resumed, and no phase follows `Ended`. A survived fault changes
/// no phase. Being over is not a phase: see [`Scheduler::is_over`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum DagPhase {
    /// Releases its jobs.
    #[default]
    Running,
    /// Skips its due jobs until it is resumed, closed or ended (P1 to P5).
    Paused,
    /// Releases no further job; jobs in flight go on to their end (C1 to C5).
    Closed,
    /// A fault or a request has ended the DAG, or the DAG is of another cluster: nothing of it
    /// starts any more (E1 to E8).
    Ended,
}

/// A person's question or wish to a scheduler. Serving it takes the scheduler little time.
#[derive(Debug)]
pub enum SchedulerQuery<'a> {
    /// The state of a DAG.
    Dag(DagId, &'a mut Option<DagSnapshot>),
    /// The latest events before the event with this number. The answer is the number of the oldest.
    Events(u64, &'a mut [Option<Event>]),
    /// The number of events written.
    Written,
    /// Room for events: 1 if there is some.
    HasRoom,
    /// The wish to have events recorded from now on, or forgotten.
    Record(bool),
}

/// A DAG at one instant.
#[derive(Clone, Copy, Debug)]
pub struct DagSnapshot {
    /// The phase of the DAG.
    pub phase: DagPhase,
    /// Whether the DAG has a limit of jobs, and nothing of it is left to be done.
    pub is_over: bool,
    /// The fates of its jobs.
    pub statistics: DagStatistics,
    /// Jobs in flight.
    pub in_flight: u64,
    /// Due jobs waiting for an older job to end.
    pub waiting: u64,
}

impl DagSnapshot {
    /// Returns the word for the DAG's state, for people and programs.
    pub const fn word(&self) -> &'static str {
        match self.phase {
            DagPhase::Closed | DagPhase::Ended => "ended",
            // Before `Paused`: a DAG that is over and paused has nothing left to resume.
            _ if self.is_over => "over",
            DagPhase::Paused => "paused",
            DagPhase::Running => "running",
        }
    }

    /// Reports whether the DAG is closed, ended, or over at its limit of jobs: it will release no
    /// further job, whatever comes.
    pub fn is_final(&self) -> bool {
        self.is_over || self.phase >= DagPhase::Closed
    }
}

impl Scheduler {
    /// Returns the phase of a DAG's life.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn phase(&self, dag: DagId) -> DagPhase {
        self.dags[dag.index()].jobs.phase
    }

    /// Answers a person's question, or fulfils the wish. Returns the number asked for, otherwise 0.
    pub fn show(&mut self, query: SchedulerQuery<'_>) -> u64 {
        let journal = &mut self.log.journal;
        match query {
            SchedulerQuery::Dag(dag, into) => *into = Some(self.snapshot(dag)),
            SchedulerQuery::Events(end, into) => return journal.copy_back(end, into),
            SchedulerQuery::Written => return journal.written(),
            SchedulerQuery::HasRoom => return journal.has_room().into(),
            SchedulerQuery::Record(on) => journal.record_events(on),
        }
        0
    }

    /// Returns the state of a DAG at this instant.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn snapshot(&self, dag: DagId) -> DagSnapshot {
        DagSnapshot {
            phase: self.phase(dag),
            is_over: self.is_over(dag) && self.task_set.dag(dag).jobs().is_some(),
            statistics: *self.statistics(dag),
            in_flight: self.in_flight(dag),
            waiting: self.waiting(dag),
        }
    }

    /// Reports whether a DAG is paused.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn is_paused(&self, dag: DagId) -> bool {
        self.phase(dag) == DagPhase::Paused
    }

    /// Returns the number of a DAG's jobs in flight.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn in_flight(&self, dag: DagId) -> u64 {
        let jobs = &self.dags[dag.index()].jobs;
        jobs.next - jobs.oldest
    }

    /// Pauses a DAG (P1, P2).
    #[inline]
    pub(super) fn pause(&mut self, dag: DagId) {
        if self.is_closed(dag) {
            return;
        }
        // A job late before the pause is a miss; skipped jobs can no longer become misses.
        self.judge(dag, None);
        let phase = &mut self.dags[dag.index()].jobs.phase;
        // A second pause is no event, but still skips the jobs waiting since the first.
        if core::mem::replace(phase, DagPhase::Paused) != DagPhase::Paused {
            self.log.of_dag(EventKind::Off, dag);
        }
        self.skip_waiting(dag);
    }

    /// Ends the pause of a DAG (P4).
    #[inline]
    pub(super) fn resume(&mut self, dag: DagId) {
        let state = &mut self.dags[dag.index()];
        if state.jobs.phase == DagPhase::Paused {
            state.jobs.phase = DagPhase::Running;
            // A late driver may learn only now of a job due during the pause; the scheduler skips
            // the job by comparing its release with this time.
            state.resumed_ns = self.log.now_ns;
            self.log.of_dag(EventKind::On, dag);
        }
    }

    /// Closes a DAG (C1, C2).
    #[inline]
    pub(super) fn close(&mut self, dag: DagId) {
        if self.is_closed(dag) {
            return;
        }
        // A waiting job whose deadline has passed is a miss; once skipped, the job could not become
        // a miss.
        self.judge(dag, None);
        self.dags[dag.index()].jobs.close(DagPhase::Closed);
        // Before the skips, which are consequences of the closing.
        self.log.of_dag(EventKind::Closed, dag);
        self.skip_waiting(dag);
    }

    /// Ends an instance that has started, and its DAG (E1).
    #[inline]
    pub(super) fn fail(&mut self, instance: Instance) {
        let vertex = self.take_off(instance, "fails");
        let dag = instance.dag;
        self.dags[dag.index()].statistics.faults += 1;
        // Before the instance ends, so that none of its successors starts.
        self.end_dag(dag);
        // Only now its job may end, so that the job counts as cut short.
        self.end_instance(vertex);
    }

    /// Ends a DAG, by a fault or a request (E2 to E6).
    #[inline]
    pub(super) fn end_dag(&mut self, dag: DagId) {
        if self.is_ended(dag) {
            return;
        }
        // E6: a job late by now is a miss. Afterwards all jobs are cut, and a cut job is never
        // late.
        self.judge(dag, None);
        let state = &mut self.dags[dag.index()];
        // From here on no job is released, so only jobs in flight remain to end.
        let (cut_short, dropped) = state.jobs.end_all();
        state.statistics.cut_short += cut_short;
        state.statistics.dropped += dropped;
        self.set_timer(dag);
        self.log.of_dag(EventKind::DagEnded, dag);
        // Last, when all jobs are cut: instances made ready by these ends are cancelled, too.
        self.cancel_ready(dag, u64::MAX);
    }

    #[inline]
    fn skip_waiting(&mut self, dag: DagId) {
        if self.waiting(dag) > 0 {
            let state = &mut self.dags[dag.index()];
            let skipped = state.jobs.skip_all_waiting();
            state.statistics.skips += skipped.end - skipped.start;
            // The rest of an older backlog is given up here: it is counted, but no longer reported
            // (P2).
            state.untold = skipped;
            self.tell_skip(dag);
            self.tell_skips();
        }
        self.touch_lists();
        self.set_timer(dag);
    }

    /// Reports as many skips as one step may, and leaves the others to later steps.
    #[cold]
    #[inline(never)]
    pub(super) fn tell_skips(&mut self) {
        let now_ns = self.log.now_ns;
        // By instant, not by call: all pauses of one instant share the limit.
        if self.told.0 != now_ns {
            self.told = (now_ns, 0);
        }
        for dag in (0..).map(DagId).take(self.dags.len()) {
            while self.told.1 < SKIPS_A_STEP && self.tell_skip(dag) {
                self.told.1 += 1;
            }
        }
        let timer = self.skips_timer();
        match self.dags.iter().all(|state| state.untold.is_empty()) {
            true => self.timers.remove(timer),
            false => self
                .timers
                .set(timer, now_ns.saturating_add(SKIPS_EVERY_NS)),
        }
        self.quiet_until_ns = self.timers.earliest_ns();
    }

    /// Reports the oldest unreported skip of a DAG. Returns whether there was such a skip.
    fn tell_skip(&mut self, dag: DagId) -> bool {
        let state = &mut self.dags[dag.index()];
        let job = state.untold.next();
        if let Some(job) = job {
            let release_ns = (state.jobs).waiting_release_ns(self.task_set.dag(dag), job);
            (self.log).of_job(EventKind::Skipped, dag, job, Some(release_ns));
        }
        job.is_some()
    }

    /// Returns the number of the timer for reporting skips, behind all other timers.
    #[inline]
    pub(super) fn skips_timer(&self) -> usize {
        self.dags.len() + self.waits.len()
    }
}

/// The latest survived faults of a DAG.
#[derive(Clone, Debug, Hash)]
pub(super) struct SurvivedFaults {
    window: u64,
    /// The number of faults that may still be survived.
    left: u32,
    /// The jobs of the latest survived faults, as many as a window may hold.
    jobs: Box<[u64]>,
    /// The place of the oldest of these jobs, once the ring is full.
    oldest: usize,
    count: usize,
}

impl SurvivedFaults {
    pub(super) fn new(on_fault: OnFault) -> Self {
        let (window, left, most) = match on_fault {
            OnFault::EndDag => (0, 0, 0),
            // The ring need not be longer than the number of faults that may be survived in all.
            OnFault::DropJob(of) => (of.window, of.in_all, of.faults.min(of.in_all)),
        };
        Self {
            window,
            left,
            jobs: vec![0; most as usize].into_boxed_slice(),
            oldest: 0,
            count: 0,
        }
    }

    /// Reports whether a fault in a job would be survived (D1).
    fn would_take(&self, job: u64) -> bool {
        // Fewer than N faults were survived so far, so no window can hold N.
        let has_room = self.count < self.jobs.len();
        // The N-th survived fault before this one; the ring holds N.
        let nth_before = self.jobs.get(self.oldest);
        // `None` where the window reaches back to before job 0: then every earlier fault is inside.
        let last_outside = job.checked_sub(self.window);
        let is_outside = |before| last_outside.is_some_and(|last| before <= last);
        self.left > 0 && (has_room || nth_before.is_some_and(|&before| is_outside(before)))
    }

    /// Counts a fault in a job if it is survived, and reports whether it is survived.
    fn count_fault(&mut self, job: u64) -> bool {
        let is_survived = self.would_take(job);
        // Overwrites the N-th fault before: older faults decide nothing any more.
        if is_survived && let Some(place) = self.jobs.get_mut(self.oldest) {
            *place = job;
            self.oldest = (self.oldest + 1) % self.jobs.len();
            self.count = self.jobs.len().min(self.count + 1);
            self.left -= 1;
        }
        is_survived
    }
}

impl Scheduler {
    /// Reports whether a DAG would survive a fault in a job now, if the driver has another function
    /// for the subtask (D1).
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn survives(&self, dag: DagId, job: u64) -> bool {
        !self.is_ended(dag) && self.dags[dag.index()].survived.would_take(job)
    }

    /// Ends an instance that has started, and cuts its job or ends its DAG (D1).
    #[inline]
    pub(super) fn fail_replaceable(&mut self, instance: Instance) {
        let dag = instance.dag;
        if self.is_ended(dag) || !self.dags[dag.index()].survived.count_fault(instance.job) {
            self.fail(instance);
            return;
        }
        let vertex = self.take_off(instance, "fails");
        // D5: after the cut no deadline of the job is looked at any more.
        self.judge(dag, None);
        // Before the end, which moves the vertex on to its next job.
        let sequence = self.vertices.get(vertex).progress;
        let state = &mut self.dags[dag.index()];
        state.statistics.faults += 1;
        state.statistics.restarts += 1;
        self.log.of_instance(EventKind::Restarted, instance);
        // Not for a job aborted before: the job keeps its outcome, and its ready instances are
        // cancelled already.
        if state.jobs.cut(sequence, JobOutcome::Failed) {
            state.statistics.failed += 1;
            self.cancel_ready(dag, sequence);
        }
        self.end_instance(vertex);
        self.set_timer(dag);
    }
}
