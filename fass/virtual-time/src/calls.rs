//! What functions do when the driver starts their instances, and what is kept of it.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use fass::Runner;
use fass::edge::Replay;
use sched_dag::engine::{Alternate, Cost};
use sched_dag::journal::What;
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::Workload;
use sched_dag::{DagId, Instance, Notice, TaskSet};

use crate::record::PanicRecord;
use crate::surroundings::{Arrival, Surroundings};

/// The message of a fault that a test asked for.
const FAULT: &str = "a fault that was asked for";

/// The workload of the driver: the functions of the bodies, and what is known of their calls
/// besides the events.
#[derive(Debug)]
pub(crate) struct Calls {
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) machine: Rc<Surroundings>,
    /// How long each instance executes in all.
    pub(crate) executed_ns: BTreeMap<Instance, u64>,
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
    pub(crate) fn new(task_set: &Arc<TaskSet>, machine: &Rc<Surroundings>) -> Self {
        Self {
            task_set: Arc::clone(task_set),
            machine: Rc::clone(machine),
            executed_ns: BTreeMap::new(),
            panics: Vec::new(),
            degraded: vec![false; task_set.dags().len()],
            panic: None,
            until: None,
            has_arrived: false,
        }
    }

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

impl Workload<Runner> for Calls {
    fn execute(&mut self, runner: &mut Runner, now_ns: u64) -> Option<u64> {
        let (machine, instance) = (Rc::clone(&self.machine), runner.instance);
        let passes_over = |replay: &mut Replay| replay.passes_over(instance);
        if machine.edge.of_replay(passes_over) {
            runner.body.discard(instance.job);
            return Some(0);
        }
        machine.now_ns.set(now_ns);
        machine.executed_ns.set(Some(0));
        machine.running.set(Some(instance));
        machine.edge.begin(instance);
        let settings = machine.settings.borrow();
        let mut faults = settings.faults.iter();
        let fails = faults.any(|fault| fault.is(instance, &self.task_set));
        let mut result = self.call(runner, fails);
        machine.edge.end(instance, now_ns);
        machine.running.set(None);
        let mut executed_ns = machine.executed_ns.take().unwrap_or(0);
        let subtask = self.task_set.dag(instance.dag).subtask(instance.subtask);
        if executed_ns == 0 && (result.is_ok() || fails) {
            executed_ns = settings.silent.of_call_ns(instance, subtask.wcet_ns());
        }
        // The function has run to its end, but nobody may see what it did beyond its budget.
        let budget_ns = subtask.most_execution_ns(0);
        if executed_ns > budget_ns {
            executed_ns = budget_ns;
            let budget = Duration::from_nanos(budget_ns);
            result = Err(format!("executed for more than its budget of {budget:?}"));
        }
        if let Err(message) = result {
            runner.body.failed(now_ns);
            let panic = PanicRecord { instance, message };
            if !settings.contains_panics {
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
        self.executed_ns.insert(instance, executed_ns);
        Some(executed_ns)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let mut panics = self.panics.iter();
        !self.machine.edge.is_replayed(instance.dag)
            && panics.any(|panic| panic.instance == instance)
    }

    fn ended(&mut self, instance: Instance, fault: Option<Cost>) {
        self.degraded[instance.dag.index()] |= fault == Some(Cost::Degraded);
        self.machine.collect();
    }

    fn hear(&mut self, notice: &Notice) {
        let event = &notice.event;
        let ended = match event.what {
            What::Released => None,
            // All jobs of it.
            What::Stopped => Some(u64::MAX),
            _ => Some(event.job),
        };
        self.has_arrived |=
            (self.until).is_some_and(|(dag, job)| dag == event.dag && Some(job) <= ended);
        // In a replay, a signal follows when the one before it has led to something.
        if let What::Released | What::Skipped = event.what {
            self.machine.follow_signal(event.dag, event.time_ns);
        }
    }

    fn request(&mut self, request: Request, now_ns: u64) {
        match request {
            Request::Signal(dag) => self.machine.signal_at(now_ns, dag),
            _ => self.machine.keep(now_ns, Arrival::Request(request)),
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
