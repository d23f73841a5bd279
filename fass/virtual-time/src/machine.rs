//! A virtual machine: the time, the edge of a run, future arrivals, and the running plan.
//!
//! A machine keeps its session. While the session runs, it is taken out of the machine, so a
//! function's calls into the platform meet no borrowed cell except the settings, and no function
//! changes the settings.
//!
//! Bytes arrive at their times, between the completions and the releases of the same instant, as
//! signals do. Bytes sent by an instance are gone at its completion, or at its next wait. No device
//! is slow here, so an instance loses bytes only by sending more than its wire has room for.
//!
//! # Running a plan
//!
//! The driver is `sched_dag::virtual_time`, the only loop in virtual time. The driver owns the
//! engine with the bodies and the journal, and asks for the execution time of each instance at its
//! start and after each wait. [`Calls`] answers by running the instance's real body and adding up
//! the executed time. A [`RunError`] says why a run could not go on.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt;
use std::net::SocketAddrV4;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use fass::edge::Replay;
use fass::log::LogLine;
use fass::platform::{Buffer, Plan, SubtaskRunner};
use fass::shared::{DeviceEnd, Wire};
use sched_dag::engine::{Alternate, FaultCost, ProvenBounds, Run};
use sched_dag::journal::EventKind;
use sched_dag::lifecycle::{Request, WaitId};
use sched_dag::virtual_time::{RunOutcome, VirtualTime as Driver, Workload};
use sched_dag::{
    Dag, DagId, DagLabel, DriverNotice, Instance, SchedulerOptions, SubtaskLabel, TaskSet,
};

use crate::edge::Edge;
use crate::nanoseconds;
use crate::report::{PanicRecord, Report};
use crate::settings::Settings;

/// The virtual machine of one thread: the time, the edge of the run, and future arrivals.
#[derive(Default)]
pub(crate) struct Machine {
    pub(crate) settings: RefCell<Settings>,
    /// The edge, recording and replaying.
    pub(crate) edge: Edge,
    pub(crate) wires: RefCell<Vec<WireEnd>>,
    /// The time told to functions: the start of the instance plus its executed time.
    pub(crate) now_ns: Cell<u64>,
    /// The time executed by the running function; `None` outside functions.
    pub(crate) executed_ns: Cell<Option<u64>>,
    /// The instance of the running function.
    pub(crate) running: Cell<Option<Instance>>,
    /// The lines of the log so far.
    pub(crate) logs: RefCell<Vec<LogLine>>,
    /// The answering devices.
    pub(crate) devices: RefCell<Vec<Answering>>,
    /// Future arrivals, by time and in the order of their creation.
    arrivals: RefCell<BTreeMap<(u64, u64), Arrival>>,
    /// The number of arrivals created so far.
    count: Cell<u64>,
    pub(crate) session: RefCell<Option<Session>>,
    /// The number of the launched plan.
    pub(crate) plan: Cell<Option<u64>>,
    pub(crate) has_launched: Cell<bool>,
}

impl fmt::Debug for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Machine").finish_non_exhaustive()
    }
}

/// An event from outside of the scheduler at an instant.
pub(crate) enum Arrival {
    Request(Request),
    /// Bytes, or a peer's packet.
    Bytes(Rc<DeviceEnd>, Vec<u8>, Option<SocketAddrV4>),
    /// A device gives an answer.
    Answer(Box<dyn FnOnce()>),
}

/// The device's end of a wire, and, if the wire is connected, the sent packets with their times.
pub(crate) type WireEnd = (Rc<DeviceEnd>, Option<Vec<(u64, SentPacket)>>);

/// A sent packet, and its addressee, if stated.
pub type SentPacket = (Vec<u8>, Option<SocketAddrV4>);

/// Looks for a question of a device, and notes the answers.
type Answering = Box<dyn FnMut(&Machine, u64)>;

