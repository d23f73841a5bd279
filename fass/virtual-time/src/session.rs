//! A plan while it runs: the scheduler's driver, the bodies and the journal.
//!
//! The driver is `sched_dag::virtual_time`, the one loop in virtual time; it
//! asks for the execution time of each instance at its start. [`Runner`] answers
//! by running the instance's real body and adding up what it executed.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use fass::{Body, Plan};
use sched_dag::Recorder;
use sched_dag::journal::What;
use sched_dag::virtual_time::{End, VirtualTime as Driver, Workload};
use sched_dag::{
    CoreId, Dag, DagId, DagLabel, Instance, JobOutcome, Observer, SchedulerOptions, SubtaskLabel,
    TaskSet,
};

use crate::edge::Edge;
use crate::error::RunError;
use crate::record::PanicRecord;
use crate::report::Report;
use crate::surroundings::Surroundings;

/// A plan that runs, or can go on running.
#[derive(Debug)]
pub(crate) struct Session {
    task_set: Arc<TaskSet>,
    options: SchedulerOptions,
    driver: Driver,
    bodies: Vec<Vec<Body>>,
    /// By DAG, the one that gets a signal when a fault ends it.
    after_fault: Vec<Option<DagId>>,
    /// What replaces them after faults.
    others: Vec<Vec<Vec<Body>>>,
    recording: Recording,
}

impl Session {
    pub(crate) fn new(plan: Plan, options: SchedulerOptions) -> Self {
        let task_set = plan.task_set;
        Self {
            driver: Driver::of_clusters(&task_set, options),
            options,
            recording: Recording {
                journal: Recorder::new(Arc::clone(&task_set)),
                executed_ns: BTreeMap::new(),
                panics: Vec::new(),
                degraded: vec![false; task_set.dags().len()],
                run_until_ns: 0,
            },
            bodies: plan.bodies,
            after_fault: plan.after_fault,
            others: plan.others,
            task_set,
        }
    }

    /// Runs for a duration, or to the end.
    pub(crate) fn run(
        &mut self,
        machine: &Surroundings,
        duration: Option<Duration>,
    ) -> Result<Report, RunError> {
        let until_ns = match duration {
            Some(duration) => {
                let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
                self.recording.run_until_ns.saturating_add(ns)
            }
            None => {
                self.require_end()?;
                u64::MAX
            }
        };
        let mut runner = Runner {
            task_set: &self.task_set,
            machine,
            bodies: &mut self.bodies,
            after_fault: &self.after_fault,
            others: &mut self.others,
            recording: &mut self.recording,
            panic: None,
        };
        let end = self.driver.run_until(until_ns, &mut runner);
        let panic = runner.panic;
        self.recording.run_until_ns = until_ns;
        machine.now_ns.set(match end {
            End::TimeReached => until_ns,
            End::Finished | End::TimeOverflow(_) | End::Stopped => self.recording.journal.now_ns,
        });
        if let Some(PanicRecord { instance, message }) = panic {
            return Err(RunError::Panicked {
                dag: self.dag_label(instance.dag),
                subtask: self.subtask_label(instance),
                job: instance.job,
                message,
                report: Box::new(self.report(&machine.edge, false)),
            });
        }
        match end {
            End::Finished | End::TimeReached | End::Stopped => {
                Ok(self.report(&machine.edge, end == End::Finished))
            }
            End::TimeOverflow(instance) => Err(RunError::TimeOverflow {
                dag: self.dag_label(instance.dag),
                subtask: self.subtask_label(instance),
                job: instance.job,
            }),
        }
    }

    fn require_end(&self) -> Result<(), RunError> {
        let mut dags = (0..).map(DagId).zip(self.task_set.dags());
        match dags.find(|(_, dag)| dag.jobs().is_none() && !dag.is_sporadic()) {
            None => Ok(()),
            Some((dag, _)) => Err(RunError::Endless {
                dag: self.dag_label(dag),
            }),
        }
    }

    fn dag_label(&self, id: DagId) -> DagLabel {
        let name = self.task_set.dag(id).name().to_owned();
        DagLabel { id, name }
    }

