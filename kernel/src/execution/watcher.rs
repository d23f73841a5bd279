//! What the scheduler reports while it takes a step.

use core::sync::atomic::Ordering;

use fass::Body;
use sched_dag::record::Record;
use sched_dag::{DagId, Instance, JobOutcome, Observer};

use super::JOBS_ENDED;
use super::placement::Placement;
use crate::machine::clock;
use crate::machine::context::Parked;

/// Writes what the scheduler reports into the record, with the clock's time at
/// that very moment: so a join's latency includes the wait for the lock.
pub(super) struct Watcher<'a> {
    pub(super) record: &'a mut Record,
    pub(super) placement: &'a mut Placement<Body, Parked>,
    pub(super) epoch_ns: u64,
}

impl Watcher<'_> {
    fn now_ns(&self) -> u64 {
        clock::now_ns().saturating_sub(self.epoch_ns)
    }
}

impl Observer for Watcher<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let now_ns = self.now_ns();
        if let Some(record) = self.record.job_mut(dag, job) {
            record.release_ns = Some(release_ns);
            record.released_ns = Some(now_ns);
        }
    }

    fn ready(&mut self, instance: Instance) {
        let now_ns = self.now_ns();
        if let Some(record) = self.record.instance_mut(instance) {
            record.ready_ns = Some(now_ns);
        }
    }

    fn cancelled(&mut self, instance: Instance) {
        if let Some(body) = self.placement.resting(instance) {
            body.discard(instance.job);
        }
    }

    fn job_completed(&mut self, _: DagId, _: u64, _: JobOutcome) {
        JOBS_ENDED.fetch_add(1, Ordering::Relaxed);
    }
}
