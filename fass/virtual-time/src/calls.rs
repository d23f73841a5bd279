//! The calls of functions in virtual time.
//!
//! The driver is `sched_dag::virtual_time`, the one loop in virtual time, which has the engine
//! with the bodies and the journal; it asks for the execution time of each instance at its start.
//! [`Calls`] answers by running the instance's real body and adding up what it executed.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use fass::edge::Replay;
use fass::platform::SubtaskRunner;
use sched_dag::engine::{Alternate, FaultCost};
use sched_dag::journal::EventKind;
use sched_dag::lifecycle::{Request, WaitId};
use sched_dag::virtual_time::Workload;
use sched_dag::{DagId, DriverNotice, Instance, TaskSet};

use crate::platform::Machine;
use crate::report::PanicRecord;

/// The message of a fault that a test asked for.
const FAULT: &str = "a fault that was asked for";

/// The workload of the driver: the functions of the bodies, and what is known of their calls
/// besides the events.
#[derive(Debug)]
pub(crate) struct Calls {
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) machine: Rc<Machine>,
    /// How long each instance has executed so far.
    pub(crate) executed_ns: BTreeMap<Instance, u64>,
    /// The instances that have waited, with the segment that each executes next.
    segments: BTreeMap<Instance, usize>,
    /// The contained panics.
    pub(crate) panics: Vec<PanicRecord>,
    /// For each DAG whether a subtask of it has fallen back.
    pub(crate) degraded: Vec<bool>,
    /// The panic that fails the run and stops it.
    pub(crate) panic: Option<PanicRecord>,
    /// The job with whose end the run stops.
    pub(crate) until: Option<(DagId, u64)>,
    /// Whether it has ended.
    pub(crate) has_arrived: bool,
}

impl Calls {
    pub(crate) fn new(task_set: &Arc<TaskSet>, machine: &Rc<Machine>) -> Self {
        Self {
            task_set: Arc::clone(task_set),
            machine: Rc::clone(machine),
            executed_ns: BTreeMap::new(),
            segments: BTreeMap::new(),
            panics: Vec::new(),
            degraded: vec![false; task_set.dags().len()],
            panic: None,
            until: None,
            has_arrived: false,
        }
    }

    /// Calls a function, or fails in its place. The error is the message of its panic.
    fn call(&self, runner: &mut SubtaskRunner, fails: bool) -> Result<(), String> {
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

impl Workload<SubtaskRunner> for Calls {
    fn execute(&mut self, runner: &mut SubtaskRunner, now_ns: u64) -> Option<u64> {
        let (machine, instance) = (Rc::clone(&self.machine), runner.instance);
        let passes_over = |replay: &mut Replay| replay.passes_over(instance);
        if machine.edge.of_replay(passes_over) {
            runner.body.pass_over(instance.job);
            return Some(0);
        }
        machine.now_ns.set(now_ns);
        machine.executed_ns.set(Some(0));
        machine.running.set(Some(instance));
        let is_later = runner.body.goes_on(instance.job);
        machine.edge.start_turn(instance, is_later);
        let settings = machine.settings.borrow();
        let mut faults = settings.faults.iter();
        let fails = faults.any(|fault| fault.is(instance, &self.task_set));
        let mut result = self.call(runner, fails);
        let goes_on = runner.body.goes_on(instance.job);
        machine.edge.finish_turn(instance, now_ns, goes_on);
        machine.running.set(None);
        let mut executed_ns = machine.executed_ns.take().unwrap_or(0);
        let subtask = self.task_set.dag(instance.dag).subtask(instance.subtask);
        // A function that panics has executed what it said until then. One that is to fail was not
        // called, so the time of a silent call passes before its fault.
        let segment = self.segments.remove(&instance).unwrap_or(0);
        if executed_ns == 0 && (result.is_ok() || fails) {
            executed_ns = settings.silent.of_call_ns(instance, segment, subtask);
        }
        let before_ns = self.executed_ns.get(&instance).copied().unwrap_or(0);
        // The function has run to its end, but nobody may see what it did beyond its budget.
        let budget_ns = subtask.most_execution_ns(0).saturating_sub(before_ns);
        if executed_ns > budget_ns {
            executed_ns = budget_ns;
            let budget = Duration::from_nanos(before_ns + budget_ns);
            result = Err(format!("executed for more than its budget of {budget:?}"));
        }
        if let Err(message) = result {
            runner.body.failed(now_ns);
            let panic = PanicRecord { instance, message };
            if !settings.contains_panics {
                // The driver stops: no function is called after a panic that fails the run.
                self.panic = Some(panic);
                return None;
            }
            self.panics.push(panic);
            if machine.edge.is_replayed(instance.dag) {
                // What it cuts is recorded, and is passed over.
                if let Some(next) = runner.body.replacement().filter(Alternate::is_there) {
                    self.degraded[instance.dag.index()] |= next.is_fallback();
                    runner.body.replace();
                }
                let task_set = &self.task_set;
                let cut = |replay: &mut Replay| replay.cut_behind(instance, task_set);
                machine.edge.of_replay(cut);
            }
        }
        let in_all_ns = before_ns.saturating_add(executed_ns);
        self.executed_ns.insert(instance, in_all_ns);
        Some(executed_ns)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let mut panics = self.panics.iter();
        // Of a DAG in a replay, recorded cuts say what a fault cost; to the scheduler none has
        // failed.
        !self.machine.edge.is_replayed(instance.dag)
            && panics.any(|panic| panic.instance == instance)
    }

    fn ended(&mut self, instance: Instance, fault: Option<FaultCost>) {
        self.degraded[instance.dag.index()] |= fault == Some(FaultCost::Degraded);
        self.machine.collect();
    }

    fn waits(&mut self, wait: WaitId, now_ns: u64) {
        self.segments
            .insert(wait.instance, wait.number as usize + 1);
        let machine = &*self.machine;
        machine.now_ns.set(now_ns);
        machine.collect();
        machine.look_for_questions(now_ns);
    }

    fn hear(&mut self, notice: &DriverNotice) {
        let event = &notice.event;
        let ended = match event.what {
            EventKind::Released => None,
            // All jobs of it.
            EventKind::DagEnded => Some(u64::MAX),
            _ => Some(event.job),
        };
        self.has_arrived |=
            // A release ends no job: `None` is less than any number.
            (self.until).is_some_and(|(dag, job)| dag == event.dag && Some(job) <= ended);
        // In a replay, a signal follows when the one before it has led to something.
        if let EventKind::Released | EventKind::Skipped = event.what {
            self.machine.follow_signal(event.dag, event.time_ns);
        }
    }

    fn request(&mut self, request: Request, now_ns: u64) {
        match request {
            Request::Signal(dag) => self.machine.signal_at(now_ns, dag),
            _ => self.machine.request_at(now_ns, request),
        }
    }

    fn next_request_ns(&self) -> Option<u64> {
        self.machine.next_request_ns()
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        self.machine.take_request(now_ns)
    }

    fn late_ns(&self, due_ns: u64) -> u64 {
        self.machine.settings.borrow().late.of_interrupt_ns(due_ns)
    }

    fn stops(&self) -> bool {
        self.has_arrived
    }
}
