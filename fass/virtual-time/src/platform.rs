//! The platform that `fass` sees: one for the program, one machine a thread.
//!
//! The installed platform itself has no state. Everything it is asked, it asks
//! the calling thread's current machine. A machine keeps its session; while that
//! runs, it is taken out of there, so that a function's calls into the platform
//! meet nothing borrowed but the settings, which no function changes.
//!
//! Bytes arrive at their times, between the completions and the releases of that instant, as
//! signals do. Bytes that an instance sends are gone at its completion: no device is slow here, so
//! only an instance that sends more than its wire has room for loses bytes.
//!
//! A plan that runs is a [`Session`]; why it could not go on is a [`RunError`].

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt;
use std::rc::{Rc, Weak};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use fass::Occupation;
use fass::edge::Begin;
use fass::edge::RecordedValue;
use fass::log::{Level, LogLine, set_level};
use fass::platform::{Clock, LaunchError, Plan, Platform, RunConfig, SubtaskRunner, set_clock};
use fass::shared::{DeviceDriver, Wire};
use recording::Channel;
use sched_dag::lifecycle::{Request, WaitId};
use sched_dag::virtual_time::{RunOutcome, VirtualTime as Driver};
use sched_dag::{Dag, DagId, DagLabel, Instance, SchedulerOptions, SubtaskLabel, TaskSet};

use crate::calls::Calls;
use crate::edge::Edge;
use crate::job::JobShown;
use crate::report::{PanicRecord, Report};
use crate::settings::Settings;
use crate::{VirtualTime, nanoseconds};

/// One thread's virtual machine: the time, the edge of the run, and
/// what is to come.
#[derive(Default)]
pub(crate) struct Machine {
    pub(crate) settings: RefCell<Settings>,
    /// The edge, which records and replays.
    pub(crate) edge: Edge,
    /// The wires that are connected, and what has been sent on each.
    connected: RefCell<Vec<(Wire, Vec<u8>)>>,
    /// The time that functions are told: the start of the instance and what it
    /// has executed.
    pub(crate) now_ns: Cell<u64>,
    /// The time that the running function has executed; `None` outside functions.
    pub(crate) executed_ns: Cell<Option<u64>>,
    /// The instance of the running function.
    pub(crate) running: Cell<Option<Instance>>,
    /// The lines of the log so far.
    pub(crate) logs: RefCell<Vec<LogLine>>,
    /// The devices that answer.
    devices: RefCell<Vec<Answering>>,
    /// Arrivals to come, by time and in the order in which they were made.
    arrivals: RefCell<BTreeMap<(u64, u64), Arrival>>,
    /// How much of that there has been.
    count: Cell<u64>,
    pub(crate) session: RefCell<Option<Session>>,
    /// The number of the launched plan.
    plan: Cell<Option<u64>>,
    has_launched: Cell<bool>,
}

thread_local! {
    static CURRENT: RefCell<Weak<Machine>> = const { RefCell::new(Weak::new()) };
}

impl fmt::Debug for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Machine").finish_non_exhaustive()
    }
}

/// Something that comes from outside of the scheduler at an instant.
enum Arrival {
    Request(Request),
    Bytes(Wire, Vec<u8>),
    /// A device gives an answer.
    Answer(Box<dyn FnOnce()>),
}

/// Looks for a question of a device, and notes the answers to it.
type Answering = Box<dyn FnMut(&Machine, u64)>;

/// The clock of functions, whose answers are recorded.
static TOLD: Clock = || {
    let machine = expect_current();
    machine.edge.answer_ns(machine.now_ns.get())
};

/// Makes a machine and makes it this thread's.
pub(crate) fn make_current() -> Rc<Machine> {
    static IS_OURS: OnceLock<bool> = OnceLock::new();
    assert!(
        IS_OURS.get_or_init(|| fass::platform::install(&HostPlatform).is_ok()),
        "another platform is installed; virtual time must be the program's only platform"
    );
    set_clock(&TOLD);
    set_level(Some(Level::Debug));
    let machine = Rc::new(Machine::default());
    CURRENT.set(Rc::downgrade(&machine));
    machine
}

impl Machine {
    /// Notes a signal of a plan; one of another plan does nothing.
    pub(crate) fn raise_at(&self, time_ns: u64, (plan, dag): (u64, DagId)) {
        if self.plan.get() == Some(plan) {
            self.signal_at(time_ns, dag);
        }
    }

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

