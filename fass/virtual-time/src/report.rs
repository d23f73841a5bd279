//! Reports of runs: of the whole run, of each DAG, each job and each instance.

use std::collections::BTreeMap;
use std::ops::Deref;

use fass::edge::ReplayOutcome;
use fass::log::LogLine;
use sched_dag::engine::Run;
use sched_dag::journal::{Event, EventKind};
use sched_dag::law::{self, JudgeOptions, Violation};
use sched_dag::{DagId, DagKey, DagStatistics, Instance, SubtaskKey};

use crate::edge::Divergence;

/// Everything from the commit to the end of a run: the engine's [`Run`], and facts known only in
/// virtual time.
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
/// assert_eq!(report.statistics("clock").completed, 2); // as of any run
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
    /// The released jobs, in the order of their releases.
    pub jobs: Vec<JobRecord>,
    /// The [contained](crate::VirtualTime::contain_panics) panics, exceeded budgets and [injected
    /// faults](crate::VirtualTime::fault), in the order in which their functions ran; none without
    /// containment.
    pub panics: Vec<PanicRecord>,
    /// By DAG, whether a subtask has fallen back on its second function.
    pub(crate) degraded: Vec<bool>,
    /// All events in order of occurrence.
    pub events: Vec<Event>,
    /// The lines of the [log](fass::log!) so far, in the form shown on other platforms: a level,
    /// DAG, subtask and job, the time, the text and the fields.
    pub logs: Vec<String>,
    /// The time of the last event.
    pub end_ns: u64,
    /// In a replay, how many values were compared with recorded ones.
    pub compared: u64,
    /// In a replay, how many recorded values this run has not computed (yet).
    pub uncompared: u64,
    /// In a replay, the first value differing from the recorded one.
    pub divergence: Option<Divergence>,
    /// In a replay, the first DAG that begins with a job after job 0, and that job: its functions
    /// lack their memory of earlier jobs. A DAG with a record of all its states there does not
    /// count, unless a fault replaced a function before.
    pub lacking: Option<(String, u64)>,
    pub(crate) run: Run,
    /// How late interrupts may have been, in nanoseconds.
    pub(crate) late_ns: u64,
}

impl Deref for Report {
    type Target = Run;

    fn deref(&self) -> &Run {
        &self.run
    }
}

impl Report {
    /// Makes the report of a run that has reached `end_ns`, with the execution times of its
    /// instances and without panics.
    pub(crate) fn new(
        run: Run,
        end_ns: u64,
        executed_ns: &BTreeMap<Instance, u64>,
        logs: &[LogLine],
        outcome: ReplayOutcome,
    ) -> Self {
        let events: Vec<Event> = run.journal().events().collect();
        let of = |what| events.iter().filter(move |event| event.what == what);
        let ready = of(EventKind::Ready).filter_map(Event::instance);
        let instances = ready.filter_map(|instance| {
            let execution_ns = executed_ns.get(&instance).copied();
            Some(InstanceRecord {
                instance,
                execution_ns: execution_ns.unwrap_or(0),
                times: *run.record().instance(instance)?,
            })
        });
        let jobs = of(EventKind::Released).filter_map(|&Event { dag, job, .. }| {
            let times = *run.record().job(dag, job)?;
            Some(JobRecord { dag, job, times })
        });
        let shown = |line: &LogLine| line.shown(Some(run.task_set())).to_string();
        Self {
            instances: instances.collect(),
            jobs: jobs.collect(),
            panics: Vec::new(),
            degraded: Vec::new(),
            logs: logs.iter().map(shown).collect(),
            end_ns,
            compared: outcome.compared,
            uncompared: outcome.uncompared,
            divergence: outcome.divergence,
            lacking: outcome.lacking,
            events,
            run,
            late_ns: 0,
        }
    }

    /// Returns the record of one instance, if the instance became ready.
    pub fn instance(&self, instance: Instance) -> Option<&InstanceRecord> {
        (self.instances.iter()).find(|record| record.instance == instance)
    }

    /// Reports whether no call took any time: then response times and met deadlines mean nothing.
    ///
    /// See [`VirtualTime::silent`](crate::VirtualTime::silent).
    pub fn took_no_time(&self) -> bool {
        self.instances.iter().all(|record| record.execution_ns == 0)
    }

    /// Returns a warning if no call took any time, because then the times mean nothing.
    pub(crate) fn warning(&self) -> Option<String> {
        let calls = self.instances.len();
        (calls > 0 && self.took_no_time()).then(|| {
            format!(
                "virtual time: no call of {calls} took any time, so response times and deadlines \
                 say nothing; state WCETs, or call `fass::execute_for`"
            )
        })
    }