impl Machine {
    /// Notes a signal of a plan. A signal of another plan does nothing.
    pub(crate) fn raise_at(&self, time_ns: u64, (plan, dag): (u64, DagId)) {
        if self.plan.get() == Some(plan) {
            self.signal_at(time_ns, dag);
        }
    }

    /// Notes a signal to a DAG of the launched plan. In a replay all signals are recorded ones.
    pub(crate) fn signal_at(&self, time_ns: u64, dag: DagId) {
        if !self.edge.is_replay() {
            self.keep(time_ns, Arrival::Request(Request::Signal(dag)));
        }
    }

    /// Notes the next signal of a replay, not earlier than `now_ns`. A signal follows only after
    /// the signal before has led to a release or a skip. Otherwise, signals would be dropped where
    /// functions take longer than in the recorded run.
    pub(crate) fn follow_signal(&self, dag: DagId, now_ns: u64) {
        let next_ns = self.edge.of_replay(|replay| replay.next_signal_ns(dag));
        if let Some(time_ns) = next_ns {
            self.keep(time_ns.max(now_ns), Arrival::Request(Request::Signal(dag)));
        }
    }

    /// Notes an arrival at a time.
    pub(crate) fn keep(&self, time_ns: u64, arrival: Arrival) {
        let place = self.count.get();
        self.count.set(place + 1);
        self.arrivals.borrow_mut().insert((time_ns, place), arrival);
    }

    /// Returns the time of the next request, or of bytes that may raise a signal.
    fn next_request_ns(&self) -> Option<u64> {
        let arrivals = self.arrivals.borrow();
        arrivals.first_key_value().map(|(&(time_ns, _), _)| time_ns)
    }

    /// Takes the next request due by `now_ns`.
    fn take_request(&self, now_ns: u64) -> Option<Request> {
        loop {
            self.next_request_ns().filter(|&at_ns| at_ns <= now_ns)?;
            let ((at_ns, _), arrival) = self.arrivals.borrow_mut().pop_first()?;
            match arrival {
                Arrival::Request(request) => return Some(request),
                Arrival::Bytes(wire, bytes, from) => {
                    // If the bytes answer a wait, the answer comes now.
                    self.now_ns.set(now_ns);
                    let signal = match from {
                        None => wire.arrive(&bytes, at_ns),
                        Some(from) => {
                            let is_whole = wire.swap_in(&mut Buffer::from(&*bytes), from, at_ns);
                            is_whole.then(|| wire.announce()).flatten()
                        }
                    };
                    if let Some((_, dag)) = signal {
                        // As an arrival of this instant: a later round takes the signal, behind
                        // arrivals already due.
                        self.signal_at(now_ns, dag);
                    }
                }
                Arrival::Answer(give) => {
                    self.now_ns.set(now_ns);
                    give();
                }
            }
        }
    }

    /// Takes the packets sent on wires by now.
    pub(crate) fn collect(&self, now_ns: u64) {
        for (end, sent) in self.wires.borrow_mut().iter_mut() {
            if let Some(sent) = sent {
                let mut keep = |packet: &mut Buffer, to: Option<_>| {
                    sent.push((now_ns, (packet.content().to_vec(), to)));
                    true
                };
                while end.swap_out(&mut keep) {}
                end.tell_gone();
            }
        }
    }

    /// Returns the place of the device's end of a wire. Takes the end if this machine does not have
    /// it.
    pub(crate) fn place_of(&self, wire: &Wire) -> usize {
        let mut wires = self.wires.borrow_mut();
        wires
            .iter()
            .position(|(end, _)| end.wire() == wire)
            .unwrap_or_else(|| {
                let Some(end) = DeviceEnd::of(wire) else {
                    let name = wire.name();
                    panic!("wire `{name}` has a device already; connect it to one machine");
                };
                wires.push((Rc::new(end), None));
                wires.len() - 1
            })
    }
}

/// A plan that runs, or can go on running.
#[derive(Debug)]
pub(crate) struct Session {
    driver: Driver<SubtaskRunner>,
    calls: Calls,
    /// Whether a function may end the run.
    may_shut_down: bool,
    /// The time up to which the session has run.
    until_ns: u64,
    proven: ProvenBounds,
}