    fn subtask_label(&self, instance: Instance) -> SubtaskLabel {
        let id = instance.subtask;
        let name = self
            .task_set
            .dag(instance.dag)
            .subtask(id)
            .name()
            .to_owned();
        SubtaskLabel { id, name }
    }

    /// Returns the recording of the run so far.
    pub(crate) fn recording(&self, edge: &Edge) -> Vec<u8> {
        let events = &self.recording.journal.events;
        edge.recording(&self.task_set, events, &self.report(edge, false).record())
    }

    fn report(&self, edge: &Edge, is_over: bool) -> Report {
        let (compared, uncompared, divergence) = edge.outcome(is_over);
        let dags = (0..).map(DagId).zip(self.task_set.dags());
        let sink_misses = |(dag, model): (DagId, &Dag)| {
            let sinks = model.sinks().iter();
            sinks
                .map(|&sink| self.driver.scheduler_of(dag).sink_misses(dag, sink))
                .collect()
        };
        let sink_misses = dags.clone().map(sink_misses).collect();
        let statistics = dags.map(|(dag, _)| *self.driver.scheduler_of(dag).statistics(dag));
        let Recording {
            journal,
            panics,
            degraded,
            ..
        } = &self.recording;
        let mut report = Report {
            instances: Vec::new(),
            jobs: Vec::new(),
            panics: panics.clone(),
            degraded: degraded.clone(),
            events: journal.events.clone(),
            statistics: statistics.collect(),
            sink_misses,
            end_ns: journal.now_ns,
            compared,
            uncompared,
            divergence,
            task_set: Arc::clone(&self.task_set),
            options: self.options,
        };
        report.look_at_events(&self.recording.executed_ns);
        report
    }
}

/// What is written down of a run.
#[derive(Debug)]
struct Recording {
    journal: Recorder,
    /// How long each instance executes in all.
    executed_ns: BTreeMap<Instance, u64>,
    /// The contained panics.
    panics: Vec<PanicRecord>,
    /// For each DAG whether a subtask of it has fallen back.
    degraded: Vec<bool>,
    run_until_ns: u64,
}

/// The workload of the driver: runs bodies, and passes all else to the recorder.
struct Runner<'s> {
    task_set: &'s TaskSet,
    machine: &'s Surroundings,
    bodies: &'s mut [Vec<Body>],
    after_fault: &'s [Option<DagId>],
    others: &'s mut [Vec<Vec<Body>>],
    recording: &'s mut Recording,
    /// The panic that fails the run and stops it. In what is left of its instant
    /// nothing runs, and nothing is recorded.
    panic: Option<PanicRecord>,
}

impl Runner<'_> {
    fn body(&mut self, instance: Instance) -> &mut Body {
        &mut self.bodies[instance.dag.index()][instance.subtask.index()]
    }

    /// Notes the next recorded signal of a DAG, if there is one.
    fn signal_next(&self, dag: DagId) {
        let machine = self.machine;
        if let Some(time_ns) = machine.edge.next_signal_ns(dag) {
            let time_ns = time_ns.max(self.recording.journal.now_ns);
            machine.signal_of_replay_at(time_ns, dag);
        }
    }

    /// Puts another body into the place of one that a fault has ended, if there is one.
    fn replace(&mut self, instance: Instance) {
        let others = &mut self.others[instance.dag.index()][instance.subtask.index()];
        if let Some(mut next) = others.pop() {
            next.take_over();
            self.recording.degraded[instance.dag.index()] |= next.is_fallback();
            *self.body(instance) = next;
        }
    }
}

