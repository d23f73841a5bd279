//! One DAG of one subtask on one core, taken from instant to instant, and a log in words.

use std::fmt::{Display, Write};

use sched_dag::{DagId, DagSpec, Decision, Instance, JobOutcome, Moment, Observer, Scheduler};

use super::{PREEMPTIVE, scheduler};

pub(crate) const DAG: DagId = DagId(0);

/// The events since it was last asked.
#[derive(Default)]
pub(crate) struct Log(String);

impl Log {
    fn note(&mut self, what: &str, of: impl Display) {
        // Writing into a `String` cannot fail.
        let _ = write!(self.0, "{what} {of}, ");
    }

    pub(crate) fn take(&mut self) -> String {
        std::mem::take(&mut self.0).trim_end_matches(", ").into()
    }
}

impl Observer for Log {
    fn released(&mut self, _: DagId, job: u64, _: u64) {
        self.note("released", job);
    }

    fn queued(&mut self, _: DagId, job: u64, _: u64) {
        self.note("queued", job);
    }

    fn skipped(&mut self, _: DagId, job: u64, _: u64) {
        self.note("skipped", job);
    }

    fn cancelled(&mut self, instance: Instance) {
        self.note("cancelled", instance);
    }

    fn deadline_missed(&mut self, _: DagId, job: u64, _: u64) {
        self.note("missed", job);
    }

    fn job_completed(&mut self, _: DagId, job: u64, outcome: JobOutcome) {
        self.note(&format!("{outcome:?}"), job);
    }

    fn closed(&mut self, dag: DagId) {
        self.note("closed", dag.0);
    }

    fn ended(&mut self, dag: DagId) {
        self.note("ended", dag.0);
    }

    fn switched_off(&mut self, dag: DagId) {
        self.note("off", dag.0);
    }

    fn switched_on(&mut self, dag: DagId) {
        self.note("on", dag.0);
    }
}

/// A scheduler of one DAG of one subtask on one core.
pub(crate) struct Bench {
    pub(crate) scheduler: Scheduler,
    pub(crate) running: Option<Instance>,
}

impl Bench {
    pub(crate) fn new(spec: DagSpec) -> Bench {
        Bench {
            scheduler: scheduler(&[spec], PREEMPTIVE),
            running: None,
        }
    }

    /// Goes through an instant and returns its events.
    pub(crate) fn at(
        &mut self,
        now_ns: u64,
        change: impl FnOnce(&mut Moment<'_>, &mut Log),
    ) -> String {
        let mut log = Log::default();
        let mut moment = self.scheduler.at(now_ns);
        change(&mut moment, &mut log);
        for decision in moment.release_due(&mut log).dispatch() {
            if let Decision::Start { instance, .. } = decision {
                self.running = Some(*instance);
            }
        }
        log.take()
    }

    pub(crate) fn time(&mut self, now_ns: u64) -> String {
        self.at(now_ns, |_, _| {})
    }

    pub(crate) fn pause(&mut self, now_ns: u64) -> String {
        self.at(now_ns, |moment, log| moment.pause(DAG, log))
    }

    pub(crate) fn resume(&mut self, now_ns: u64) -> String {
        self.at(now_ns, |moment, log| moment.resume(DAG, log))
    }

    pub(crate) fn close(&mut self, now_ns: u64) -> String {
        self.at(now_ns, |moment, log| moment.close(DAG, log))
    }

    pub(crate) fn signal(&mut self, now_ns: u64) -> String {
        self.at(now_ns, |moment, log| moment.signal(DAG, log))
    }

    /// Completes the instance that runs.
    pub(crate) fn complete(&mut self, now_ns: u64) -> String {
        let instance = self.running.take().expect("an instance runs");
        self.at(now_ns, |moment, log| moment.complete(instance, log))
    }
}
