//! A plan while it runs: the scheduler's driver, the bodies and the recorder.
//!
//! The driver is `sched_dag::virtual_time`, the one loop in virtual time; it
//! asks for the execution time of each instance at its start. [`Runner`] answers
//! by running the instance's real body and adding up what it executed.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use fass::{Body, Plan};
use sched_dag::virtual_time::{End, VirtualTime as Driver, Workload};
use sched_dag::{
    CoreId, DagId, DagLabel, Instance, JobOutcome, Observer, Scheduler, SchedulerOptions,
    SubtaskLabel, TaskSet,
};

use crate::error::RunError;
use crate::event::EventKind;
use crate::platform::Machine;
use crate::record::PanicRecord;
use crate::recorder::Recorder;
use crate::report::Report;

/// A plan that runs, or can go on running.
#[derive(Debug)]
pub(crate) struct Session {
    task_set: Arc<TaskSet>,
    driver: Driver,
    bodies: Vec<Vec<Body>>,
    recorder: Recorder,
}

impl Session {
    pub(crate) fn new(plan: Plan, machine: &Machine) -> Self {
        let task_set = Arc::new(plan.task_set);
        let options = SchedulerOptions {
            policy: machine.policy.get(),
            preemption: machine.preemption.get(),
            cores: machine.cores.get(),
        };
        Self {
            driver: Driver::new(Scheduler::new(Arc::clone(&task_set), options)),
            recorder: Recorder::new(Arc::clone(&task_set)),
            bodies: plan.bodies,
            task_set,
        }
    }

    /// Runs for a duration, or to the end.
    pub(crate) fn run(
        &mut self,
        machine: &Machine,
        duration: Option<Duration>,
    ) -> Result<Report, RunError> {
        let until_ns = match duration {
            Some(duration) => {
                let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
                self.recorder.run_until_ns.saturating_add(ns)
            }
            None => {
                self.require_end()?;
                u64::MAX
            }
        };
        let mut runner = Runner {
            machine,
            bodies: &mut self.bodies,
            recorder: &mut self.recorder,
            panic: None,
            now_ns: 0,
        };
        let end = self.driver.run_until(until_ns, &mut runner);
        let panic = runner.panic;
        self.recorder.run_until_ns = until_ns;
        machine.now_ns.set(match end {
            End::TimeReached => until_ns,
            End::Finished | End::TimeOverflow(_) | End::Stopped => self.recorder.now_ns,
        });
        if let Some(PanicRecord { instance, message }) = panic {
            return Err(RunError::Panicked {
                dag: self.dag_label(instance.dag),
                subtask: self.subtask_label(instance),
                job: instance.job,
                message,
                report: Box::new(self.report()),
            });
        }
        match end {
            End::Finished | End::TimeReached | End::Stopped => Ok(self.report()),
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

    fn report(&self) -> Report {
        let scheduler = self.driver.scheduler();
        let dags = (0..).map(DagId).zip(self.task_set.dags());
        Report {
            instances: self.recorder.instances.clone(),
            jobs: self.recorder.jobs.clone(),
            panics: self.recorder.panics.clone(),
            events: self.recorder.events.clone(),
            statistics: dags.map(|(dag, _)| *scheduler.statistics(dag)).collect(),
            end_ns: self.recorder.now_ns,
            task_set: Arc::clone(&self.task_set),
            options: scheduler.options(),
        }
    }
}

/// The workload of the driver: runs bodies, and passes all else to the recorder.
struct Runner<'s> {
    machine: &'s Machine,
    bodies: &'s mut [Vec<Body>],
    recorder: &'s mut Recorder,
    /// The panic that fails the run and stops it. In what is left of its instant
    /// nothing runs, and nothing is recorded.
    panic: Option<PanicRecord>,
    /// The present instant.
    now_ns: u64,
}

impl Runner<'_> {
    fn body(&mut self, instance: Instance) -> &mut Body {
        &mut self.bodies[instance.dag.index()][instance.subtask.index()]
    }

