//! The platform that `fass` sees: one for the program, one machine a thread.
//!
//! The installed platform itself has no state. Everything it is asked, it asks
//! the calling thread's current machine. A machine without a run in progress
//! keeps its run in `run`; while a run steps, the run is taken out of there, so
//! that a function's calls into the platform meet nothing borrowed.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::{Rc, Weak};
use std::sync::OnceLock;
use std::time::Duration;

use fass::{LaunchError, Occupation, Overheads, Plan, Platform, Policy, Preemption};

use sched_dag::DagId;

use crate::error::RunError;
use crate::report::Report;
use crate::session::Session;

/// What one thread's virtual machine is and does.
#[derive(Debug)]
pub(crate) struct Machine {
    pub(crate) cores: Cell<u32>,
    pub(crate) policy: Cell<Policy>,
    pub(crate) preemption: Cell<Preemption>,
    pub(crate) overheads: Cell<Overheads>,
    /// Whether a panic of a function ends its DAG only.
    pub(crate) contains_panics: Cell<bool>,
    /// The time that functions are told: the start of the instance and what it
    /// has executed.
    pub(crate) now_ns: Cell<u64>,
    /// What the running function has executed; `None` outside functions.
    pub(crate) executed_ns: Cell<Option<u64>>,
    /// The signals to come, by time and in the order of their raising.
    signals: RefCell<BTreeMap<(u64, usize), DagId>>,
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
        policy: Cell::new(Policy::Edf),
        preemption: Cell::new(Preemption::Enabled),
        overheads: Cell::new(Overheads::default()),
        contains_panics: Cell::new(false),
        now_ns: Cell::new(0),
        executed_ns: Cell::new(None),
        signals: RefCell::default(),
        session: RefCell::new(None),
        plan: Cell::new(None),
        has_launched: Cell::new(false),
    });
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

    /// Notes a signal to a DAG of the launched plan.
    pub(crate) fn signal_at(&self, time_ns: u64, dag: DagId) {
        let mut signals = self.signals.borrow_mut();
        let mut of_this_time = signals.range((time_ns, 0)..=(time_ns, usize::MAX));
        let place = of_this_time
            .next_back()
            .map_or(0, |(&(_, last), _)| last + 1);
        signals.insert((time_ns, place), dag);
    }

    /// Returns the time of the next signal.
    pub(crate) fn next_signal_ns(&self) -> Option<u64> {
        let signals = self.signals.borrow();
        signals.first_key_value().map(|(&(time_ns, _), _)| time_ns)
    }

    /// Takes the next signal that is due by `now_ns`.
    pub(crate) fn take_signal(&self, now_ns: u64) -> Option<DagId> {
        self.next_signal_ns().filter(|&at_ns| at_ns <= now_ns)?;
        self.signals.borrow_mut().pop_first().map(|(_, dag)| dag)
    }

    /// Steps the session to its end or for a duration. Meanwhile this machine
    /// is the thread's, whichever was made last.
    pub(crate) fn run(self: &Rc<Self>, duration: Option<Duration>) -> Result<Report, RunError> {
        let mut session = self.session.take().ok_or(RunError::NothingToRun)?;
        let newest = CURRENT.replace(Rc::downgrade(self));
        let result = session.run(self, duration);
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
        current().map_or(Policy::Edf, |machine| machine.policy.get())
    }

    fn preemption(&self) -> Preemption {
        current().map_or(Preemption::Enabled, |machine| machine.preemption.get())
    }

    fn cores(&self) -> u32 {
        current().map_or(1, |machine| machine.cores.get())
    }

    fn overheads(&self) -> Overheads {
        current().map_or_else(Overheads::default, |machine| machine.overheads.get())
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
        let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        machine
            .executed_ns
            .set(Some(executed_ns.saturating_add(ns)));
        machine.now_ns.set(machine.now_ns.get().saturating_add(ns));
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

    fn launch(&self, plan: Plan) -> Result<(), LaunchError> {
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
        machine.plan.set(Some(plan.number));
        let session = Session::new(plan, &machine);
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