    /// Checks the rules of the task model over the recorded events (R1 to R5, and those for waits
    /// and tables), and returns the violations: none, unless the scheduler is wrong.
    ///
    /// After a panic ([`RunError::Panicked`](crate::RunError::Panicked)) the last instant is
    /// incomplete, and may seem to break the rules.
    #[must_use]
    pub fn violations(&self) -> Vec<Violation> {
        // A test that changed times may have put the events out of order.
        let mut events = self.events.clone();
        events.sort_by_key(|event| event.time_ns);
        let events = events.iter().copied();
        let (task_set, late_ns) = (self.task_set(), self.late_ns);
        // With any tolerance, the lateness of a timer is not judged, except for a timer ending a
        // wait.
        let terms = JudgeOptions {
            late_ns,
            ..JudgeOptions::whole((late_ns > 0).into())
        };
        let mut found = law::violations(task_set, terms, events.clone());
        let of_dispatch = law::dispatch_violations(task_set, &self.options(), terms, events);
        found.extend(of_dispatch);
        found
    }

    /// Returns the events as lines such as `5000000 start sink[0] core 1`: the time, the event, the
    /// name with the job in brackets, and further facts. An event of a whole DAG, such as a pause,
    /// names no job.
    ///
    /// For tests that compare whole sequences in words.
    #[must_use]
    pub fn event_lines(&self) -> Vec<String> {
        self.events.iter().map(|event| self.line(event)).collect()
    }

    fn line(&self, event: &Event) -> String {
        let Event {
            time_ns,
            what,
            dag,
            job,
            ..
        } = *event;
        let or_number = |name: &str, kind, number| match name {
            "" => format!("{kind} {number}"),
            _ => name.into(),
        };
        let model = self.task_set().dag(dag);
        let name = match event.subtask {
            Some(subtask) => or_number(model.subtask(subtask).name(), "subtask", subtask.0),
            None => or_number(model.name(), "dag", dag.0),
        };
        let outcome = || self.record().job(dag, job)?.outcome;
        let more = match what {
            EventKind::Entered => return format!("{time_ns} entered mode {job}"),
            _ if what.is_of_dag() => return format!("{time_ns} {what} {name}"),
            _ if what.is_of_machine() => format!(" core {}", event.core.0),
            EventKind::Completed => {
                outcome().map_or(String::new(), |outcome| format!(" {outcome:?}"))
            }
            _ => String::new(),
        };
        format!("{time_ns} {what} {name}[{job}]{}", more.to_lowercase())
    }
}

/// The report of one DAG in a run.
///
/// See [`Report::dag`].
#[derive(Clone, Copy, Debug)]
pub struct DagReport<'r> {
    report: &'r Report,
    id: DagId,
}

impl Report {
    /// Returns the report of a DAG, selected by name or by the handle that built the DAG.
    ///
    /// # Panics
    ///
    /// If there is no such DAG: a test asking for one is wrong.
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
    /// dag.register_periodic_subtask(|| (), [], ms(10), tick);
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
    #[track_caller]
    pub fn dag(&self, dag: impl DagKey) -> DagReport<'_> {
        DagReport {
            report: self,
            id: self.task_set().find(dag),
        }
    }

    /// Returns the report of each DAG, in the order of the commit.
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
    pub fn statistics(&self) -> &'r DagStatistics {
        self.report.statistics(self.id)
    }

    /// Returns the number of jobs in which a sink was late.
    ///
    /// # Panics
    ///
    /// If the subtask is not a sink of the DAG.
    ///
    /// See [`Report::dag`].
    #[track_caller]
    pub fn sink_misses(&self, sink: impl SubtaskKey) -> u64 {
        self.report.sink_misses(self.id, sink)
    }

    /// Reports whether a subtask of the DAG has fallen back on its second function.
    ///
    /// See [`Report::dag`].
    pub fn is_degraded(&self) -> bool {
        self.report.degraded[self.id.index()]
    }

    /// Returns the released jobs, in the order of their releases.
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

/// An instance that became ready, with its [times](law::InstanceRecord).
///
/// See [`Report`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstanceRecord {
    /// The instance.
    pub instance: Instance,
    /// The total execution time, in nanoseconds, known once the instance has started; for a waiting
    /// subtask, the time of the turns so far.
    pub execution_ns: u64,
    pub(crate) times: law::InstanceRecord,
}

/// A released job, with its [times](law::JobRecord).
///
/// See [`Report`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobRecord {
    /// The DAG.
    pub dag: DagId,
    /// The job.
    pub job: u64,
    pub(crate) times: law::JobRecord,
}

impl Deref for InstanceRecord {
    type Target = law::InstanceRecord;

    fn deref(&self) -> &law::InstanceRecord {
        &self.times
    }
}

impl Deref for JobRecord {
    type Target = law::JobRecord;

    fn deref(&self) -> &law::JobRecord {
        &self.times
    }
}

/// A contained panic, exceeded budget or injected fault: it ended its DAG or cost a job, and the
/// run went on. In a replay, the recorded cuts state the cost.
///
/// See [`contain_panics`](crate::VirtualTime::contain_panics).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PanicRecord {
    /// The failed instance.
    pub instance: Instance,
    /// The panic's message.
    pub message: String,
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
