//! What a run leaves behind.

use std::ops::Deref;

use fass::edge::Outcome;
use fass::log::Line;
use sched_dag::Instance;
use sched_dag::engine::Run;
use sched_dag::journal::{Event, What};
use sched_dag::law::{self, Terms, Violation};

use crate::calls::Calls;
use crate::edge::Divergence;
use crate::record::{InstanceRecord, JobRecord, PanicRecord};

/// Everything that happened from the commit to the end of a run: the engine's [`Run`], and what
/// only virtual time knows.
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
    /// The jobs that were released, in that order.
    pub jobs: Vec<JobRecord>,
    /// The panics that were [contained](crate::VirtualTime::contain_panics), in
    /// the order in which their functions ran; none without containment.
    pub panics: Vec<PanicRecord>,
    /// For each DAG whether a subtask of it has fallen back on its second function.
    pub(crate) degraded: Vec<bool>,
    /// All events in the order in which they happened.
    pub events: Vec<Event>,
    /// The lines of the [log](fass::log!) so far, as people are shown them on other platforms: a
    /// level, DAG, subtask and job, the time, the text and the fields.
    pub logs: Vec<String>,
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
    run: Run,
    /// Whether interrupts may have been late.
    is_late: bool,
}

impl Deref for Report {
    type Target = Run;

    fn deref(&self) -> &Run {
        &self.run
    }
}

impl Report {
    /// Adds what is known of the calls to a run, which has come to `end_ns`.
    pub(crate) fn new(run: Run, end_ns: u64, calls: &Calls, outcome: Outcome) -> Self {
        let events: Vec<Event> = run.journal().events().collect();
        let of = |what| events.iter().filter(move |event| event.what == what);
        let ready = of(What::Ready).filter_map(Event::instance);
        let instances = ready.filter_map(|instance| {
            let execution_ns = calls.executed_ns.get(&instance).copied();
            Some(InstanceRecord {
                instance,
                execution_ns: execution_ns.unwrap_or(0),
                times: *run.record().instance(instance)?,
            })
        });
        let jobs = of(What::Released).filter_map(|event| JobRecord::new(&run, event));
        let logs = calls.machine.logs.borrow();
        let shown = |line: &Line| line.shown(Some(run.task_set())).to_string();
        Self {
            instances: instances.collect(),
            jobs: jobs.collect(),
            panics: calls.panics.clone(),
            degraded: calls.degraded.clone(),
            logs: logs.iter().map(shown).collect(),
            end_ns,
            compared: outcome.compared,
            uncompared: outcome.uncompared,
            divergence: outcome.divergence,
            lacking: outcome.lacking,
            events,
            run,
            is_late: calls.machine.settings.borrow().late.most_ns > 0,
        }
    }

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
        let (task_set, terms) = (self.task_set(), Terms::whole(self.is_late.into()));
        let mut found = law::violations(task_set, terms, events.clone());
        let of_dispatch = law::dispatch_violations(task_set, &self.options(), terms, events);
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
            What::Entered => return format!("{time_ns} entered mode {job}"),
            _ if what.is_of_dag() => return format!("{time_ns} {what} {name}"),
            _ if what.is_of_machine() => format!(" core {}", event.core.0),
            What::Completed => outcome().map_or(String::new(), |outcome| format!(" {outcome:?}")),
            _ => String::new(),
        };
        format!("{time_ns} {what} {name}[{job}]{}", more.to_lowercase())
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
