//! The app's functions, and the DAGs built from them.
//!
//! Nothing here knows the machine, so the same code is booted (`src/main.rs`) and tested on the
//! host (`tests/virtual_time.rs`). Replace these functions with your own; `docs/guide.md` explains
//! each step.

#![no_std]
#![forbid(unsafe_code)]

use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for};

/// The time between two releases, and the deadline of each job.
pub const PERIOD: Duration = Duration::from_millis(10);

/// Builds the app's DAGs, here only one: `sense`, then `brake` and `steer` side by side, then
/// `act`. The DAG ends after `jobs` jobs.
#[must_use]
pub fn build(jobs: u64) -> [Dag; 1] {
    let dag = create_dag();
    // With `--keep FILE` the source's values are recorded, for a replay.
    dag.name("app-template").jobs(jobs).record::<u32>("distance");
    let mut distance = 100_u32;
    let sense = move || {
        work(800);
        distance -= 1; // a function may keep state of its own
        if distance == 0 {
            distance = 100;
        }
        (distance,)
    };
    dag.register_periodic_subtask(sense, ["distance"], PERIOD, taking("sense", 1));
    dag.register_subtask(brake, ["distance"], ["force"], taking("brake", 3));
    dag.register_subtask(steer, ["distance"], ["angle"], taking("steer", 4));
    dag.register_sink_subtask(act, ["force", "angle"], PERIOD, taking("act", 1));
    [dag]
}

/// Brakes harder, the nearer the obstacle is.
fn brake((distance,): (u32,)) -> (u32,) {
    work(2_500);
    (100 - distance,)
}

/// Steers away from a near obstacle.
fn steer((distance,): (u32,)) -> (bool,) {
    work(3_500);
    (distance < 20,)
}

/// Acts on both results, which always belong to the same job.
fn act((force, turns): (u32, bool)) {
    work(500);
    assert_eq!(turns, force > 80, "two jobs were mixed");
}

/// Returns the attributes of a subtask: its name and its WCET.
fn taking(name: &str, wcet_ms: u64) -> SubtaskAttributes {
    SubtaskAttributes::named(name).wcet(Duration::from_millis(wcet_ms))
}

/// Simulates a computation of `us` microseconds.
fn work(us: u64) {
    execute_for(Duration::from_micros(us), Occupation::Hold);
}
