//! A platform that keeps each thread's plan for the test to drive by hand.

use core::time::Duration;
use std::cell::RefCell;
use std::sync::OnceLock;

use fass::{Dag, LaunchError, Occupation, Plan, Platform, Policy, Preemption};

thread_local! {
    static PLAN: RefCell<Option<Plan>> = const { RefCell::new(None) };
}

struct Keeper;

impl Platform for Keeper {
    fn policy(&self) -> Policy {
        Policy::Edf
    }
    fn preemption(&self) -> Preemption {
        Preemption::Disabled
    }
    fn cores(&self) -> u32 {
        1
    }
    fn now_ns(&self) -> u64 {
        0
    }
    fn execute_for(&self, _: Duration, _: Occupation) {}
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
    assert!(IS_OURS.get_or_init(|| fass::install(&Keeper).is_ok()));
}

/// Commits DAGs that must be faultless, and returns their plan.
#[allow(dead_code, reason = "not every test program uses every helper")]
pub(crate) fn commit(dags: &[Dag]) -> Plan {
    install();
    if let Err(error) = fass::finish_create_dags(dags) {
        panic!("{error}");
    }
    take()
}

/// Returns the plan of this thread's last commit.
pub(crate) fn take() -> Plan {
    PLAN.take().expect("a commit launched a plan")
}

/// Runs job `job` of DAG 0, predecessors first.
#[allow(dead_code, reason = "not every test program uses every helper")]
pub(crate) fn run_job(plan: &mut Plan, job: u64) {
    let Plan {
        task_set, bodies, ..
    } = plan;
    for subtask in task_set.dags()[0].topological_order() {
        bodies[0][subtask.index()].run(job);
    }
}