fn dags(task_set: &TaskSet) -> impl Iterator<Item = (DagId, &Dag)> + Clone {
    (0..).map(DagId).zip(task_set.dags())
}

impl Session {
    pub(crate) fn new(
        plan: Plan,
        options: SchedulerOptions,
        machine: &Rc<Machine>,
    ) -> Result<Self, &'static str> {
        let task_set: Arc<TaskSet> = plan.task_set;
        // In a replay, the first signal of each DAG; the others follow one by one.
        for (dag, _) in dags(&task_set).filter(|(_, model)| model.is_sporadic()) {
            machine.follow_signal(dag, 0);
        }
        let bodies = SubtaskRunner::all(&task_set, plan.bodies);
        let driver = Driver::of_bodies(&task_set, options, bodies, &plan.after_fault);
        Ok(Self {
            may_shut_down: (plan.lifecycle.as_ref()).is_some_and(|life| life.may_shut_down()),
            driver: driver.with_lifecycle(plan.lifecycle)?.recording(),
            calls: Calls::new(&task_set, machine),
            until_ns: 0,
            proven: plan.proven,
        })
    }

    fn run_so_far(&self) -> Run {
        let run = self.driver.run_so_far();
        run.with_proven(self.proven.clone())
    }

    /// Returns the number of the DAG with this name.
    fn find(&self, name: &str) -> Result<DagId, RunError> {
        let dags = dags(&self.calls.task_set);
        let mut of_name = dags.clone().filter(|(_, dag)| dag.name() == name);
        of_name.next().map(|(dag, _)| dag).ok_or_else(|| {
            let there = dags.map(|(_, dag)| format!("`{}`", dag.name()));
            RunError::NoSuchDag {
                name: name.into(),
                there: there.collect::<Vec<String>>().join(", "),
            }
        })
    }

    /// Runs for a duration, or to the end; in either case not beyond the end of job `until`.
    pub(crate) fn run(
        &mut self,
        duration: Option<Duration>,
        until: Option<(&str, u64)>,
    ) -> Result<Report, RunError> {
        let until_ns = match duration {
            Some(duration) => self.until_ns.saturating_add(nanoseconds(duration)),
            None => u64::MAX,
        };
        if duration.is_none() && until.is_none() {
            self.require_end()?;
        }
        let until = until.map(|(dag, job)| Ok((self.find(dag)?, job)));
        let until = until.transpose()?;
        self.calls.until = until;
        // An earlier call may have gone beyond that job: then nothing is left to be run.
        self.calls.has_arrived = until.is_some_and(|(dag, last)| {
            let run = self.driver.run_so_far();
            let mut jobs = run.record().numbered(dag);
            jobs.any(|(job, times)| job >= last && times.ended_ns.is_some())
        });
        let end = self.go_on(until_ns);
        self.report(end)
    }

    /// Runs up to a time.
    fn go_on(&mut self, until_ns: u64) -> RunOutcome {
        let end = self.driver.run_until(until_ns, &mut self.calls);
        let now_ns = self.driver.now_ns();
        // A run without further events counts as having reached the requested time.
        let (clock_ns, reached_ns) = match end {
            RunOutcome::TimeReached => (until_ns, until_ns),
            RunOutcome::Finished | RunOutcome::TimeOverflow(_) => (now_ns, until_ns),
            RunOutcome::Stopped => (now_ns, now_ns),
        };
        // Between two calls the clock stays here: an arrival at an earlier time comes at once.
        self.calls.machine.now_ns.set(clock_ns);
        self.until_ns = reached_ns;
        end
    }

    /// Runs up to a time. The error says why the run cannot go on.
    pub(crate) fn run_up_to(&mut self, until_ns: u64) -> Result<(), RunError> {
        let end = self.go_on(until_ns);
        match end {
            RunOutcome::TimeReached | RunOutcome::Finished => Ok(()),
            _ => self.report(end).map(drop),
        }
    }

    /// Reports on a run with the given outcome.
    fn report(&mut self, end: RunOutcome) -> Result<Report, RunError> {
        let machine = Rc::clone(&self.calls.machine);
        let now_ns = self.driver.now_ns();
        let is_over = end == RunOutcome::Finished;
        let outcome = (machine.edge).of_replay(|replay| replay.outcome(is_over));
        let (run, calls) = (self.run_so_far(), &self.calls);
        let report = Report {
            panics: calls.panics.clone(),
            degraded: calls.degraded.clone(),
            late_ns: machine.settings.borrow().late.most_ns,
            ..Report::new(
                run,
                now_ns,
                &calls.executed_ns,
                &machine.logs.borrow(),
                outcome,
            )
        };
        if let Some(PanicRecord { instance, message }) = self.calls.panic.take() {
            let (dag, subtask) = self.labels(instance);
            return Err(RunError::Panicked {
                dag,
                subtask,
                job: instance.job,
                message,
                report: Box::new(report),
            });
        }
        if let RunOutcome::TimeOverflow(instance) = end {
            let ((dag, subtask), job) = (self.labels(instance), instance.job);
            return Err(RunError::TimeOverflow { dag, subtask, job });
        }
        Ok(report)
    }

    fn labels(&self, Instance { dag, subtask, .. }: Instance) -> (DagLabel, SubtaskLabel) {
        let task_set = &self.calls.task_set;
        (task_set.label(dag), task_set.subtask_label(dag, subtask))
    }

    fn require_end(&self) -> Result<(), RunError> {
        let task_set = &self.calls.task_set;
        let is_endless = |dag: &Dag| dag.jobs().is_none() && !dag.is_sporadic();
        match dags(task_set).find(|(_, dag)| is_endless(dag)) {
            Some((dag, _)) if !self.may_shut_down => Err(RunError::Endless {
                dag: task_set.label(dag),
            }),
            _ => Ok(()),
        }
    }

    /// Returns the recording of the run so far.
    pub(crate) fn recording(&self) -> Vec<u8> {
        let edge = &self.calls.machine.edge;
        edge.recording(&self.run_so_far())
    }
}

