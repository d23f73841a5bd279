//! The cost of a dispatched instance, by how many are ready.
//!
//! One DAG of many subtasks without edges has many jobs in flight. When an
//! instance completes, the same subtask's next job is ready at once, so the
//! number of ready instances stays what it is. What is measured is one instant
//! of the scheduler: the completion, the releases (none are due), the dispatch
//! of the next instance. Under EDF that one comes from the front of the line,
//! and the newly ready one goes to its end.

use std::sync::Arc;
use std::time::Instant;

use sched_dag::{
    CommitOptions, ConstructionPolicy, CoreId, DagSpec, Instance, Policy, Preemption, Scheduler,
    SchedulerOptions, SubtaskSpec, verify,
};

use super::super::shortest;

/// The smallest number of ready instances, with which others are compared.
pub(super) const FEWEST: usize = 10;

const READY: [usize; 4] = [FEWEST, 100, 1_000, 10_000];

/// How many instances are dispatched in a round, at least.
const INSTANCES: usize = 200_000;

const ROUNDS: usize = 9;

/// What an instance costs with a number of others ready.
pub(super) struct Figure {
    pub(super) ready: usize,
    pub(super) nanoseconds: f64,
    /// The cost as a multiple of that with the fewest ready.
    pub(super) growth: f64,
    /// The same multiple of the logarithm.
    pub(super) log_growth: f64,
}

/// Measures all numbers of ready instances in turn, several rounds.
pub(super) fn measure() -> Vec<Figure> {
    let mut rounds = vec![Vec::new(); READY.len()];
    for _ in 0..ROUNDS {
        for (rounds, &ready) in rounds.iter_mut().zip(&READY) {
            rounds.push(round(ready));
        }
    }
    let times: Vec<f64> = rounds
        .into_iter()
        .map(|rounds| shortest(rounds).as_secs_f64() * 1e9)
        .collect();
    // One round is `INSTANCES` instances; see `round`.
    let per_instance: Vec<f64> = times.iter().map(|round| round / INSTANCES as f64).collect();
    let figure = |(&ready, &nanoseconds): (&usize, &f64)| Figure {
        ready,
        nanoseconds,
        growth: nanoseconds / per_instance[0],
        log_growth: (ready as f64).ln() / (FEWEST as f64).ln(),
    };
    READY.iter().zip(&per_instance).map(figure).collect()
}

/// Dispatches [`INSTANCES`] instances while `ready` are ready, and returns how
/// long that takes.
fn round(ready: usize) -> std::time::Duration {
    // One more job than needed keeps the line full to the end.
    let jobs = u32::try_from(INSTANCES / ready + 2).expect("few jobs");
    let spec = DagSpec {
        period_ns: Some(1),
        relative_deadline_ns: Some(1_000_000_000),
        jobs: Some(u64::from(jobs)),
        in_flight: Some(jobs),
        subtasks: vec![SubtaskSpec::default(); ready],
        ..DagSpec::default()
    };
    let commit_options =
        CommitOptions::new(Policy::Edf, 1).with_construction(ConstructionPolicy::any_graph());
    let task_set = verify(&[spec], &commit_options)
        .expect("the DAG is right")
        .task_set;
    let options = SchedulerOptions {
        policy: Policy::Edf,
        preemption: Preemption::Enabled,
        cores: 1,
    };
    let mut scheduler = Scheduler::new(Arc::new(task_set), options);
    let all_released_ns = u64::from(jobs);
    let decisions = scheduler
        .at(all_released_ns)
        .release_due(&mut ())
        .dispatch();
    let mut running: Instance = decisions[0].instance();

    let start = Instant::now();
    for _ in 0..INSTANCES {
        let mut moment = scheduler.at(all_released_ns);
        moment.complete(running, &mut ());
        running = moment.release_due(&mut ()).dispatch()[0].instance();
    }
    let elapsed = start.elapsed();
    assert_eq!(scheduler.running(CoreId(0)), Some(running));
    elapsed
}
