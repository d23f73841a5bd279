//! A platform that keeps each thread's plan for the test to drive by hand.

#![allow(dead_code, reason = "not every test program uses every helper")]

use core::time::Duration;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::sync::OnceLock;

use fass::commit::ConstructionPolicy;
use fass::platform::RunConfig;
use fass::platform::{LaunchError, Plan, Platform, SubtaskCode};
use fass::{Dag, Occupation, Policy};
use fass::{Preemption, SubtaskAttributes};
use sched_dag::lifecycle::WaitId;

pub(crate) const PERIOD: Duration = Duration::from_millis(10);

thread_local! {
    static PLAN: RefCell<Option<Plan>> = const { RefCell::new(None) };
    static ANSWER: Cell<Option<WaitId>> = const { Cell::new(None) };
    static IS_LOCKED: Cell<bool> = const { Cell::new(false) };
    static MEANWHILE: RefCell<Option<Box<dyn FnOnce()>>> = const { RefCell::new(None) };
}

struct Keeper;

impl Platform for Keeper {
    fn terms(&self) -> RunConfig {
        let mut terms = RunConfig::of_cores(1);
        terms.scheduler.policy = Policy::Edf;
        terms.scheduler.preemption = Preemption::Disabled;
        terms
    }
    fn now_ns(&self) -> u64 {
        0
    }
    fn execute_for(&self, _: Duration, _: Occupation) {}
    fn may_call_app(&self) -> bool {
        !IS_LOCKED.get()
    }
    fn answer(&self, _: u64, wait: WaitId) {
        ANSWER.set(Some(wait));
    }
    fn launch(&self, plan: Plan) -> Result<(), LaunchError> {
        PLAN.with_borrow_mut(|kept| match kept {
            Some(_) => Err(LaunchError::new("a plan is kept already; take it first")),
            None => {
                *kept = Some(plan);
                Ok(())
            }
        })
    }
}

/// Installs the platform, unless another test of the program already has.
pub(crate) fn install() {
    static IS_OURS: OnceLock<bool> = OnceLock::new();
    assert!(IS_OURS.get_or_init(|| fass::platform::install(&Keeper).is_ok()));
}

/// Does something as if under a lock of the platform's.
pub(crate) fn under_a_lock<T>(action: impl FnOnce() -> T) -> T {
    IS_LOCKED.set(true);
    let done = action();
    IS_LOCKED.set(false);
    done
}

/// Takes the wait that a device has answered last.
pub(crate) fn answers() -> Option<WaitId> {
    ANSWER.take()
}

pub(crate) fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

/// Returns what an action says that must panic.
pub(crate) fn panic_message(action: impl FnOnce()) -> String {
    let payload = catch_unwind(AssertUnwindSafe(action)).expect_err("it panics");
    let text = payload.downcast_ref::<String>().cloned();
    text.or_else(|| payload.downcast_ref::<&str>().map(ToString::to_string))
        .expect("a message")
}

/// Commits DAGs of any graph that must be faultless, and returns their plan.
pub(crate) fn commit(dags: &[Dag]) -> Plan {
    install();
    if let Err(error) = fass::commit::finish_create_dags_with(dags, ConstructionPolicy::any_graph())
    {
        panic!("{error}");
    }
    take()
}

/// Returns the plan of this thread's last commit.
pub(crate) fn take() -> Plan {
    PLAN.take().expect("a commit launched a plan")
}

/// Runs job `job` of DAG 0, predecessors first.
pub(crate) fn run_job(plan: &mut Plan, job: u64) {
    let Plan {
        task_set, bodies, ..
    } = plan;
    for subtask in task_set.dags()[0].topological_order() {
        bodies[0][subtask.index()].run(job);
    }
}

/// A body that can be run from within another one's function.
#[derive(Clone)]
pub(crate) struct Shared(Rc<RefCell<SubtaskCode>>);

impl Shared {
    /// Returns the bodies of a plan, those of one DAG after those of the other.
    pub(crate) fn all<const COUNT: usize>(plan: Plan) -> [Self; COUNT] {
        let bodies = plan.bodies.into_iter().flatten();
        let all: Vec<_> = (bodies.map(|body| Self(Rc::new(RefCell::new(body))))).collect();
        all.try_into().ok().expect("so many subtasks")
    }

    pub(crate) fn run(&self, job: u64) {
        self.0.borrow_mut().run(job);
    }

    /// Runs the body, and does something when its function calls [`inside`].
    pub(crate) fn run_while(&self, job: u64, action: impl FnOnce() + 'static) {
        MEANWHILE.set(Some(Box::new(action)));
        self.run(job);
        assert!(MEANWHILE.take().is_none(), "it was done");
    }

    pub(crate) fn complete(&self, finish_ns: u64) {
        self.0.borrow_mut().complete(finish_ns, &mut |_| ());
    }
}

/// Does what is to be done while the function that calls this has not returned.
pub(crate) fn inside() {
    if let Some(action) = MEANWHILE.take() {
        action();
    }
}