/// The message of a fault injected by a test.
const FAULT: &str = "a fault that was asked for";

/// The workload of the driver: the functions of the bodies, and facts about their calls beyond the
/// events.
#[derive(Debug)]
struct Calls {
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) machine: Rc<Machine>,
    /// How long each instance has executed so far.
    pub(crate) executed_ns: BTreeMap<Instance, u64>,
    /// The instances that have waited, with each instance's next segment.
    segments: BTreeMap<Instance, usize>,
    /// The contained panics.
    pub(crate) panics: Vec<PanicRecord>,
    /// By DAG, whether one of its subtasks has fallen back.
    pub(crate) degraded: Vec<bool>,
    /// The panic that fails and stops the run.
    pub(crate) panic: Option<PanicRecord>,
    /// The job whose end stops the run.
    pub(crate) until: Option<(DagId, u64)>,
    /// Whether that job has ended.
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
        // Unwind safety: a panicked body never runs again, and the machine's cells hold plain
        // numbers.
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
        // The recording has no inputs for this instance, or its cut: the function must not run.
        if machine.edge.of_replay(passes_over) {
            runner.body.pass_over(instance.job);
            return Some(0);
        }
        machine.now_ns.set(now_ns);
        machine.executed_ns.set(Some(0));
        machine.running.set(Some(instance));
        let settings = machine.settings.borrow();
        let mut faults = settings.faults.iter();
        let fails = faults.any(|fault| fault.is(instance, &self.task_set));
        let mut result = self.call(runner, fails);
        machine.edge.finish_turn(instance, now_ns);
        machine.running.set(None);
        let mut executed_ns = machine.executed_ns.take().unwrap_or(0);
        let subtask = self.task_set.dag(instance.dag).subtask(instance.subtask);
        // A panicking function has executed the time stated so far. A function made to fail was not
        // called, so the time of a silent call passes before its fault.
        let segment = self.segments.remove(&instance).unwrap_or(0);
        if executed_ns == 0 && (result.is_ok() || fails) {
            executed_ns = settings.silent.of_call_ns(instance, segment, subtask);
        }
        let before_ns = self.executed_ns.get(&instance).copied().unwrap_or(0);
        // The function has run to its end, but nobody may see its effects beyond its budget.
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
                // The recording contains the cuts of this fault, and the replay passes the cut
                // instances over.
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
        // In a replay, recorded cuts state the cost of a DAG's fault; to the scheduler no instance
        // has failed.
        !self.machine.edge.is_replayed(instance.dag)
            && panics.any(|panic| panic.instance == instance)
    }

    fn ended(&mut self, instance: Instance, now_ns: u64, fault: Option<FaultCost>) {
        self.degraded[instance.dag.index()] |= fault == Some(FaultCost::Degraded);
        self.machine.collect(now_ns);
    }

    fn waits(&mut self, wait: WaitId, now_ns: u64) {
        self.segments
            .insert(wait.instance, wait.number as usize + 1);
        let machine = &*self.machine;
        machine.now_ns.set(now_ns);
        machine.collect(now_ns);
        let mut devices = machine.devices.borrow_mut();
        devices.iter_mut().for_each(|look| look(machine, now_ns));
    }

    fn hear(&mut self, notice: &DriverNotice) {
        let event = &notice.event;
        let ended = match event.what {
            EventKind::Released => None,
            // All jobs of the DAG.
            EventKind::DagEnded => Some(u64::MAX),
            _ => Some(event.job),
        };
        self.has_arrived |=
            // A release ends no job: `None` is less than any number.
            (self.until).is_some_and(|(dag, job)| dag == event.dag && Some(job) <= ended);
        // In a replay, a signal follows when the signal before has led to a release or a skip.
        if let EventKind::Released | EventKind::Skipped = event.what {
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

/// Why a run in virtual time ended early, or could not begin.
///
/// ```
/// use virtual_time::{RunError, VirtualTime};
///
/// let machine = VirtualTime::new(); // and nothing is committed
/// assert!(matches!(machine.try_run(), Err(RunError::NothingToRun)));
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub enum RunError {
    /// Nothing has been committed on this thread since the machine was made, or an earlier run has
    /// failed.
    NothingToRun,
    /// A run to the end was requested, but this DAG has no end, and no function may shut the run
    /// down.
    Endless {
        /// The DAG.
        dag: DagLabel,
    },
    /// A subtask's function panicked or exceeded its budget, and the machine was not told to
    /// [contain](crate::VirtualTime::contain_panics) panics. No function runs afterwards.
    Panicked {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The job.
        job: u64,
        /// The panic's message.
        message: String,
        /// The report of the run up to the panic.
        report: Box<Report>,
    },
    /// A job was requested for a DAG that is not in the commit.
    NoSuchDag {
        /// The name.
        name: String,
        /// The existing DAGs' names.
        there: String,
    },
    /// An instance would finish after `u64::MAX` nanoseconds.
    TimeOverflow {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The job.
        job: u64,
    },
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingToRun => f.write_str(
                "there is nothing to run; commit DAGs on this thread after making the `VirtualTime`",
            ),
            Self::Endless { dag } => write!(
                f,
                "{dag} has no limit of jobs, so its run has no end; set `jobs` or use `run_for`"
            ),
            Self::Panicked {
                dag,
                subtask,
                job,
                message,
                ..
            } => write!(f, "{subtask} of {dag} panicked in job {job}: {message}"),
            Self::NoSuchDag { name, there } => {
                write!(f, "there is no dag `{name}`; there are {there}")
            }
            Self::TimeOverflow { dag, subtask, job } => write!(
                f,
                "{subtask} of {dag} would finish job {job} after {} ns, the last time there is; \
                 execute for less",
                u64::MAX
            ),
        }
    }
}

impl Error for RunError {}