    /// Notes a request, of whatever kind.
    pub(crate) fn request_at(&self, time_ns: u64, request: Request) {
        self.keep(time_ns, Arrival::Request(request));
    }

    /// Lets each device look for questions, and note when it answers them.
    pub(crate) fn look_for_questions(&self, now_ns: u64) {
        let mut devices = self.devices.borrow_mut();
        devices.iter_mut().for_each(|look| look(self, now_ns));
    }

    /// Notes what comes at a time.
    fn keep(&self, time_ns: u64, arrival: Arrival) {
        let place = self.count.get();
        self.count.set(place + 1);
        self.arrivals.borrow_mut().insert((time_ns, place), arrival);
    }

    /// Returns the time of the next request, or of bytes that may raise a signal.
    pub(crate) fn next_request_ns(&self) -> Option<u64> {
        let arrivals = self.arrivals.borrow();
        arrivals.first_key_value().map(|(&(time_ns, _), _)| time_ns)
    }

    /// Takes the next request that is due by `now_ns`.
    pub(crate) fn take_request(&self, now_ns: u64) -> Option<Request> {
        loop {
            self.next_request_ns().filter(|&at_ns| at_ns <= now_ns)?;
            let ((at_ns, _), arrival) = self.arrivals.borrow_mut().pop_first()?;
            match arrival {
                Arrival::Request(request) => return Some(request),
                Arrival::Bytes(wire, bytes) => {
                    // An answer to a wait, if it is one, comes now.
                    self.now_ns.set(now_ns);
                    if let Some((_, dag)) = wire.arrive(&bytes, at_ns) {
                        // As an arrival of this instant, which a later round takes, behind those
                        // that are due already.
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

    /// Takes what has been sent on wires.
    pub(crate) fn collect(&self) {
        for (wire, sent) in self.connected.borrow_mut().iter_mut() {
            sent.extend(std::iter::from_fn(|| wire.depart()));
        }
    }
}

impl VirtualTime {
    /// Returns the record of all that was run since the commit: the model, the values of the
    /// topics that [`Dag::record`](fass::Dag::record) names, signals, jobs that were skipped or
    /// cut, and the events of the schedule with their times. It is empty if nothing was committed.
    ///
    /// See [`Dag::record`](fass::Dag::record).
    #[must_use]
    pub fn recording(&self) -> Vec<u8> {
        let session = self.machine.session.borrow();
        session.as_ref().map_or(Vec::new(), Session::recording)
    }

    /// Returns what the subtasks of a job got and gave.
    pub(crate) fn show(&self, report: &Report, dag: DagId, job: u64) -> JobShown {
        let edge = &self.machine.edge;
        JobShown {
            unmet_fault: edge.of_replay(|replay| replay.unmet_fault(Some((dag, job)))),
            ..JobShown::new(report, &self.recording(), dag, job)
        }
    }

    /// Runs to the end, for a duration, or until a job has ended. Meanwhile this machine is the
    /// thread's, whichever was made last.
    pub(crate) fn run_until(
        &self,
        duration: Option<Duration>,
        until: Option<(&str, u64)>,
    ) -> Result<Report, RunError> {
        let kept = &self.machine.session;
        let mut session = kept.take().ok_or(RunError::NothingToRun)?;
        let newest = CURRENT.replace(Rc::downgrade(&self.machine));
        let result = session.run(duration, until);
        CURRENT.set(newest);
        // A failed session is not put back: its functions cannot continue.
        if let Ok(_) | Err(RunError::Endless { .. } | RunError::NoSuchDag { .. }) = result {
            kept.replace(Some(session));
        }
        result
    }

    /// Connects a wire: what is sent on it can be had by [`sent`](Self::sent).
    ///
    /// See [`Wire`].
    #[must_use = "the machine itself is returned"]
    pub fn connect(self, wire: &Wire) -> Self {
        let mut connected = self.machine.connected.borrow_mut();
        connected.push((wire.clone(), Vec::new()));
        drop(connected);
        self
    }

    /// Lets bytes arrive on a wire at a time of the run, counted from the start of scheduling;
    /// at once if that is past.
    ///
    /// See [`Wire`].
    pub fn arrive_at(&self, wire: &Wire, time: Duration, bytes: &[u8]) {
        let at_ns = nanoseconds(time).max(self.machine.now_ns.get());
        self.machine
            .keep(at_ns, Arrival::Bytes(wire.clone(), bytes.to_vec()));
    }

    /// Lets a device answer its questions: `answer` is told the question and the job that asks, and
    /// says which answers come how long after the question. A device that never answers has none,
    /// and one that answers twice has two, of which the first counts.
    ///
    /// See [`Device`](fass::shared::Device).
    pub fn answers<Q, A, Answers>(
        &self,
        driver: DeviceDriver<Q, A>,
        mut answer: impl FnMut(Q, u64) -> Answers + 'static,
    ) where
        Q: Send + Sync + 'static,
        A: Send + Sync + 'static,
        Answers: IntoIterator<Item = (Duration, A)>,
    {
        let driver = Rc::new(RefCell::new(driver));
        let look = move |machine: &Machine, now_ns: u64| {
            let Some((ticket, question)) = driver.borrow_mut().question() else {
                return;
            };
            for (after, answer) in answer(question, ticket.job()) {
                let driver = Rc::clone(&driver);
                // One that comes too late is given back.
                let give = move || _ = driver.borrow_mut().answer(ticket, answer);
                let at_ns = now_ns.saturating_add(nanoseconds(after));
                machine.keep(at_ns, Arrival::Answer(Box::new(give)));
            }
        };
        self.machine.devices.borrow_mut().push(Box::new(look));
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
        let connected = self.machine.connected.borrow();
        match connected.iter().find(|(of, _)| of == wire) {
            Some((_, sent)) => sent.clone(),
            None => panic!(
                "wire `{}` is not connected; call `connect` before the run",
                wire.name()
            ),
        }
    }
}

/// The installed platform, which has no state of its own.
struct HostPlatform;

impl Platform for HostPlatform {
    fn terms(&self) -> RunConfig {
        let terms = |machine: Rc<Machine>| machine.settings.borrow().terms.clone();
        // Without a machine, those that one has at first.
        current().map(terms).unwrap_or_default()
    }

    fn assign(&self, task_set: &mut TaskSet) -> Result<(), LaunchError> {
        fass::commit::assign_clusters(self, task_set)
    }

    fn now_ns(&self) -> u64 {
        expect_current().now_ns.get()
    }

    fn execute_for(&self, duration: Duration, _how: Occupation) {
        let machine = expect_current();
        let Some(executed_ns) = machine.executed_ns.get() else {
            panic!("`execute_for` is called outside a subtask; call it in a subtask's function");
        };
        // A sum that does not fit is reported by the driver as a finish beyond
        // the last time there is.
        let ns = nanoseconds(duration);
        (machine.executed_ns).set(Some(executed_ns.saturating_add(ns)));
        // Time passes for this function alone: it is called at the instant of its start, and the
        // scheduler learns how long it took when it has returned.
        let now_ns = &machine.now_ns;
        now_ns.set(now_ns.get().saturating_add(ns));
    }

    fn raise(&self, plan: u64, dag: DagId) {
        let machine = expect_current();
        assert!(
            machine.executed_ns.get().is_none(),
            "a subtask raises a signal that it was not registered with; register it by \
             `dag.using(signal.raising())`"
        );
        machine.raise_at(machine.now_ns.get(), (plan, dag));
    }

    fn answer(&self, plan: u64, wait: WaitId) {
        let machine = expect_current();
        if machine.plan.get() == Some(plan) {
            let answer = Arrival::Request(Request::Answer(wait));
            machine.keep(machine.now_ns.get(), answer);
        }
    }

    fn crosses(&self) -> bool {
        true
    }

    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], _: Begin) -> bool {
        let machine = expect_current();
        // Those of a second plan, which will be refused, are not this run's.
        if !machine.has_launched.get() {
            machine.edge.open(dag, graph, channels);
        }
        false
    }

    fn record(&self, value: &RecordedValue<'_>) {
        expect_current().edge.record(value);
    }

    fn replays(&self) -> bool {
        current().is_some_and(|machine| machine.edge.is_replay())
    }

    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        expect_current().edge.lend(channel, job, take);
    }

    fn log(&self, mut line: LogLine) {
        if let Some(machine) = current() {
            line.instance = machine.running.get();
            line.at_ns = machine.now_ns.get();
            machine.logs.borrow_mut().push(line);
        }
    }

    fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
        let Some(machine) = current() else {
            return Err(LaunchError::new(
                "this thread has no `VirtualTime`; make one on the thread that commits",
            ));
        };
        if machine.has_launched.replace(true) {
            return Err(LaunchError::new(
                "this `VirtualTime` has a plan already; commit all DAGs in one call, \
                 or make a new `VirtualTime`",
            ));
        }
        let settings = machine.settings.borrow();
        let faults = settings.faults.iter();
        let mut absent = faults.filter_map(|fault| fault.absent(&plan.task_set));
        if let Some((dag, subtask)) = absent.next() {
            return Err(LaunchError::new(format!(
                "subtask `{subtask}` of dag `{dag}`, which is to fail, is not in the commit; \
                 name one that is"
            )));
        }
        let launched = machine.edge.launch(&mut plan, settings.most_jobs);
        launched.map_err(LaunchError::new)?;
        machine.edge.commit(&plan, &settings.terms);
        machine.plan.set(Some(plan.number));
        let session = Session::new(plan, settings.terms.scheduler, &machine);
        machine.session.replace(Some(session));
        Ok(())
    }
}

fn current() -> Option<Rc<Machine>> {
    CURRENT.with_borrow(Weak::upgrade)
}

fn expect_current() -> Rc<Machine> {
    current().expect("this thread has no `VirtualTime`; make one on the thread that commits")
}

/// A plan that runs, or can go on running.
#[derive(Debug)]
pub(crate) struct Session {
    driver: Driver<SubtaskRunner>,
    calls: Calls,
    /// Whether a function may end the run.
    may_shut_down: bool,
    /// Up to when it has run.
    until_ns: u64,
}

fn dags(task_set: &TaskSet) -> impl Iterator<Item = (DagId, &Dag)> + Clone {
    (0..).map(DagId).zip(task_set.dags())
}

impl Session {
    pub(crate) fn new(plan: Plan, options: SchedulerOptions, machine: &Rc<Machine>) -> Self {
        let task_set: Arc<TaskSet> = plan.task_set;
        // In a replay, the first signal of each; the others follow one by one.
        for (dag, _) in dags(&task_set).filter(|(_, model)| model.is_sporadic()) {
            machine.follow_signal(dag, 0);
        }
        let bodies = SubtaskRunner::all(&task_set, plan.bodies);
        let driver = Driver::of_bodies(&task_set, options, bodies, &plan.after_fault);
        Self {
            may_shut_down: (plan.lifecycle.as_ref()).is_some_and(|life| life.may_shut_down()),
            driver: driver.with_lifecycle(plan.lifecycle).recording(),
            calls: Calls::new(&task_set, machine),
            until_ns: 0,
        }
    }

