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
use crate::trouble::{Then, Trouble};

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
    /// Instances that a fault has ended, as drawn.
    pub faults: u64,
    /// Faults after which the DAG went on.
    pub restarts: u64,
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
        self.faults += other.faults;
        self.restarts += other.restarts;
    }

    /// Draws up the account of a run that has ended, and finds what does not add
    /// up.
    #[must_use]
    pub fn of_run<'a>(
        task_set: &TaskSet,
        record: &Record,
        statistics: impl Fn(DagId) -> &'a DagStatistics,
        trouble: &Trouble,
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
                faults: statistics.faults,
                restarts: statistics.restarts,
            };
            let of_jobs = of_dag.wrong(model.overrun(), statistics, record, dag, trouble);
            let panics = executed.panics(dag.index());
            let of_faults = of_dag.wrong_faults(model.overrun(), statistics, dag, trouble, panics);
            let wrong = of_jobs.chain(of_faults);
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

    /// Returns what does not add up for one DAG's jobs.
    fn wrong(
        self,
        overrun: OverrunPolicy,
        statistics: &DagStatistics,
        record: &Record,
        dag: DagId,
        trouble: &Trouble,
    ) -> impl Iterator<Item = String> {
        let count = |wanted: &[JobOutcome]| {
            let outcomes = record.jobs(dag).iter().filter_map(|job| job.outcome);
            outcomes.filter(|outcome| wanted.contains(outcome)).count() as u64
        };
        let complete = count(&[JobOutcome::Met, JobOutcome::Missed]);
        let late = count(&[JobOutcome::Missed]);
        let aborted = count(&[JobOutcome::Aborted]);
        let failed = count(&[JobOutcome::Failed]);
        let cut_short = count(&[JobOutcome::DagEnded]);
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
        let is_ended = statistics.faults > statistics.restarts;
        let lost = statistics.failed + statistics.cut_short;
        let may_skip = overrun != OverrunPolicy::Queue || trouble.pauses(dag.index());
        let may_abort = overrun == OverrunPolicy::Abort;
        let may_queue = overrun != OverrunPolicy::Skip;
        let claims = [
            (
                jobs == released + skips || is_ended && jobs > released + skips,
                format!("{jobs} jobs are {released} released and {skips} skipped ones"),
            ),
            (
                released == completed + aborts + lost,
                format!(
                    "{released} released jobs are {completed} complete ones, {aborts} aborted ones \
                     and {lost} that a fault cost"
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
                statistics.failed == failed && statistics.cut_short == cut_short,
                format!("faults cost {failed} and {cut_short} jobs: {statistics:?}"),
            ),
        ];
        let broken = claims.into_iter().filter(|(holds, _)| !holds);
        broken.map(|(_, claim)| format!("it does not hold that {claim}"))
    }

    /// Returns what does not add up for one DAG's faults, of which it has told so many itself.
    fn wrong_faults(
        self,
        overrun: OverrunPolicy,
        statistics: &DagStatistics,
        dag: DagId,
        trouble: &Trouble,
        panics: u64,
    ) -> impl Iterator<Item = String> {
        let fault = trouble.of(dag.index()).fault;
        let drawn = u64::from(fault.is_some());
        let survives = fault.is_some_and(|fault| fault.then != Then::End);
        // All its jobs run, so the fatal one does.
        let is_certain = overrun == OverrunPolicy::Queue && !trouble.pauses(dag.index());
        let Self {
            faults, restarts, ..
        } = self;
        let cost = statistics.cut_short + statistics.dropped;
        let claims = [
            (
                faults == panics,
                format!("{panics} instances panicked, and {faults} faults are counted"),
            ),
            (
                faults == drawn || !is_certain && faults < drawn,
                format!("{faults} of {drawn} faults came about"),
            ),
            (
                restarts == if survives { faults } else { 0 } && statistics.failed <= restarts,
                format!("the DAG went on after {restarts} of {faults} faults: {statistics:?}"),
            ),
            (
                faults > restarts || cost == 0,
                format!("without a fault the DAG was ended: {statistics:?}"),
            ),
        ];
        let broken = claims.into_iter().filter(|(holds, _)| !holds);
        broken.map(|(_, claim)| format!("it does not hold that {claim}"))
    }
}
