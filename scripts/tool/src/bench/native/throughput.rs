//! Job after job, back to back: what a hop, a job, an instance takes.

use std::time::Duration;

use native::{Native, Pinning, Report, Setting};
use sched_dag::Policy;

use super::figure::Figure;
use super::workload::{Graph, Rounds, closures, commit_typed, task_set};

/// How often each runner gets its turn, so that a change of the host's speed meets all.
const PASSES: usize = 3;

/// About how many instances a round has: some hundred microseconds.
const INSTANCES_A_ROUND: usize = 20_000;

/// What runs the bodies.
#[derive(Clone, Copy)]
enum Runner {
    /// A loop over the functions.
    Floor,
    /// The scheduler, with functions.
    Closures(Policy),
    /// The scheduler, with the bodies of `fass`.
    Typed(Policy),
}

impl Runner {
    const fn name(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::Closures(Policy::StaticPriority) => "closures, static",
            Self::Closures(Policy::Edf) => "closures, edf",
            Self::Typed(Policy::StaticPriority) => "typed, static",
            Self::Typed(Policy::Edf) => "typed, edf",
        }
    }
}

/// Returns how many passes [`measure`] makes.
pub(super) fn passes(workers: &[u32]) -> u64 {
    (PASSES * runners(workers).len()) as u64
}

/// Measures all runners, calling `show` after each pass; reports also whether all workers
/// were pinned.
pub(super) fn measure(
    graph: Graph,
    workers: &[u32],
    rounds: usize,
    mut show: impl FnMut(),
) -> Result<(Vec<Figure>, bool), String> {
    let runners = runners(workers);
    let mut all_pinned = true;
    let mut samples = vec![Vec::new(); runners.len()];
    for _ in 0..PASSES {
        for (samples, &(runner, workers)) in samples.iter_mut().zip(&runners) {
            let (durations, pinned) = pass(graph, runner, workers, rounds.div_ceil(PASSES))?;
            samples.extend(durations);
            all_pinned &= pinned;
            show();
        }
    }
    let (step, steps) = graph.steps();
    let jobs_a_round = as_f64(jobs_a_round(graph));
    let figures = runners
        .iter()
        .zip(samples)
        .map(|(&(runner, workers), samples)| {
            let per_step = |round: Duration| round.as_secs_f64() * 1e9 / jobs_a_round / steps;
            let samples = samples.into_iter().map(per_step).collect();
            Figure::new(graph, step, runner.name(), workers, samples)
        });
    Ok((figures.collect(), all_pinned))
}

fn runners(workers: &[u32]) -> Vec<(Runner, u32)> {
    let mut runners = vec![(Runner::Floor, 1)];
    for &workers in workers {
        runners.extend([
            (Runner::Closures(Policy::StaticPriority), workers),
            (Runner::Closures(Policy::Edf), workers),
            (Runner::Typed(Policy::StaticPriority), workers),
        ]);
    }
    runners
}

fn jobs_a_round(graph: Graph) -> u64 {
    (INSTANCES_A_ROUND / graph.instances()) as u64
}

/// A small count, exactly.
fn as_f64(count: u64) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

/// Runs the rounds, and some before to warm up.
fn pass(
    graph: Graph,
    runner: Runner,
    workers: u32,
    rounds: usize,
) -> Result<(Vec<Duration>, bool), String> {
    let jobs_a_round = jobs_a_round(graph);
    let jobs = jobs_a_round * (rounds + rounds / 8) as u64 + 1;
    let times = Rounds::default();
    let report: Report = match runner {
        Runner::Floor => {
            let mut bodies = closures(graph, &times, jobs_a_round);
            for job in 0..jobs {
                for body in bodies.iter_mut().flatten() {
                    body(job);
                }
            }
            return Ok((times.durations(), true));
        }
        Runner::Closures(policy) => {
            let bodies = closures(graph, &times, jobs_a_round);
            let task_set = task_set(graph, jobs, policy, workers);
            native::run(task_set, bodies, Setting { policy, workers })
        }
        Runner::Typed(policy) => {
            let machine = Native::new().workers(workers).policy(policy);
            commit_typed(graph, jobs, &times, jobs_a_round);
            machine.run()
        }
    };
    let completed = report.statistics[0].completed;
    if completed != jobs {
        let name = runner.name();
        return Err(format!(
            "{graph}, {name}: {completed} of {jobs} jobs are complete"
        ));
    }
    Ok((times.durations(), report.pinning == Pinning::Pinned))
}
