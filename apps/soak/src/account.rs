//! The accounts of a round: is every job and every instance accounted for?
//!
//! A job that is due is released or skipped; what is released is completed or
//! aborted; which of these may happen at all depends on the overrun policy.
//! There are three witnesses: the scheduler's counters, the times of each job,
//! and what the instances counted themselves.

use alloc::string::String;
use alloc::{format, vec::Vec};
use core::fmt;

use fass::OverrunPolicy;
use sched_dag::law::Record;
use sched_dag::{DagId, DagStatistics, JobOutcome, TaskSet};

use crate::dags::Executed;

/// The counts of one round, over all DAGs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Jobs that were due.
    pub jobs: u64,
    /// Jobs released.
    pub released: u64,
    /// Jobs of which all instances have run.
    pub completed: u64,
    /// Deadlines that have passed before their job was complete.
    pub misses: u64,
    /// Jobs not released.
    pub skips: u64,
    /// Jobs aborted.
    pub aborts: u64,
    /// Jobs that waited for their release.
    pub queued: u64,
    /// Instances that have run.
    pub instances: u64,
    /// How often an instance has lost its core.
    pub preemptions: u64,
}

/// Something that does not add up, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Discrepancy(String);

impl fmt::Display for Discrepancy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Account {
    /// Adds another round's counts.
    pub fn add(&mut self, other: &Self) {
        self.jobs += other.jobs;
        self.released += other.released;
        self.completed += other.completed;
        self.misses += other.misses;
        self.skips += other.skips;
        self.aborts += other.aborts;
        self.queued += other.queued;
        self.instances += other.instances;
        self.preemptions += other.preemptions;
    }

    /// Draws up the account of a run that has ended, and finds what does not add
    /// up.
    #[must_use]
    pub fn of_run<'a>(
        task_set: &TaskSet,
        record: &Record,
        statistics: impl Fn(DagId) -> &'a DagStatistics,
        executed: &Executed,
    ) -> (Self, Vec<Discrepancy>) {
        let mut total = Self::default();
        let mut found = Vec::new();
        for (dag, model) in (0..).map(DagId).zip(task_set.dags()) {
            let statistics = statistics(dag);
            let of_dag = Self {
                jobs: model.jobs().unwrap_or(0),
                released: statistics.released,
                completed: statistics.completed,
                misses: statistics.misses,
                skips: statistics.skips,
                aborts: statistics.aborts,
                queued: statistics.queued,
                instances: 0,
                preemptions: 0,
            };
            let wrong = of_dag.wrong(model.overrun(), statistics, record, dag);
            found.extend(wrong.map(|text| Discrepancy(format!("{}: {text}", model.name()))));
            total.add(&of_dag);
        }
        for (_, instance) in record.all_instances(task_set) {
            total.instances += u64::from(instance.runs);
            total.preemptions += u64::from(instance.preemptions);
        }
        let counted = executed.instances();
        if counted != total.instances {
            let recorded = total.instances;
            found.push(Discrepancy(format!(
                "{counted} instances say that they ran, {recorded} are recorded"
            )));
        }
        (total, found)
    }

    /// Returns what does not add up for one DAG.
    fn wrong(
        self,
        overrun: OverrunPolicy,
        statistics: &DagStatistics,
        record: &Record,
        dag: DagId,
    ) -> impl Iterator<Item = String> {
        let count = |wanted: &[JobOutcome]| {
            let outcomes = record.jobs(dag).iter().filter_map(|job| job.outcome);
            outcomes.filter(|outcome| wanted.contains(outcome)).count() as u64
        };
        let complete = count(&[JobOutcome::Met, JobOutcome::Missed]);
        let late = count(&[JobOutcome::Missed]);
        let aborted = count(&[JobOutcome::Aborted]);
        let ended = statistics.faults + statistics.cut_short + statistics.dropped;
        let Self {
            jobs,
            released,
            completed,
            misses,
            skips,
            aborts,
            queued,
            ..
        } = self;
        let may_skip = overrun != OverrunPolicy::Queue;
        let may_abort = overrun == OverrunPolicy::Abort;
        let may_queue = overrun != OverrunPolicy::Skip;
        let claims = [
            (
                jobs == released + skips,
                format!("{jobs} jobs are {released} released and {skips} skipped ones"),
            ),
            (
                released == completed + aborts,
                format!(
                    "{released} released jobs are {completed} complete and {aborts} aborted ones"
                ),
            ),
            (
                completed == complete && aborts == aborted,
                format!(
                    "{completed} complete and {aborts} aborted jobs are recorded as {complete} and \
                     {aborted}"
                ),
            ),
            (
                misses >= late && misses <= jobs,
                format!(
                    "{misses} of {jobs} deadlines are missed, with {late} jobs complete and late"
                ),
            ),
            (
                may_skip || skips == 0,
                format!("{skips} jobs are skipped under {overrun:?}"),
            ),
            (
                may_abort || aborts == 0,
                format!("{aborts} jobs are aborted under {overrun:?}"),
            ),
            (
                may_queue || queued == 0,
                format!("{queued} jobs are queued under {overrun:?}"),
            ),
            (
                ended == 0,
                format!("faults have ended the DAG: {statistics:?}"),
            ),
        ];
        let broken = claims.into_iter().filter(|(holds, _)| !holds);
        broken.map(|(_, claim)| format!("it does not hold that {claim}"))
    }
}
