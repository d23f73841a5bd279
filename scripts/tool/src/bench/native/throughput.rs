//! Job after job, back to back: what a hop, a job, an instance takes.

use sched_dag::Policy;

use super::graphs::{Graph, Rounds, commit, commit_typed, empty, machine, run};
use super::{Figure, Row};

/// How often each runner gets its turn, so that a change of the host's speed meets all.
const PASSES: usize = 3;

/// About how many instances a round has: some hundred microseconds.
const INSTANCES_A_ROUND: usize = 20_000;

/// What runs the bodies.
#[derive(Clone, Copy)]
enum Runner {
    /// A loop over the functions.
    Floor,
    /// The scheduler, with functions of no values.
    Closures(Policy),
    /// The scheduler, with a value on each edge, by static priority.
    Typed,
}

impl Runner {
    const fn name(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::Closures(Policy::StaticPriority) => "closures, static",
            Self::Closures(Policy::Edf) => "closures, edf",
            Self::Typed => "typed, static",
        }
    }
}

/// Returns how many passes [`measure`] makes.
pub(super) fn passes(graphs: &[Graph], workers: &[u32]) -> u64 {
    let of_graph = |graph: &Graph| (PASSES * runners(*graph, workers).len()) as u64;
    graphs.iter().map(of_graph).sum()
}

/// Measures all runners, calling `show` after each pass.
pub(super) fn measure(
    graph: Graph,
    workers: &[u32],
    rounds: usize,
    show: &mut impl FnMut(),
) -> Result<Vec<Row>, String> {
    let runners = runners(graph, workers);
    let mut samples = vec![Vec::new(); runners.len()];
    for _ in 0..PASSES {
        for (samples, &(runner, workers)) in samples.iter_mut().zip(&runners) {
            let rounds_ns = pass(graph, runner, workers, rounds.div_ceil(PASSES));
            samples.extend(rounds_ns.map_err(|why| {
                let (graph, runner) = (graph.name, runner.name());
                format!("{graph}, {runner}: {why}")
            })?);
            show();
        }
    }
    let (step, steps) = graph.steps;
    let per = jobs_a_round(graph) * steps;
    let of_runner = |(&(runner, workers), samples): (&(Runner, u32), Vec<u64>)| {
        let what = (u64::from(workers), graph.name, step);
        (Figure::new(what, per, samples), runner.name())
    };
    Ok(runners.iter().zip(samples).map(of_runner).collect())
}

fn runners(graph: Graph, workers: &[u32]) -> Vec<(Runner, u32)> {
    let mut runners = vec![(Runner::Floor, 1)];
    for &workers in workers {
        let policies = [Policy::StaticPriority, Policy::Edf];
        runners.extend(policies.map(|policy| (Runner::Closures(policy), workers)));
        runners.extend(graph.has_values().then_some((Runner::Typed, workers)));
    }
    runners
}

fn jobs_a_round(graph: Graph) -> u64 {
    (INSTANCES_A_ROUND / graph.instances()) as u64
}

/// Runs the rounds, and some before to warm up, and returns what each took in nanoseconds.
fn pass(graph: Graph, runner: Runner, workers: u32, rounds: usize) -> Result<Vec<u64>, String> {
    let jobs_a_round = jobs_a_round(graph);
    let jobs = jobs_a_round * (rounds + rounds / 8) as u64 + 1;
    let marks = Rounds::default();
    let mut functions = empty(graph, &marks, jobs_a_round);
    match runner {
        Runner::Floor => {
            for job in 0..jobs {
                functions.iter_mut().flatten().for_each(|tick| tick(job));
            }
        }
        Runner::Closures(policy) => {
            let machine = machine(policy, workers)?;
            commit(graph, jobs, vec![functions]);
            run(&machine, jobs)?;
        }
        Runner::Typed => {
            let machine = machine(Policy::StaticPriority, workers)?;
            commit_typed(graph, jobs, marks.source(jobs_a_round));
            run(&machine, jobs)?;
        }
    }
    let times_ns = marks.times_ns();
    let rounds_ns = times_ns.windows(2).map(|pair| pair[1] - pair[0]);
    Ok(rounds_ns.skip(times_ns.len() / 10).collect())
}
