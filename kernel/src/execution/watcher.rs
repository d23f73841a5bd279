//! What the scheduler reports while it takes a step.

use core::sync::atomic::Ordering;

use sched_dag::{DagId, Instance, JobOutcome, Observer, TaskSet};

use super::JOBS_ENDED;
use super::books::Books;
use super::events::{instance_time_ns, since_epoch};
use crate::machine::clock;
use crate::trace::{Recorder, Subject, What};

/// Writes what the scheduler reports into the record, with the clock's time at
/// that very moment: so a join's latency includes the wait for the lock.
pub(super) struct Watcher<'a> {
    pub(super) books: &'a mut Books,
    pub(super) task_set: &'a TaskSet,
    pub(super) recorder: Recorder,
    /// Whether anything has happened to a job as a whole.
    pub(super) has_job_news: bool,
}

impl Watcher<'_> {
    #[inline]
    fn now_ns(&self) -> u64 {
        since_epoch(clock::now_ns())
    }
}

impl Observer for Watcher<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.has_job_news = true;
        let now_ns = self.now_ns();
        self.recorder
            .own(What::Released, now_ns, Subject::of_job(dag, job));
        if let Some(record) = self.books.record.job_mut(dag, job) {
            record.release_ns = Some(release_ns);
            record.released_ns = Some(now_ns);
        }
    }

    fn queued(&mut self, dag: DagId, job: u64, _: u64) {
        self.has_job_news = true;
        self.recorder
            .own(What::Queued, self.now_ns(), Subject::of_job(dag, job));
    }

    fn skipped(&mut self, dag: DagId, job: u64, _: u64) {
        self.has_job_news = true;
        self.recorder
            .own(What::Skipped, self.now_ns(), Subject::of_job(dag, job));
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.has_job_news = true;
        let now_ns = self.now_ns();
        self.recorder
            .own(What::Aborted, now_ns, Subject::of_job(dag, job));
        if let Some(record) = self.books.record.job_mut(dag, job) {
            record.cut_ns = Some(now_ns);
        }
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _: u64) {
        self.has_job_news = true;
        let now_ns = self.now_ns();
        self.recorder
            .own(What::Missed, now_ns, Subject::of_job(dag, job));
        if let Some(record) = self.books.record.job_mut(dag, job) {
            record.missed_ns = Some(now_ns);
        }
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        self.has_job_news = true;
        let what = match release_ns {
            Some(_) => What::Signalled,
            None => What::Dropped,
        };
        self.recorder
            .own(what, self.now_ns(), Subject::of_job(dag, job));
    }

    #[inline]
    fn ready(&mut self, instance: Instance) {
        let now_ns = instance_time_ns(clock::now_ns());
        self.recorder
            .own(What::Ready, now_ns, Subject::of(instance));
        if let Some(record) = self.books.record.instance_mut(instance) {
            record.ready_ns = Some(now_ns);
        }
    }

    fn cancelled(&mut self, instance: Instance) {
        self.recorder
            .own(What::Cancelled, self.now_ns(), Subject::of(instance));
        let vertex = self.task_set.vertex(instance);
        if let Some(runner) = self.books.placement.resting(vertex) {
            runner.body.discard(instance.job);
        }
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.has_job_news = true;
        let now_ns = self.now_ns();
        self.recorder
            .own(What::Completed, now_ns, Subject::of_job(dag, job));
        if let Some(record) = self.books.record.job_mut(dag, job) {
            record.ended_ns = Some(now_ns);
            record.outcome = Some(outcome);
            // A DAG without end has no record, and its jobs are no progress.
            JOBS_ENDED.fetch_add(1, Ordering::Relaxed);
        }
    }
}
