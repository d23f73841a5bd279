//! Releases, and the fate of releases without room.
//!
//! # Rules of every policy
//!
//! 1. A job is due at its nominal release time, O + kT unless the DAG is sporadic (S1), whatever
//!    happened to the jobs before. Its deadline is the nominal release plus D, even if the job is
//!    released later.
//! 2. Jobs are released in the order of their numbers. A due job is released at once unless the DAG
//!    is paused, an older job waits or the release is blocked (the job J before it, or an older
//!    job, is in flight).
//! 3. Unless it is skipped or dropped before, a waiting job is released at the first instant at
//!    which it is the oldest waiting job and not blocked; completions of that instant count.
//! 4. A miss is noticed at the first instant after the deadline, whether the job is in flight or
//!    waits, and once. A job skipped or aborted before its deadline counts as skipped or aborted
//!    and never as a miss. A job given up by the overrun policy at its deadline is a miss, too, as
//!    if the step came some time later.
//! 5. The run of consecutive misses ends only with a job that meets its deadline. Skipping or
//!    cutting a job neither lengthens nor ends the run.
//!
//! # Queue
//!
//! A due job that cannot be released waits. Any number of jobs of a periodic DAG may wait, in
//! constant memory, since only their numbers are kept; the number in flight stays bounded. Jobs
//! therefore stay late as long as an overload lasts; choose another policy if old jobs are worth
//! nothing.
//!
//! # Skip
//!
//! A due job that cannot be released is skipped. No job ever waits.
//!
//! # Abort
//!
//! A due job that cannot be released aborts the oldest job in flight that is not cut yet, by an
//! abort or a fault, and waits. If all jobs in flight are cut already, the oldest waiting job,
//! which may be the due job itself, is skipped.
//!
//! An aborted job starts no further instance: ready and waiting instances are cancelled at once,
//! the others when they would become ready, or begin to wait (W6). Running and preempted instances
//! go on, at their key, to their end. The aborted job ends, and makes room, when no instance of the
//! job is left; if none runs or is preempted, at once.

use super::Scheduler;
use super::jobs::Job;
use crate::ids::DagId;
use crate::journal::EventKind;
use crate::policy::{JobOutcome, OverrunPolicy};

impl Scheduler {
    /// Releases all due jobs of a DAG, and notices passed deadlines. A number beyond the DAGs is
    /// the timer of a wait, or of the reports of skips.
    #[inline]
    pub(super) fn serve(&mut self, dag: DagId) {
        if dag.index() >= self.dags.len() {
            return match dag.index() < self.skips_timer() {
                true => self.time_out(dag.index()),
                false => self.tell_skips(),
            };
        }
        // Usually a single release is due, and the job before has ended.
        let (model, state) = (self.task_set.dag(dag), &mut self.dags[dag.index()]);
        let now_ns = self.log.now_ns;
        if let Some((sequence, event)) = (state.jobs).release_alone(model, state.resumed_ns, now_ns)
        {
            self.begin_job(dag, sequence);
            self.set_timer_to(dag, Some(event));
            return;
        }
        // Deadlines before releases: a late job may be blocking the next.
        self.judge(dag, None);
        self.release_waiting(dag);
        while let Some((job, release_ns)) = self.take_due(dag) {
            self.release_or_overrun(dag, job, release_ns);
            let jobs = &mut self.dags[dag.index()].jobs;
            // Waiting jobs are judged only when announced. Otherwise an end that makes room for
            // this job could find the job late before any event has mentioned it.
            jobs.announce();
            // Only if the driver is late can a deadline have passed here without having been
            // noticed.
            if jobs.first_deadline_ns(release_ns) < self.log.now_ns {
                self.judge(dag, None);
            }
        }
        // Once for all due jobs, not once a job.
        self.set_timer(dag);
    }

    /// Deals with a job that has just become due.
    #[inline]
    fn release_or_overrun(&mut self, dag: DagId, job: u64, release_ns: u64) {
        // A late driver may learn of a job due in the pause only after the pause.
        if self.is_paused(dag) || release_ns < self.dags[dag.index()].resumed_ns {
            self.skip_oldest_waiting(dag);
            return;
        }
        // Older waiting jobs first: jobs are released in the order of their numbers (rule 2).
        self.release_waiting(dag);
        if !self.is_waiting(dag, job) {
            return;
        }
        match self.task_set.dag(dag).overrun() {
            // The job waits as it is, by its number alone.
            OverrunPolicy::Queue => {}
            OverrunPolicy::Skip => self.skip_oldest_waiting(dag),
            OverrunPolicy::Abort => {
                // The aborted job may have no started instance; then it has ended already, and
                // there is room.
                self.make_room(dag);
                self.release_waiting(dag);
            }
        }
        if self.is_waiting(dag, job) {
            self.dags[dag.index()].statistics.queued += 1;
            self.log
                .of_job(EventKind::Queued, dag, job, Some(release_ns));
        }
    }

    #[inline]
    fn take_due(&mut self, dag: DagId) -> Option<(u64, u64)> {
        let jobs = &mut self.dags[dag.index()].jobs;
        jobs.take_due(self.task_set.dag(dag), self.log.now_ns)
    }

    #[inline]
    fn is_waiting(&self, dag: DagId, job: u64) -> bool {
        self.dags[dag.index()].jobs.is_waiting(job)
    }

    /// Releases waiting jobs as long as none is blocked.
    #[inline]
    fn release_waiting(&mut self, dag: DagId) {
        while self.dags[dag.index()].jobs.are_releasable() {
            let model = self.task_set.dag(dag);
            let sequence = self.dags[dag.index()].jobs.release_waiting(model);
            self.begin_job(dag, sequence);
        }
    }

    /// Reports a released job, and releases its sources.
    #[inline]
    fn begin_job(&mut self, dag: DagId, sequence: u64) {
        let state = &mut self.dags[dag.index()];
        state.statistics.released += 1;
        let &Job {
            number, release_ns, ..
        } = state.jobs.job(sequence);
        // The grid does not tell a judge when a sporadic job was due; this event does.
        if self.task_set.dag(dag).is_sporadic() {
            self.log.due(dag, number, release_ns);
        }
        (self.log).of_job(EventKind::Released, dag, number, Some(release_ns));
        self.release_sources(dag, sequence);
    }

    #[inline]
    fn make_room(&mut self, dag: DagId) {
        // W4: waits ending at this instant end first; an abort would cancel their instances (W6).
        self.time_out_due();
        let jobs = &self.dags[dag.index()].jobs;
        let sequence = jobs.oldest_uncut();
        let job = sequence.map_or(jobs.first_waiting, |sequence| jobs.job(sequence).number);
        // Rule 4: at its deadline the job is a miss, too; once cut or skipped it could not be.
        self.judge_given_up(dag, job);
        // All jobs in flight are cut already, so room is on its way: aborting more would cost jobs
        // without gaining room.
        let Some(sequence) = sequence else {
            self.skip_oldest_waiting(dag);
            return;
        };
        let state = &mut self.dags[dag.index()];
        state.jobs.cut(sequence, JobOutcome::Aborted);
        state.statistics.aborts += 1;
        self.log.of_job(EventKind::Aborted, dag, job, None);
        self.cancel_ready(dag, sequence);
    }

    #[inline]
    pub(super) fn skip_oldest_waiting(&mut self, dag: DagId) {
        let state = &mut self.dags[dag.index()];
        let (job, release_ns) = state.jobs.skip_waiting(self.task_set.dag(dag));
        state.statistics.skips += 1;
        self.log
            .of_job(EventKind::Skipped, dag, job, Some(release_ns));
        self.touch_lists();
    }
}