    /// Returns the number of the DAG of this name.
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

    /// Runs for a duration, or to the end; in either case not beyond the end of a job.
    pub(crate) fn run(
        &mut self,
        duration: Option<Duration>,
        until: Option<(&str, u64)>,
    ) -> Result<Report, RunError> {
        let machine = Rc::clone(&self.calls.machine);
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
        // An earlier call may have come beyond that job: then nothing is left to be run.
        self.calls.has_arrived = until.is_some_and(|(dag, last)| {
            let run = self.driver.run_so_far();
            let mut jobs = run.record().numbered(dag);
            jobs.any(|(job, times)| job >= last && times.ended_ns.is_some())
        });
        let end = self.driver.run_until(until_ns, &mut self.calls);
        let now_ns = self.driver.now_ns();
        // What has no event any more has run as far as it was asked to.
        let (clock_ns, reached_ns) = match end {
            RunOutcome::TimeReached => (until_ns, until_ns),
            RunOutcome::Finished | RunOutcome::TimeOverflow(_) => (now_ns, until_ns),
            RunOutcome::Stopped => (now_ns, now_ns),
        };
        // Between two calls the clock stands here: an arrival at an earlier time comes at once.
        machine.now_ns.set(clock_ns);
        self.until_ns = reached_ns;
        let is_over = end == RunOutcome::Finished;
        let outcome = (machine.edge).of_replay(|replay| replay.outcome(is_over));
        let (run, calls) = (self.driver.run_so_far(), &self.calls);
        let report = Report {
            panics: calls.panics.clone(),
            degraded: calls.degraded.clone(),
            is_late: machine.settings.borrow().late.most_ns > 0,
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
        edge.recording(&self.driver.run_so_far())
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
    /// Nothing has been committed on this thread since the machine was made, or
    /// an earlier run has failed.
    NothingToRun,
    /// A run to the end was asked for, but this DAG has no end.
    Endless {
        /// The DAG.
        dag: DagLabel,
    },
    /// A subtask's function panicked, and the machine was not told to
    /// [contain](crate::VirtualTime::contain_panics) that. No function runs
    /// after it.
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
    /// A job of a DAG was asked for that is not in the commit.
    NoSuchDag {
        /// The name.
        name: String,
        /// Those that are there.
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
