//! What the scheduler reports while it takes a step.

use core::sync::atomic::Ordering;

use sched_dag::journal::{Subject, What};
use sched_dag::{CoreId, DagId, Instance, JobOutcome, Journal, Observer, TaskSet};

use super::Bodies;
use super::JOBS_ENDED;
use super::time::{instance_time_ns, since_epoch};
use crate::machine::clock;

/// Writes what the scheduler reports into the journal, with the clock's time at that
/// very moment: so a join's latency includes the wait for the lock.
pub(super) struct Watcher<'a> {
    pub(super) journal: &'a mut Journal,
    pub(super) placement: &'a mut Bodies,
    pub(super) task_set: &'a TaskSet,
    /// The core that takes the step.
    pub(super) here: CoreId,
    /// Whether anything has happened to a job as a whole.
    pub(super) has_job_news: bool,
}

impl Watcher<'_> {
    /// Writes down what has happened now to a whole job.
    fn of_job(&mut self, what: What, dag: DagId, job: u64) {
        self.has_job_news = true;
        let now_ns = since_epoch(clock::now_ns());
        let subject = Subject::of_job(dag, job);
        self.journal.write(self.here, what, now_ns, subject);
    }
}

impl Observer for Watcher<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        if self.task_set.dag(dag).is_sporadic() {
            let subject = Subject::of_job(dag, job);
            self.journal
                .write(self.here, What::Due, release_ns, subject);
        }
        self.of_job(What::Released, dag, job);
    }

    fn queued(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Queued, dag, job);
    }

    fn skipped(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Skipped, dag, job);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.of_job(What::Aborted, dag, job);
    }

    fn ended(&mut self, dag: DagId) {
        self.of_job(What::Stopped, dag, 0);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Missed, dag, job);
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        let what = match release_ns {
            Some(_) => What::Signalled,
            None => What::Dropped,
        };
        self.of_job(what, dag, job);
    }

    #[inline]
    fn ready(&mut self, instance: Instance) {
        let now_ns = instance_time_ns(clock::now_ns());
        let subject = Subject::of(instance);
        self.journal.write(self.here, What::Ready, now_ns, subject);
    }

    fn cancelled(&mut self, instance: Instance) {
        let now_ns = since_epoch(clock::now_ns());
        let subject = Subject::of(instance);
        self.journal
            .write(self.here, What::Cancelled, now_ns, subject);
        let vertex = self.task_set.vertex(instance);
        if let Some(runner) = self.placement.resting(vertex) {
            runner.body.discard(instance.job);
        }
    }

    fn job_completed(&mut self, dag: DagId, job: u64, _: JobOutcome) {
        self.of_job(What::Completed, dag, job);
        // The jobs of a DAG without end are no progress.
        if self.task_set.dag(dag).jobs().is_some() {
            JOBS_ENDED.fetch_add(1, Ordering::Relaxed);
        }
    }
}
