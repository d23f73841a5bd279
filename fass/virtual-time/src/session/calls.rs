//! What functions do when the driver starts their instances, and what is kept of it.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use fass::Runner;
use sched_dag::engine::{Alternate, Cost};
use sched_dag::journal::What;
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::Workload;
use sched_dag::{Instance, Notice, TaskSet};

use crate::disturbed;
use crate::record::PanicRecord;
use crate::surroundings::Surroundings;

/// The message of a fault that a test asked for.
const FAULT: &str = "a fault that was asked for";

/// What is known of the calls of a run, besides the events.
#[derive(Debug)]
pub(super) struct Called {
    /// How long each instance executes in all.
    pub(super) executed_ns: BTreeMap<Instance, u64>,
    /// The contained panics.
    pub(super) panics: Vec<PanicRecord>,
    /// For each DAG whether a subtask of it has fallen back.
    pub(super) degraded: Vec<bool>,
}

/// The workload of the driver: the functions of the bodies.
pub(super) struct Calls<'s> {
    pub(super) task_set: &'s TaskSet,
    pub(super) machine: &'s Surroundings,
    pub(super) called: &'s mut Called,
    /// The panic that fails the run and stops it.
    pub(super) panic: Option<PanicRecord>,
    /// Whether the job has ended at which the run shall stop.
    pub(super) has_arrived: bool,
}

impl Calls<'_> {
    /// Calls a function, or fails in its place. The error is the message of its panic.
    fn call(&self, runner: &mut Runner, fails: bool) -> Result<(), String> {
        // Unwind safety: a body that panicked is never run again, and the
        // machine's cells hold plain numbers.
        let result = catch_unwind(AssertUnwindSafe(|| {
            if fails {
                runner.body.discard(runner.instance.job);
                resume_unwind(Box::new(FAULT));
            }
            runner.run();
        }));
        result.map_err(|payload| {
            let text = payload.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
            text.unwrap_or("(a payload that is no text)").to_owned()
        })
    }
}

impl Workload<Runner> for Calls<'_> {
    fn execute(&mut self, runner: &mut Runner, now_ns: u64) -> Option<u64> {
        let (machine, instance) = (self.machine, runner.instance);
        if machine.edge.passes_over(instance) {
            runner.body.discard(instance.job);
            return Some(0);
        }
        machine.now_ns.set(now_ns);
        machine.executed_ns.set(Some(0));
        machine.edge.begin(instance);
        let fails = disturbed::fails(&machine.faults.borrow(), instance, self.task_set);
        let result = self.call(runner, fails);
        machine.edge.end(instance, now_ns);
        let mut executed_ns = machine.executed_ns.take().unwrap_or(0);
        if executed_ns == 0 && (result.is_ok() || fails) {
            let subtask = self.task_set.dag(instance.dag).subtask(instance.subtask);
            executed_ns = machine.silent.get().of_call_ns(instance, subtask.wcet_ns());
        }
        if let Err(message) = result {
            runner.body.failed(now_ns);
            let panic = PanicRecord { instance, message };
            if !machine.contains_panics.get() {
                self.panic = Some(panic);
                return None;
            }
            self.called.panics.push(panic);
            if machine.edge.is_replayed(instance.dag) {
                // What it cuts is recorded, and is passed over.
                if let Some(next) = runner.body.replacement().filter(Alternate::is_there) {
                    self.called.degraded[instance.dag.index()] |= next.is_fallback();
                    runner.body.replace();
                }
                machine.edge.failed(instance, self.task_set);
            }
        }
        self.called.executed_ns.insert(instance, executed_ns);
        Some(executed_ns)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let mut panics = self.called.panics.iter();
        !self.machine.edge.is_replayed(instance.dag)
            && panics.any(|panic| panic.instance == instance)
    }

    fn ended(&mut self, instance: Instance, fault: Option<Cost>) {
        self.called.degraded[instance.dag.index()] |= fault == Some(Cost::Degraded);
        self.machine.wires.collect();
    }

    fn hear(&mut self, notice: &Notice) {
        let (event, machine) = (&notice.event, self.machine);
        let ended = match event.what {
            What::Released => None,
            // All jobs of it.
            What::Stopped => Some(u64::MAX),
            _ => Some(event.job),
        };
        let until = machine.until.get();
        self.has_arrived |= until.is_some_and(|(dag, job)| dag == event.dag && Some(job) <= ended);
        // In a replay, a signal follows when the one before it has led to something.
        if let What::Released | What::Skipped = event.what
            && let Some(time_ns) = machine.edge.next_signal_ns(event.dag)
        {
            machine.signal_of_replay_at(time_ns.max(event.time_ns), event.dag);
        }
    }

    fn request(&mut self, request: Request, now_ns: u64) {
        self.machine.request_at(now_ns, request);
    }

    fn next_request_ns(&self) -> Option<u64> {
        self.machine.next_request_ns()
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        self.machine.take_request(now_ns)
    }

    fn late_ns(&self, due_ns: u64) -> u64 {
        self.machine.late.get().of_interrupt_ns(due_ns)
    }

    fn stops(&self) -> bool {
        self.has_arrived
    }
}
