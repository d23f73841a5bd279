//! Writes a run down.
//!
//! Most of the scheduler's reports carry no time of their own. The recorder
//! keeps the latest time that one did carry, which is the instant that all of
//! them belong to: an instant begins with a completion, a release or an expired
//! deadline, and each of these states its time.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use sched_dag::{DagId, Instance, JobOutcome, TaskSet};

use crate::event::{Event, EventKind};
use crate::record::{InstanceRecord, JobRecord, PanicRecord};

/// Writes down what happens.
#[derive(Debug)]
pub(crate) struct Recorder {
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) now_ns: u64,
    pub(crate) run_until_ns: u64,
    pub(crate) events: Vec<Event>,
    pub(crate) instances: Vec<InstanceRecord>,
    instance_index: BTreeMap<Instance, usize>,
    pub(crate) jobs: Vec<JobRecord>,
    /// The contained panics.
    pub(crate) panics: Vec<PanicRecord>,
    job_index: BTreeMap<(DagId, u64), usize>,
    /// Jobs whose deadline passed while their release was queued.
    missed_in_queue: BTreeSet<(DagId, u64)>,
}

impl Recorder {
    pub(crate) fn new(task_set: Arc<TaskSet>) -> Self {
        Self {
            task_set,
            now_ns: 0,
            run_until_ns: 0,
            events: Vec::new(),
            instances: Vec::new(),
            instance_index: BTreeMap::new(),
            jobs: Vec::new(),
            panics: Vec::new(),
            job_index: BTreeMap::new(),
            missed_in_queue: BTreeSet::new(),
        }
    }

    /// Notes an event that states its time, which may be an earlier one (a
    /// release that had to queue): the instant is the latest time stated.
    pub(crate) fn at(&mut self, time_ns: u64, kind: EventKind) {
        self.now_ns = self.now_ns.max(time_ns);
        self.now(kind);
    }

    /// Notes an event of the present instant.
    pub(crate) fn now(&mut self, kind: EventKind) {
        self.events.push(Event {
            time_ns: self.now_ns,
            kind,
        });
    }

    pub(crate) fn of(&mut self, instance: Instance, change: impl FnOnce(&mut InstanceRecord)) {
        if let Some(&index) = self.instance_index.get(&instance) {
            change(&mut self.instances[index]);
        }
    }

    pub(crate) fn of_job(&mut self, dag: DagId, job: u64, change: impl FnOnce(&mut JobRecord)) {
        if let Some(&index) = self.job_index.get(&(dag, job)) {
            change(&mut self.jobs[index]);
        }
    }

    pub(crate) fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.at(release_ns, EventKind::Released { dag, job });
        let relative_deadline_ns = self.task_set.dag(dag).relative_deadline_ns();
        self.job_index.insert((dag, job), self.jobs.len());
        self.jobs.push(JobRecord {
            dag,
            job,
            release_ns,
            released_at_ns: self.now_ns,
            deadline_ns: release_ns.saturating_add(relative_deadline_ns),
            finish_ns: None,
            outcome: None,
            has_missed: self.missed_in_queue.remove(&(dag, job)),
        });
    }

    pub(crate) fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        self.at(deadline_ns, EventKind::DeadlineMissed { dag, job });
        if self.job_index.contains_key(&(dag, job)) {
            self.of_job(dag, job, |record| record.has_missed = true);
        } else {
            self.missed_in_queue.insert((dag, job));
        }
    }

    pub(crate) fn ready(&mut self, instance: Instance) {
        self.now(EventKind::Ready { instance });
        self.instance_index.insert(instance, self.instances.len());
        self.instances.push(InstanceRecord {
            instance,
            ready_ns: self.now_ns,
            start_ns: None,
            finish_ns: None,
            failed_ns: None,
            execution_ns: 0,
            core: None,
            preemptions: 0,
        });
    }

    pub(crate) fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.now(EventKind::JobCompleted { dag, job, outcome });
        let now_ns = self.now_ns;
        self.of_job(dag, job, |record| {
            record.finish_ns = Some(now_ns);
            record.outcome = Some(outcome);
        });
    }
}
