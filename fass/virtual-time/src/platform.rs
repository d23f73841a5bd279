//! The platform that `fass` sees: one for the program, one machine a thread.
//!
//! The installed platform itself has no state. Everything it is asked, it asks
//! the calling thread's current machine. A machine keeps its session; while that
//! runs, it is taken out of there, so that a function's calls into the platform
//! meet nothing borrowed but the settings, which no function changes.

use std::cell::{Cell, RefCell};
use std::rc::{Rc, Weak};
use std::sync::OnceLock;
use std::time::Duration;

use fass::edge::Begin;
use fass::log::{Level, Line, set_level};
use fass::{LaunchError, Occupation, Plan, Platform, Recorded, Terms};

use recording::Channel;
use sched_dag::{DagId, TaskSet};

use crate::job::JobShown;
use crate::nanoseconds;
use crate::report::Report;
use crate::session::RunError;
use crate::session::Session;
use crate::surroundings::Surroundings;

/// What one thread's virtual machine is and does.
#[derive(Debug, Default)]
pub(crate) struct Machine {
    /// What it shares with its run.
    pub(crate) surroundings: Rc<Surroundings>,
    session: RefCell<Option<Session>>,
    /// The number of the launched plan.
    plan: Cell<Option<u64>>,
    has_launched: Cell<bool>,
}

thread_local! {
    static CURRENT: RefCell<Weak<Machine>> = const { RefCell::new(Weak::new()) };
}

/// Makes a machine and makes it this thread's.
pub(crate) fn make_current() -> Rc<Machine> {
    static IS_OURS: OnceLock<bool> = OnceLock::new();
    assert!(
        IS_OURS.get_or_init(|| fass::install(&HostPlatform).is_ok()),
        "another platform is installed; virtual time must be the program's only platform"
    );
    set_level(Some(Level::Debug));
    let machine = Rc::new(Machine::default());
    CURRENT.set(Rc::downgrade(&machine));
    machine
}

impl Machine {
    /// Notes a signal of a plan; one of another plan does nothing.
    pub(crate) fn raise_at(&self, time_ns: u64, (plan, dag): (u64, DagId)) {
        if self.plan.get() == Some(plan) {
            self.surroundings.signal_at(time_ns, dag);
        }
    }

    /// Returns the recording of the run so far.
    pub(crate) fn recording(&self) -> Vec<u8> {
        let session = self.session.borrow();
        session.as_ref().map_or(Vec::new(), Session::recording)
    }

    /// Runs until a job of a DAG has ended, and returns what its subtasks got and gave.
    pub(crate) fn until(self: &Rc<Self>, dag: &str, job: u64) -> Result<JobShown, RunError> {
        let report = self.run(None, Some((dag, job)))?;
        Ok(self.show(&report, report.task_set().find(dag), job))
    }

    /// Returns what the subtasks of a job got and gave.
    pub(crate) fn show(&self, report: &Report, dag: DagId, job: u64) -> JobShown {
        let edge = &self.surroundings.edge;
        JobShown {
            unmet_fault: edge.of_replay(|replay| replay.unmet_fault(Some((dag, job)))),
            ..JobShown::new(report, &self.recording(), dag, job)
        }
    }

    /// Runs to the end, for a duration, or until a job has ended. Meanwhile this machine is the
    /// thread's, whichever was made last.
    pub(crate) fn run(
        self: &Rc<Self>,
        duration: Option<Duration>,
        until: Option<(&str, u64)>,
    ) -> Result<Report, RunError> {
        let mut session = self.session.take().ok_or(RunError::NothingToRun)?;
        let newest = CURRENT.replace(Rc::downgrade(self));
        let result = session.run(duration, until);
        CURRENT.set(newest);
        // A failed session is not put back: its functions cannot continue.
        if let Ok(_) | Err(RunError::Endless { .. } | RunError::NoSuchDag { .. }) = result {
            self.session.replace(Some(session));
        }
        result
    }
}

/// The installed platform, which has no state of its own.
struct HostPlatform;

impl Platform for HostPlatform {
    fn terms(&self) -> Terms {
        let terms = |machine: Rc<Machine>| machine.surroundings.settings.borrow().terms.clone();
        // Without a machine, those that one has at first.
        current().map(terms).unwrap_or_default()
    }

    fn assign(&self, task_set: &mut TaskSet) -> Result<(), LaunchError> {
        fass::assign_clusters(self, task_set)
    }

    fn now_ns(&self) -> u64 {
        let surroundings = surroundings();
        surroundings.edge.answer_ns(surroundings.now_ns.get())
    }

    fn execute_for(&self, duration: Duration, _how: Occupation) {
        let surroundings = surroundings();
        let Some(executed_ns) = surroundings.executed_ns.get() else {
            panic!("`execute_for` is called outside a subtask; call it in a subtask's function");
        };
        // A sum that does not fit is reported by the driver as a finish beyond
        // the last time there is.
        let ns = nanoseconds(duration);
        (surroundings.executed_ns).set(Some(executed_ns.saturating_add(ns)));
        let now_ns = &surroundings.now_ns;
        now_ns.set(now_ns.get().saturating_add(ns));
    }

    fn raise(&self, plan: u64, dag: DagId) {
        let machine = expect_current();
        assert!(
            machine.surroundings.executed_ns.get().is_none(),
            "a subtask raises a signal that it was not registered with; register it by \
             `dag.using(signal.raising())`"
        );
        machine.raise_at(machine.surroundings.now_ns.get(), (plan, dag));
    }

    fn crosses(&self) -> bool {
        true
    }

    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], _: Begin) -> bool {
        let machine = expect_current();
        // Those of a second plan, which will be refused, are not this run's.
        if !machine.has_launched.get() {
            machine.surroundings.edge.open(dag, graph, channels);
        }
        false
    }

    fn record(&self, value: &Recorded<'_>) {
        surroundings().edge.record(value);
    }

    fn replays(&self) -> bool {
        current().is_some_and(|machine| machine.surroundings.edge.is_replay())
    }

    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        surroundings().edge.lend(channel, job, take);
    }

    fn log(&self, mut line: Line) {
        if let Some(machine) = current() {
            let surroundings = &machine.surroundings;
            line.instance = surroundings.running.get();
            line.at_ns = surroundings.now_ns.get();
            surroundings.logs.borrow_mut().push(line);
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
        let surroundings = &machine.surroundings;
        let settings = surroundings.settings.borrow();
        let faults = settings.faults.iter();
        let mut absent = faults.filter_map(|fault| fault.absent(&plan.task_set));
        if let Some((dag, subtask)) = absent.next() {
            return Err(LaunchError::new(format!(
                "subtask `{subtask}` of dag `{dag}`, which is to fail, is not in the commit; \
                 name one that is"
            )));
        }
        let launched = surroundings.edge.launch(&mut plan, settings.most_jobs);
        launched.map_err(LaunchError::new)?;
        (surroundings.edge).commit(&plan, &settings.terms);
        machine.plan.set(Some(plan.number));
        let session = Session::new(plan, settings.terms.scheduler, surroundings);
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

fn surroundings() -> Rc<Surroundings> {
    Rc::clone(&expect_current().surroundings)
}
