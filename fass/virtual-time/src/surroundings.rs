//! What is around the functions of a run: the time, what is to come, bytes in and out; and their
//! calls, when the driver starts instances, with what is kept of these.
//!
//! Bytes arrive at their times, between the completions and the releases of that instant, as
//! signals do. What an instance sends is gone at its completion: no device is slow here, so only
//! an instance that sends more than its wire has room for loses bytes.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use fass::edge::Replay;
use fass::log::Line;
use fass::{Runner, Wire};
use sched_dag::engine::{Alternate, Cost};
use sched_dag::journal::What;
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::Workload;
use sched_dag::{DagId, Instance, Notice, TaskSet};

use crate::edge::Edge;
use crate::settings::Settings;
use crate::{VirtualTime, nanoseconds};

/// The time, what crosses the edge of the run, and what is to come.
#[derive(Debug, Default)]
pub(crate) struct Surroundings {
    pub(crate) settings: RefCell<Settings>,
    /// What is recorded and replayed.
    pub(crate) edge: Edge,
    /// The wires that are connected, and what has been sent on each.
    connected: RefCell<Vec<(Wire, Vec<u8>)>>,
    /// The time that functions are told: the start of the instance and what it
    /// has executed.
    pub(crate) now_ns: Cell<u64>,
    /// What the running function has executed; `None` outside functions.
    pub(crate) executed_ns: Cell<Option<u64>>,
    /// The instance of the running function.
    pub(crate) running: Cell<Option<Instance>>,
    /// The lines of the log so far.
    pub(crate) logs: RefCell<Vec<Line>>,
    /// What is to come, by time and in the order in which it was made.
    arrivals: RefCell<BTreeMap<(u64, u64), Arrival>>,
    /// How much of that there has been.
    count: Cell<u64>,
}

/// Something that comes from outside of the scheduler at an instant.
#[derive(Debug)]
enum Arrival {
    Request(Request),
    Bytes(Wire, Vec<u8>),
}

impl Surroundings {
    /// Notes a signal to a DAG of the launched plan; in a replay all signals are recorded ones.
    pub(crate) fn signal_at(&self, time_ns: u64, dag: DagId) {
        if !self.edge.is_replay() {
            self.keep(time_ns, Arrival::Request(Request::Signal(dag)));
        }
    }

    /// Notes the next signal of a replay, which comes not before `now_ns`. One follows when the one
    /// before it has led to something, for else it would be dropped where functions take longer
    /// than they took.
    pub(crate) fn follow_signal(&self, dag: DagId, now_ns: u64) {
        let next_ns = self.edge.of_replay(|replay| replay.next_signal_ns(dag));
        if let Some(time_ns) = next_ns {
            self.keep(time_ns.max(now_ns), Arrival::Request(Request::Signal(dag)));
        }
    }

    /// Notes what comes at a time.
    fn keep(&self, time_ns: u64, arrival: Arrival) {
        let place = self.count.get();
        self.count.set(place + 1);
        self.arrivals.borrow_mut().insert((time_ns, place), arrival);
    }

    /// Returns the time of the next request, or of bytes that may raise a signal.
    fn next_request_ns(&self) -> Option<u64> {
        let arrivals = self.arrivals.borrow();
        arrivals.first_key_value().map(|(&(time_ns, _), _)| time_ns)
    }

    /// Takes the next request that is due by `now_ns`.
    fn take_request(&self, now_ns: u64) -> Option<Request> {
        loop {
            self.next_request_ns().filter(|&at_ns| at_ns <= now_ns)?;
            let ((at_ns, _), arrival) = self.arrivals.borrow_mut().pop_first()?;
            match arrival {
                Arrival::Request(request) => return Some(request),
                Arrival::Bytes(wire, bytes) => {
                    if let Some((_, dag)) = wire.arrive(&bytes, at_ns) {
                        self.signal_at(now_ns, dag);
                    }
                }
            }
        }
    }

    /// Takes what has been sent on wires.
    pub(crate) fn collect(&self) {
        for (wire, sent) in self.connected.borrow_mut().iter_mut() {
            sent.extend(std::iter::from_fn(|| wire.depart()));
        }
    }
}

impl VirtualTime {
    /// Connects a wire: what is sent on it can be had by [`sent`](Self::sent).
    ///
    /// See [`Wire`].
    #[must_use = "the machine itself is returned"]
    pub fn connect(self, wire: &Wire) -> Self {
        let mut connected = self.machine.surroundings.connected.borrow_mut();
        connected.push((wire.clone(), Vec::new()));
        drop(connected);
        self
    }

    /// Lets bytes arrive on a wire at a time of the run, counted from the start of scheduling;
    /// at once if that is past.
    ///
    /// See [`Wire`].
    pub fn arrive_at(&self, wire: &Wire, time: Duration, bytes: &[u8]) {
        let surroundings = &self.machine.surroundings;
        let at_ns = nanoseconds(time).max(surroundings.now_ns.get());
        surroundings.keep(at_ns, Arrival::Bytes(wire.clone(), bytes.to_vec()));
    }

    /// Returns all that complete instances have sent so far on a wire that is connected.
    ///
    /// See [`Wire`].
    ///
    /// # Panics
    ///
    /// If the wire is not connected.
    #[must_use]
    pub fn sent(&self, wire: &Wire) -> Vec<u8> {
        let connected = self.machine.surroundings.connected.borrow();
        match connected.iter().find(|(of, _)| of == wire) {
            Some((_, sent)) => sent.clone(),
            None => panic!(
                "wire `{}` is not connected; call `connect` before the run",
                wire.name()
            ),
        }
    }
}

/// A panic that was contained: it ended its DAG, and the run went on.
///
/// See [`contain_panics`](crate::VirtualTime::contain_panics).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PanicRecord {
    /// The instance whose function panicked.
    pub instance: Instance,
    /// The panic's message.
    pub message: String,
}

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
