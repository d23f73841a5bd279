//! What one DAG of a report did.

use sched_dag::{DagId, DagKey, DagStatistics, SubtaskKey};

use crate::record::{InstanceRecord, JobRecord};
use crate::report::Report;

/// What one DAG did in a run.
///
/// See [`Report::dag`].
#[derive(Clone, Copy, Debug)]
pub struct DagReport<'r> {
    report: &'r Report,
    id: DagId,
}

impl Report {
    /// Returns what a DAG did, which is asked for by its name, or by the handle that built it.
    ///
    /// # Panics
    ///
    /// If there is no such DAG: a test that asks for one is wrong.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let machine = VirtualTime::new();
    /// let (dag, ms) = (create_dag(), Duration::from_millis);
    /// dag.name("clock").jobs(2).relative_deadline(ms(5));
    /// let tick = SubtaskAttributes::named("tick").wcet(ms(1));
    /// dag.register_periodic_subtask(|| (), vec![], ms(10), tick);
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// let report = machine.run();
    /// let clock = report.dag("clock");
    /// assert_eq!(clock.statistics().completed, 2);
    /// assert_eq!(clock.jobs().filter_map(|job| job.response_time_ns()).max(), Some(1_000_000));
    /// assert_eq!(clock.subtask("tick")[1].start_ns, Some(10_000_000));
    /// assert_eq!((clock.sink_misses("tick"), clock.is_degraded()), (0, false));
    /// assert_eq!(report.dags().count(), 1);
    /// ```
    #[must_use]
    #[track_caller]
    pub fn dag(&self, dag: impl DagKey) -> DagReport<'_> {
        DagReport {
            report: self,
            id: self.task_set().find(dag),
        }
    }

    /// Returns what each DAG did, in the order of the commit.
    ///
    /// See [`dag`](Self::dag).
    pub fn dags(&self) -> impl Iterator<Item = DagReport<'_>> {
        let ids = (0..).map(DagId).take(self.task_set().dags().len());
        ids.map(|id| DagReport { report: self, id })
    }
}

impl<'r> DagReport<'r> {
    /// Returns the scheduler's counters.
    ///
    /// See [`Report::dag`].
    #[must_use]
    pub fn statistics(&self) -> &'r DagStatistics {
        self.report.statistics(self.id)
    }

    /// Returns in how many jobs a sink was late.
    ///
    /// # Panics
    ///
    /// If it is no sink of the DAG.
    ///
    /// See [`Report::dag`].
    #[must_use]
    #[track_caller]
    pub fn sink_misses(&self, sink: impl SubtaskKey) -> u64 {
        self.report.sink_misses(self.id, sink)
    }

    /// Reports whether a subtask of the DAG has fallen back on its second function.
    ///
    /// See [`Report::dag`].
    #[must_use]
    pub fn is_degraded(&self) -> bool {
        self.report.degraded[self.id.index()]
    }

    /// Returns the jobs that were released, in that order.
    ///
    /// See [`Report::dag`].
    pub fn jobs(&self) -> impl Iterator<Item = &'r JobRecord> + use<'r> {
        let id = self.id;
        self.report.jobs.iter().filter(move |job| job.dag == id)
    }

    /// Returns the records of a subtask's instances, in the order of its jobs.
    ///
    /// # Panics
    ///
    /// If there is no such subtask.
    ///
    /// See [`Report::dag`].
    #[must_use]
    #[track_caller]
    pub fn subtask(&self, subtask: impl SubtaskKey) -> Vec<InstanceRecord> {
        let subtask = self.report.task_set().dag(self.id).find(subtask);
        let all = self.report.instances.iter();
        let is_of = |record: &&InstanceRecord| {
            (record.instance.dag, record.instance.subtask) == (self.id, subtask)
        };
        all.filter(is_of).copied().collect()
    }
}
