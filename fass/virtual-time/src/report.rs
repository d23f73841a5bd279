//! What a run leaves behind.

use std::collections::BTreeMap;
use std::sync::Arc;

use sched_dag::chains::{Chain, Latencies};
use sched_dag::journal::{Event, What};
use sched_dag::law::{self, Record, Terms, Violation};
use sched_dag::{DagStatistics, Instance, SchedulerOptions, TaskSet};

use crate::edge::Divergence;
use crate::record::{InstanceRecord, JobRecord, PanicRecord};

/// Everything that happened from the commit to the end of a run.
///
/// ```
/// use std::time::Duration;
/// use fass::{Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// let ms = Duration::from_millis;
/// dag.name("clock").jobs(2).period(ms(10)).relative_deadline(ms(10));
/// let tick = move |_job| execute_for(ms(1), Occupation::Hold);
/// dag.register_untyped_subtask(tick, SubtaskAttributes::named("tick"));
/// finish_create_dags(&[dag]).unwrap();
///
/// let report = machine.run();
/// let ticks = report.dag("clock").subtask("tick");
/// assert_eq!(report.instance(ticks[1].instance), Some(&ticks[1]));
/// assert_eq!(report.jobs[1].response_time_ns(), Some(1_000_000));
/// assert_eq!(report.task_set().dags().len(), 1);
/// assert_eq!(report.record().jobs(ticks[0].instance.dag).len(), 2);
/// assert!(report.event_lines().contains(&"10000000 start tick[1] core 0".to_string()));
/// assert_eq!(report.violations(), []);
/// assert_eq!(report.end_ns, 11_000_000);
/// ```
#[derive(Clone, Debug)]
pub struct Report {
    /// The instances that became ready, in that order.
    pub instances: Vec<InstanceRecord>,
    /// The jobs that were released, in that order.
    pub jobs: Vec<JobRecord>,
    /// The panics that were [contained](crate::VirtualTime::contain_panics), in
    /// the order in which their functions ran; none without containment.
    pub panics: Vec<PanicRecord>,
    /// For each DAG whether a subtask of it has fallen back on its second function.
    pub(crate) degraded: Vec<bool>,
    /// All events in the order in which they happened.
    pub events: Vec<Event>,
    /// The scheduler's counters, one set for each DAG.
    pub(crate) statistics: Vec<DagStatistics>,
    /// For each DAG, in how many jobs each of its sinks was late, in the order of
    /// [`Dag::sinks`](sched_dag::Dag::sinks).
    pub(crate) sink_misses: Vec<Vec<u64>>,
    /// The time of the last event.
    pub end_ns: u64,
    /// In a replay, how many values were compared with recorded ones.
    pub compared: u64,
    /// In a replay, how many recorded values this run has not computed (yet).
    pub uncompared: u64,
    /// In a replay, the first value that is not the recorded one.
    pub divergence: Option<Divergence>,
    /// In a replay, a DAG and its first job that is recorded, if that is not the first one it had:
    /// what its functions remember of jobs before is lacking.
    pub lacking: Option<(String, u64)>,
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) options: SchedulerOptions,
    /// Whether interrupts may have been late.
    pub(crate) is_late: bool,
}

impl Report {
    /// Returns the record of one instance, if it became ready.
    ///
    /// See [`Report`].
    #[must_use]
    pub fn instance(&self, instance: Instance) -> Option<&InstanceRecord> {
        (self.instances.iter()).find(|record| record.instance == instance)
    }

    /// Reports whether no call took any time: then response times and deadlines met say
    /// nothing.
    ///
    /// See [`VirtualTime::silent`](crate::VirtualTime::silent).
    #[must_use]
    pub fn took_no_time(&self) -> bool {
        self.instances.iter().all(|record| record.execution_ns == 0)
    }

    /// Returns what to tell people if nothing follows from the times.
    pub(crate) fn warning(&self) -> Option<String> {
        let calls = self.instances.len();
        (calls > 0 && self.took_no_time()).then(|| {
            format!(
                "virtual time: no call of {calls} took any time, so response times and deadlines \
                 say nothing; state WCETs, or call `fass::execute_for`"
            )
        })
    }

    /// Returns the verified model that ran.
    ///
    /// See [`Report`].
    #[must_use]
    pub fn task_set(&self) -> &TaskSet {
        &self.task_set
    }

    /// Returns the times in the form in which the kernel has them after a run,
    /// so that the same code can evaluate both.
    ///
    /// # Panics
    ///
    /// If there is no memory for another copy of all times.
    ///
    /// See [`Report`].
    #[must_use]
    pub fn record(&self) -> Record {
        let events = self.events.iter().copied();
        let record = Record::of_events(&self.task_set, true, events);
        record.expect("the report's jobs fit into memory")
    }

