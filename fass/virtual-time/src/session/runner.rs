//! What a run does when its driver says so: bodies run, all else is written down.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use fass::{Body, Replacement};
use sched_dag::engine::Alternate;
use sched_dag::journal::What;
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::Workload;
use sched_dag::{CoreId, DagId, Instance, Notice, TaskSet};

use crate::disturbed;
use crate::record::PanicRecord;
use crate::surroundings::Surroundings;

/// The message of a fault that a test asked for.
const FAULT: &str = "a fault that was asked for";

/// What is written down of a run.
#[derive(Debug)]
pub(super) struct Recording {
    /// The present instant, or that of the panic that stops the run.
    pub(super) now_ns: u64,
    /// How long each instance executes in all.
    pub(super) executed_ns: BTreeMap<Instance, u64>,
    /// The contained panics.
    pub(super) panics: Vec<PanicRecord>,
    /// For each DAG whether a subtask of it has fallen back.
    pub(super) degraded: Vec<bool>,
    pub(super) run_until_ns: u64,
}

/// The workload of the driver: runs bodies, and passes all else to the recorder.
pub(super) struct Runner<'s> {
    pub(super) task_set: &'s TaskSet,
    pub(super) machine: &'s Surroundings,
    pub(super) bodies: &'s mut [Vec<Body>],
    pub(super) after_fault: &'s [Option<DagId>],
    pub(super) recording: &'s mut Recording,
    /// The panic that fails the run and stops it. In what is left of its instant
    /// nothing runs, and nothing is recorded.
    pub(super) panic: Option<PanicRecord>,
    /// Whether the job has ended at which the run shall stop.
    pub(super) has_arrived: bool,
}

impl Runner<'_> {
    fn body(&mut self, instance: Instance) -> &mut Body {
        &mut self.bodies[instance.dag.index()][instance.subtask.index()]
    }

    /// Notes that a job of a DAG is over, and with it those before.
    fn arrive_at(&mut self, dag: DagId, job: u64) {
        let until = self.machine.until.get();
        self.has_arrived |= until.is_some_and(|(of, last)| of == dag && last <= job);
    }

    /// Notes the next recorded signal of a DAG, if there is one.
    fn signal_next(&self, dag: DagId) {
        let machine = self.machine;
        if let Some(time_ns) = machine.edge.next_signal_ns(dag) {
            let time_ns = time_ns.max(self.recording.now_ns);
            machine.signal_of_replay_at(time_ns, dag);
        }
    }

    /// Returns what takes the place of a function that a fault has ended, if anything does.
    fn next(&mut self, instance: Instance) -> Option<Replacement> {
        (self.body(instance).replacement()).filter(Replacement::is_there)
    }

    /// Puts it there.
    fn replace(&mut self, instance: Instance) {
        if let Some(next) = self.next(instance) {
            self.recording.degraded[instance.dag.index()] |= next.is_fallback();
            self.body(instance).replace();
        }
    }
}

impl Workload for Runner<'_> {
    const HEARS: &'static [What] = &[
        What::Released,
        What::Skipped,
        What::Cancelled,
        What::Restarted,
        What::Stopped,
        What::Completed,
    ];

    fn hear(&mut self, notice: &Notice) {
        let (dag, job) = (notice.event.dag, notice.event.job);
        match (notice.event.what, notice.event.instance()) {
            (What::Released, _) => self.signal_next(dag),
            (What::Skipped, _) => {
                self.arrive_at(dag, job);
                self.signal_next(dag);
            }
            // Functions run at the start of their instances, so whatever the predecessors will
            // ever send has been sent.
            (What::Cancelled, Some(instance)) if self.panic.is_none() => {
                self.body(instance).discard(instance.job);
            }
            (What::Restarted, Some(instance)) => self.replace(instance),
            (What::Stopped, _) => {
                self.arrive_at(dag, u64::MAX);
                // Nothing but a fault ends a DAG here.
                if let Some(handler) = self.after_fault[dag.index()] {
                    self.machine.signal_at(self.recording.now_ns, handler);
                }
            }
            (What::Completed, _) => self.arrive_at(dag, job),
            _ => {}
        }
    }

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
        let fails = disturbed::fails(&machine.faults.borrow(), instance, self.task_set);
        let body = self.body(instance);
        // Unwind safety: a body that panicked is never run again, and the
        // machine's cells hold plain numbers.
        let result = catch_unwind(AssertUnwindSafe(|| {
            if fails {
                body.discard(instance.job);
                resume_unwind(Box::new(FAULT));
            }
            body.run(instance.job);
        }));
        machine.edge.end(instance, now_ns);
        let mut executed_ns = machine.executed_ns.take().unwrap_or(0);
        if executed_ns == 0 && (result.is_ok() || fails) {
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
                return 0;
            }
            self.recording.panics.push(panic);
            self.body(instance).failed(now_ns);
            if machine.edge.is_replayed(instance.dag) {
                // What it cuts is recorded, and is passed over.
                self.replace(instance);
                machine.edge.failed(instance, self.task_set);
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
        self.next(instance).is_some()
    }

    fn late_ns(&self, due_ns: u64) -> u64 {
        self.machine.late.get().of_interrupt_ns(due_ns)
    }

    fn stops(&self) -> bool {
        self.panic.is_some() || self.has_arrived
    }

    fn instant(&mut self, now_ns: u64) {
        if self.panic.is_none() {
            self.recording.now_ns = now_ns;
        }
    }

    fn next_signal_ns(&self) -> Option<u64> {
        self.machine.next_request_ns()
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        self.machine.take_request(now_ns)
    }

    fn finished(&mut self, instance: Instance, _core: CoreId, now_ns: u64) {
        if self.panic.is_none() {
            let machine = self.machine;
            let ask = &mut |request| machine.request_at(now_ns, request);
            self.body(instance).complete(now_ns, ask);
            machine.wires.collect();
        }
    }

    fn is_void(&self) -> bool {
        self.panic.is_some()
    }
}
