//! The platform that `fass` sees: one for the program, one machine a thread.
//!
//! The installed platform itself has no state. Everything it is asked, it asks
//! the calling thread's current machine. A machine without a run in progress
//! keeps its run in `run`; while a run steps, the run is taken out of there, so
//! that a function's calls into the platform meet nothing borrowed.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::rc::{Rc, Weak};
use std::sync::OnceLock;
use std::time::Duration;

use fass::edge::Begin;
use fass::{
    Clusters, LaunchError, Occupation, Overheads, Plan, Platform, Policy, Preemption, Recorded,
};

use recording::Channel;
use sched_dag::{DagId, SchedulerOptions, TaskSet};

use crate::disturbed;
use crate::error::RunError;
use crate::job::JobShown;
use crate::report::Report;
use crate::session::Session;
use crate::surroundings::Surroundings;

/// What one thread's virtual machine is and does.
#[derive(Debug)]
pub(crate) struct Machine {
    pub(crate) cores: Cell<u32>,
    pub(crate) clusters: RefCell<Clusters>,
    /// Whether the commit divides the cores.
    pub(crate) assigns: Cell<bool>,
    pub(crate) policy: Cell<Policy>,
    pub(crate) preemption: Cell<Preemption>,
    pub(crate) overheads: Cell<Overheads>,
    /// A file of observed WCETs.
    pub(crate) wcets: RefCell<Option<String>>,
    /// What it shares with its run.
    pub(crate) surroundings: Surroundings,
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
    let machine = Rc::new(Machine {
        cores: Cell::new(1),
        clusters: RefCell::default(),
        assigns: Cell::new(false),
        policy: Cell::new(Policy::StaticPriority),
        preemption: Cell::new(Preemption::Enabled),
        overheads: Cell::new(Overheads::default()),
        wcets: RefCell::new(None),
        surroundings: Surroundings::default(),
        session: RefCell::new(None),
        plan: Cell::new(None),
        has_launched: Cell::new(false),
    });
    CURRENT.set(Rc::downgrade(&machine));
    machine
}

impl Machine {
    /// Sets how the cores are divided, or that the commit does it: the last call counts.
    pub(crate) fn divide(&self, clusters: Clusters, by_commit: bool) {
        self.clusters.replace(clusters);
        self.assigns.set(by_commit);
    }

    /// Notes a signal of a plan; one of another plan does nothing.
    pub(crate) fn raise_at(&self, time_ns: u64, (plan, dag): (u64, DagId)) {
        if self.plan.get() == Some(plan) {
            self.surroundings.signal_at(time_ns, dag);
        }
    }

    /// Returns the recording of the run so far.
    pub(crate) fn recording(&self) -> Vec<u8> {
        let session = self.session.borrow();
        let edge = &self.surroundings.edge;
        session
            .as_ref()
            .map_or(Vec::new(), |session| session.recording(edge))
    }

    /// Runs until a job of a DAG has ended, and returns what its subtasks got and gave.
    pub(crate) fn until(self: &Rc<Self>, dag: &str, job: u64) -> Result<JobShown, RunError> {
        let session = self.session.borrow();
        let dag = session.as_ref().ok_or(RunError::NothingToRun)?.find(dag)?;
        drop(session);
        self.surroundings.until.set(Some((dag, job)));
        let report = self.run(None);
        self.surroundings.until.set(None);
        Ok(JobShown::new(&report?, &self.surroundings.edge, dag, job))
    }

    /// Steps the session to its end or for a duration. Meanwhile this machine
    /// is the thread's, whichever was made last.
    pub(crate) fn run(self: &Rc<Self>, duration: Option<Duration>) -> Result<Report, RunError> {
        let mut session = self.session.take().ok_or(RunError::NothingToRun)?;
        let newest = CURRENT.replace(Rc::downgrade(self));
        let result = session.run(&self.surroundings, duration);
        CURRENT.set(newest);
        // A failed session is not put back: its functions cannot continue.
        if matches!(result, Ok(_) | Err(RunError::Endless { .. })) {
            self.session.replace(Some(session));
        }
        result
    }
}

/// The installed platform, which has no state of its own.
struct HostPlatform;

impl Platform for HostPlatform {
    fn policy(&self) -> Policy {
        current().map_or(Policy::StaticPriority, |machine| machine.policy.get())
    }

    fn preemption(&self) -> Preemption {
        current().map_or(Preemption::Enabled, |machine| machine.preemption.get())
    }

    fn cores(&self) -> u32 {
        current().map_or(1, |machine| machine.cores.get())
    }

    fn clusters(&self) -> Clusters {
        let machine = current();
        machine.map_or_else(Clusters::default, |machine| {
            machine.clusters.borrow().clone()
        })
    }

    fn assign(&self, task_set: &mut TaskSet) -> Result<(), LaunchError> {
        if !current().is_some_and(|machine| machine.assigns.get()) {
            return Ok(());
        }
        fass::assign_clusters(self, task_set)
    }

    fn overheads(&self) -> Overheads {
        current().map_or_else(Overheads::default, |machine| machine.overheads.get())
    }

    fn wcets(&self) -> Option<Cow<'static, str>> {
        current()?.wcets.borrow().clone().map(Cow::Owned)
    }

    fn now_ns(&self) -> u64 {
        let machine = expect_current();
        let surroundings = &machine.surroundings;
        surroundings.edge.answer_ns(surroundings.now_ns.get())
    }

    fn execute_for(&self, duration: Duration, _how: Occupation) {
        let machine = expect_current();
        let surroundings = &machine.surroundings;
        let Some(executed_ns) = surroundings.executed_ns.get() else {
            panic!("`execute_for` is called outside a subtask; call it in a subtask's function");
        };
        // A sum that does not fit is reported by the driver as a finish beyond
        // the last time there is.
        let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        let executed_ns = Some(executed_ns.saturating_add(ns));
        surroundings.executed_ns.set(executed_ns);
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
        expect_current().surroundings.edge.record(value);
    }

    fn replays(&self) -> bool {
        current().is_some_and(|machine| machine.surroundings.edge.is_replay())
    }

    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        expect_current().surroundings.edge.lend(channel, job, take);
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
        if let Some((dag, subtask)) =
            disturbed::absent(&surroundings.faults.borrow(), &plan.task_set)
        {
            return Err(LaunchError::new(format!(
                "subtask `{subtask}` of dag `{dag}`, which is to fail, is not in the commit; \
                 name one that is"
            )));
        }
        let signals = surroundings
            .edge
            .launch(&mut plan)
            .map_err(LaunchError::new)?;
        for (dag, time_ns) in signals {
            surroundings.signal_of_replay_at(time_ns, dag);
        }
        machine.plan.set(Some(plan.number));
        let options = SchedulerOptions {
            policy: machine.policy.get(),
            preemption: machine.preemption.get(),
            cores: machine.cores.get(),
        };
        let session = Session::new(plan, options);
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