    /// Measures a chain that crosses DAGs: how old its outputs are, and how long it takes to
    /// react. [`fass::EndToEnd`] has an example.
    ///
    /// See [`Report`].
    #[must_use]
    pub fn latencies(&self, chain: &Chain) -> Latencies {
        chain.latencies(&self.task_set, self.events.iter().copied())
    }

    /// Checks rules R1 to R5 of the task model over what was recorded, and
    /// returns what breaks them: nothing, unless the scheduler is wrong.
    ///
    /// After a panic ([`RunError::Panicked`](crate::RunError::Panicked)) the
    /// last instant is incomplete, and may seem to break them.
    ///
    /// See [`Report`].
    #[must_use]
    pub fn violations(&self) -> Vec<Violation> {
        // A test that has changed times may have put them out of order.
        let mut events = self.events.clone();
        events.sort_by_key(|event| event.time_ns);
        let events = events.iter().copied();
        // With any tolerance it is not judged how late a timer is.
        let (task_set, terms) = (&self.task_set, Terms::whole(self.is_late.into()));
        let mut found = law::violations(task_set, terms, events.clone());
        let of_dispatch = law::dispatch_violations(task_set, &self.options, terms, events);
        found.extend(of_dispatch);
        found
    }

    /// Returns the events as lines such as `5000000 start sink[0] core 1`: time, what
    /// has happened, name with the job in brackets, and what else there is. That a DAG
    /// is stopped has no job.
    ///
    /// For tests that compare whole sequences in words.
    ///
    /// See [`Report`].
    #[must_use]
    pub fn event_lines(&self) -> Vec<String> {
        self.events.iter().map(|event| self.line(event)).collect()
    }

    fn line(&self, event: &Event) -> String {
        let Event {
            time_ns, what, job, ..
        } = event;
        let dag = self.task_set.label(event.dag);
        let or_number = |name: String, number: String| match name.is_empty() {
            true => number,
            false => name,
        };
        let dag = or_number(dag.name, format!("dag {}", dag.id.0));
        let name = match event.instance() {
            Some(instance) => {
                let subtask = self.task_set.subtask_label(instance.dag, instance.subtask);
                or_number(subtask.name, format!("subtask {}", subtask.id.0))
            }
            None if *what == What::Entered => return format!("{time_ns} entered mode {job}"),
            None if what.is_of_dag() => return format!("{time_ns} {what} {dag}"),
            None => dag,
        };
        let more = match what {
            _ if what.is_of_machine() => format!(" core {}", event.core.0),
            What::Completed => {
                let mut jobs = self.jobs.iter();
                let of_job = jobs.find(|of_job| (of_job.dag, of_job.job) == (event.dag, *job));
                let outcome = of_job.and_then(|of_job| of_job.outcome);
                let outcome = outcome.map_or(String::new(), |outcome| format!(" {outcome:?}"));
                outcome.to_lowercase()
            }
            _ => String::new(),
        };
        format!("{time_ns} {what} {name}[{job}]{more}")
    }

    /// Fills in what the events say about instances and jobs.
    pub(crate) fn look_at_events(&mut self, executed_ns: &BTreeMap<Instance, u64>) {
        let record = self.record();
        for event in &self.events {
            let Event { dag, job, .. } = *event;
            match (event.what, event.instance()) {
                (What::Released, _) => self.jobs.extend(record.job(dag, job).map(|times| {
                    let release_ns = times.release_ns.unwrap_or(event.time_ns);
                    let deadline_ns = self.task_set.dag(dag).relative_deadline_ns();
                    JobRecord {
                        dag,
                        job,
                        release_ns,
                        deadline_ns: release_ns.saturating_add(deadline_ns),
                        times: *times,
                    }
                })),
                (What::Ready, Some(instance)) => {
                    let execution_ns = executed_ns.get(&instance).copied().unwrap_or(0);
                    let times = record.instance(instance).copied();
                    self.instances.extend(times.map(|times| InstanceRecord {
                        instance,
                        execution_ns,
                        times,
                    }));
                }
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use fass::{SubtaskAttributes, create_dag, finish_create_dags};

    use crate::VirtualTime;

    #[test]
    fn a_run_in_which_no_time_passes_is_told() {
        let warning = |attributes: SubtaskAttributes| {
            let machine = VirtualTime::new();
            let (dag, period) = (create_dag(), Duration::from_millis(10));
            dag.period(period).relative_deadline(period).jobs(3);
            dag.register_untyped_subtask(|_| (), attributes);
            finish_create_dags(&[dag]).expect("the DAG is right");
            machine.run().warning()
        };
        let tick = SubtaskAttributes::named("tick");
        let said = warning(tick.clone()).expect("nothing took any time");
        assert!(said.contains("no call of 3 took any time"), "{said}");
        assert_eq!(warning(tick.wcet(Duration::from_millis(1))), None);
    }
}