impl Workload for Runner<'_> {
    fn execute(&mut self, instance: Instance, now_ns: u64) -> u64 {
        if self.panic.is_some() {
            return 0;
        }
        let machine = self.machine;
        if machine.edge.passes_over(instance) {
            self.body(instance).discard(instance.job);
            return 0;
        }
        machine.now_ns.set(now_ns);
        machine.executed_ns.set(Some(0));
        machine.edge.begin(instance);
        let body = self.body(instance);
        // Unwind safety: a body that panicked is never run again, and the
        // machine's cells hold plain numbers.
        let result = catch_unwind(AssertUnwindSafe(|| body.run(instance.job)));
        machine.edge.end(instance, now_ns);
        let mut executed_ns = machine.executed_ns.take().unwrap_or(0);
        if executed_ns == 0 && result.is_ok() {
            let subtask = self.task_set.dag(instance.dag).subtask(instance.subtask);
            executed_ns = machine.silent.get().of_call_ns(instance, subtask.wcet_ns());
        }
        if let Err(payload) = result {
            let message = (payload.downcast_ref::<String>().map(String::as_str))
                .or_else(|| payload.downcast_ref::<&str>().copied())
                .unwrap_or("(a payload that is no text)")
                .to_owned();
            let panic = PanicRecord { instance, message };
            if !machine.contains_panics.get() {
                self.body(instance).failed(now_ns);
                self.panic = Some(panic);
                self.recording.journal.close();
                return 0;
            }
            self.recording.panics.push(panic);
            self.body(instance).failed(now_ns);
            if machine.edge.is_replayed(instance.dag) {
                // What it cuts is recorded, and is passed over.
                self.replace(instance);
            }
        }
        self.recording.executed_ns.insert(instance, executed_ns);
        executed_ns
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let mut panics = self.recording.panics.iter();
        !self.machine.edge.is_replayed(instance.dag)
            && panics.any(|panic| panic.instance == instance)
    }

    fn is_replaceable(&mut self, instance: Instance) -> bool {
        let others = &self.others[instance.dag.index()][instance.subtask.index()];
        others.last().is_some_and(Body::can_take_over)
    }

    fn started(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.recording.journal.on_core(What::Start, instance, core);
    }

    fn preempted(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.recording
            .journal
            .on_core(What::Suspend, instance, core);
    }

    fn resumed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.recording.journal.on_core(What::Resume, instance, core);
    }

    fn stops(&self) -> bool {
        self.panic.is_some()
    }

    fn instant(&mut self, now_ns: u64) {
        if self.panic.is_none() {
            self.recording.journal.now_ns = now_ns;
        }
    }

    fn next_signal_ns(&self) -> Option<u64> {
        self.machine.next_signal_ns()
    }

    fn take_signal(&mut self, now_ns: u64) -> Option<DagId> {
        self.machine.take_signal(now_ns)
    }

    fn finished(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        if self.panic.is_none() {
            let machine = self.machine;
            let raise = &mut |dag| machine.signal_at(now_ns, dag);
            self.body(instance).complete(now_ns, raise);
            machine.wires.collect();
        }
        self.recording.journal.on_core(What::Finish, instance, core);
    }

    fn failed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.recording.journal.on_core(What::Ended, instance, core);
    }
}

impl Observer for Runner<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.recording.journal.released(dag, job, release_ns);
        self.signal_next(dag);
    }

    fn queued(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.recording.journal.queued(dag, job, release_ns);
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.recording.journal.skipped(dag, job, release_ns);
        self.signal_next(dag);
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        self.recording.journal.signalled(dag, job, release_ns);
    }

    fn ready(&mut self, instance: Instance) {
        self.recording.journal.ready(instance);
    }

    fn cancelled(&mut self, instance: Instance) {
        self.recording.journal.cancelled(instance);
        if self.panic.is_none() {
            // Functions run at the start of their instances, so whatever the
            // predecessors will ever send has been sent.
            self.body(instance).discard(instance.job);
        }
    }

    fn restarted(&mut self, instance: Instance) {
        self.recording.journal.restarted(instance);
        self.replace(instance);
    }

    fn ended(&mut self, dag: DagId) {
        self.recording.journal.ended(dag);
        // Nothing but a fault ends a DAG here.
        if let Some(handler) = self.after_fault[dag.index()] {
            self.machine
                .signal_at(self.recording.journal.now_ns, handler);
        }
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.recording.journal.aborted(dag, job);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        let journal = &mut self.recording.journal;
        journal.deadline_missed(dag, job, deadline_ns);
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.recording.journal.job_completed(dag, job, outcome);
    }
}