    /// Returns the recorder, unless the run has failed.
    fn recorder(&mut self) -> Option<&mut Recorder> {
        self.panic.is_none().then_some(&mut *self.recorder)
    }
}

impl Workload for Runner<'_> {
    fn execute(&mut self, instance: Instance, now_ns: u64) -> u64 {
        if self.panic.is_some() {
            return 0;
        }
        let machine = self.machine;
        machine.now_ns.set(now_ns);
        machine.executed_ns.set(Some(0));
        let body = self.body(instance);
        // Unwind safety: a body that panicked is never run again, and the
        // machine's cells hold plain numbers.
        let result = catch_unwind(AssertUnwindSafe(|| body.run(instance.job)));
        let executed_ns = machine.executed_ns.take().unwrap_or(0);
        if let Err(payload) = result {
            let message = (payload.downcast_ref::<String>().map(String::as_str))
                .or_else(|| payload.downcast_ref::<&str>().copied())
                .unwrap_or("(a payload that is no text)")
                .to_owned();
            let panic = PanicRecord { instance, message };
            if !machine.contains_panics.get() {
                self.panic = Some(panic);
                return 0;
            }
            self.recorder.panics.push(panic);
        }
        self.recorder
            .of(instance, |record| record.execution_ns = executed_ns);
        executed_ns
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let mut panics = self.recorder.panics.iter();
        panics.any(|panic| panic.instance == instance)
    }

    fn started(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.at(now_ns, EventKind::Started { instance, core });
        recorder.of(instance, |record| {
            record.start_ns = Some(now_ns);
            record.core = Some(core);
        });
    }

    fn preempted(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.at(now_ns, EventKind::Preempted { instance, core });
        recorder.of(instance, |record| record.preemptions += 1);
    }

    fn resumed(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.at(now_ns, EventKind::Resumed { instance, core });
    }

    fn stops(&self) -> bool {
        self.panic.is_some()
    }

    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
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
        }
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.at(now_ns, EventKind::Finished { instance, core });
        recorder.of(instance, |record| record.finish_ns = Some(now_ns));
    }

    fn failed(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.at(now_ns, EventKind::Failed { instance, core });
        recorder.of(instance, |record| record.failed_ns = Some(now_ns));
    }
}

impl Observer for Runner<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        if let Some(recorder) = self.recorder() {
            recorder.released(dag, job, release_ns);
        }
    }

    fn queued(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.at(release_ns, EventKind::Queued { dag, job });
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.at(release_ns, EventKind::Skipped { dag, job });
    }

    fn signalled(&mut self, dag: DagId, _job: u64, release_ns: Option<u64>) {
        let now_ns = self.now_ns;
        if let Some(recorder) = self.recorder() {
            recorder.at(now_ns, EventKind::Signalled { dag, release_ns });
        }
    }

    fn ready(&mut self, instance: Instance) {
        if let Some(recorder) = self.recorder() {
            recorder.ready(instance);
        }
    }

    fn cancelled(&mut self, instance: Instance) {
        if self.panic.is_some() {
            return;
        }
        self.recorder.now(EventKind::Cancelled { instance });
        // Functions run at the start of their instances, so whatever the
        // predecessors will ever send has been sent.
        self.body(instance).discard(instance.job);
    }

    fn ended(&mut self, dag: DagId) {
        if let Some(recorder) = self.recorder() {
            recorder.now(EventKind::DagEnded { dag });
        }
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        let Some(recorder) = self.recorder() else {
            return;
        };
        recorder.now(EventKind::Aborted { dag, job });
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        if let Some(recorder) = self.recorder() {
            recorder.deadline_missed(dag, job, deadline_ns);
        }
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        if let Some(recorder) = self.recorder() {
            recorder.job_completed(dag, job, outcome);
        }
    }
}
