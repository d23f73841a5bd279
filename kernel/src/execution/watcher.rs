//! What the scheduler reports while it takes a step.

use core::sync::atomic::Ordering;

use fass::Body;
use sched_dag::record::Record;
use sched_dag::{DagId, Instance, JobOutcome, Observer};

use super::JOBS_ENDED;
use super::events::{here, since_epoch};
use super::placement::Placement;
use crate::machine::clock;
use crate::machine::context::Parked;
use crate::trace::{self, What};

/// Writes what the scheduler reports into the record, with the clock's time at
/// that very moment: so a join's latency includes the wait for the lock.
pub(super) struct Watcher<'a> {
    pub(super) record: &'a mut Record,
    pub(super) placement: &'a mut Placement<Body, Parked>,
}

impl Watcher<'_> {
    fn now_ns(&self) -> u64 {
        since_epoch(clock::now_ns())
    }
}

impl Observer for Watcher<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let now_ns = self.now_ns();
        trace::job(What::Released, now_ns, dag, job);
        if let Some(record) = self.record.job_mut(dag, job) {
            record.release_ns = Some(release_ns);
            record.released_ns = Some(now_ns);
        }
    }

    fn queued(&mut self, dag: DagId, job: u64, _: u64) {
        trace::job(What::Queued, self.now_ns(), dag, job);
    }

    fn skipped(&mut self, dag: DagId, job: u64, _: u64) {
        trace::job(What::Skipped, self.now_ns(), dag, job);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        let now_ns = self.now_ns();
        trace::job(What::Aborted, now_ns, dag, job);
        if let Some(record) = self.record.job_mut(dag, job) {
            record.cut_ns = Some(now_ns);
        }
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _: u64) {
        let now_ns = self.now_ns();
        trace::job(What::Missed, now_ns, dag, job);
        if let Some(record) = self.record.job_mut(dag, job) {
            record.missed_ns = Some(now_ns);
        }
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        let what = match release_ns {
            Some(_) => What::Signalled,
            None => What::Dropped,
        };
        trace::job(what, self.now_ns(), dag, job);
    }

    fn ready(&mut self, instance: Instance) {
        let now_ns = self.now_ns();
        trace::instance(What::Ready, now_ns, here(), instance);
        if let Some(record) = self.record.instance_mut(instance) {
            record.ready_ns = Some(now_ns);
        }
    }

    fn cancelled(&mut self, instance: Instance) {
        trace::instance(What::Cancelled, self.now_ns(), here(), instance);
        if let Some(body) = self.placement.resting(instance) {
            body.discard(instance.job);
        }
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        let now_ns = self.now_ns();
        trace::job(What::Completed, now_ns, dag, job);
        if let Some(record) = self.record.job_mut(dag, job) {
            record.ended_ns = Some(now_ns);
            record.outcome = Some(outcome);
        }
        JOBS_ENDED.fetch_add(1, Ordering::Relaxed);
    }
}
