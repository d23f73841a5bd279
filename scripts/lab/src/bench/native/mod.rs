//! The cost of the scheduler on the host's own processors.
//!
//! The kernel's engine runs on polling threads of Linux, with the graphs of `bench hand-off` and
//! empty bodies. Only the source does something: once a round it reads the clock. Nothing is
//! emulated, so the figures can be compared with those of libraries that run task graphs on
//! threads.
//!
//! Other work on the host affects the figures. Therefore each figure is measured in many short
//! *rounds*, spread over several passes, and given as minimum, median and 99th percentile: the
//! minimum is the cost of the code; median and percentile include the host's disturbance.
//!
//! - here: rounds of jobs, back to back, and the time of one step;
//! - `counted`: the instructions of one step, unaffected by other work;
//! - `across_cores`: from the last return to the sink's start, and the throughput of two clusters.

mod across_cores;
mod counted;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

use fass::{Policy, SubtaskAttributes, create_dag, finish_create_dags};
use hand_off::{Shape, commit, empty};
use linux::{Linux, Mechanism};
use sched_dag::DagId;
use text::quoted;

use super::baseline;
use super::frame::{Figure, by_plan};
use tool::install;
use tool::options::{Command, CommandLine, ValueKind, options};
use tool::output::Table;
use tool::progress::Progress;
use tool::qemu::Mode;
use views::json::Object;

static TABLE: Command = Command {
    invocation: "./scripts/bench native",
    about: "Measures the scheduler on this host's own processors, with empty bodies.",
    positional: None,
    options: OPTIONS,
    notes: "\
`floor` calls the bodies in topological order, in a loop; `closures` are functions under
the scheduler, without values, on one and two workers; `typed` are functions with a u64 on each edge (not of
layered-1000 and dags-1000). `static` and `edf` are the policies.
`clusters` runs a graph in each of two clusters of one core, next to one on one core alone.

Prints a table and a JSON object for each figure. Times depend on the host and on what
else it does; compare figures of one run. Instructions do not.

Exit code: 0 measured, and nothing grew; 1 something grew, or a run did not complete its jobs;
2 the command line is refused.
",
};

options! {
    /// How many rounds of about 20,000 instances each figure has.
    ROUNDS: ValueKind::Number(10, 100_000), or "300";
    /// The jobs whose joins across cores are measured.
    JOBS: ValueKind::Number(100, 10_000_000), or "20000";
    /// The workloads, with commas between: chain-64, fork-join-2, fork-join-4, fork-join-6,
    /// layered-1000, dags-1000, join, clusters; all.
    ONLY: ValueKind::Text("NAMES");
    /// Instead, count the instructions of `closures, static` on one worker. Needs Valgrind.
    INSTRUCTIONS: ValueKind::Nothing;
    /// Count them, and compare with the baseline; one that grew is a failure.
    COMPARE: ValueKind::Nothing;
    /// Count them, and write them into the baseline, tests/baselines/native.json.
    SAVE_BASELINE: ValueKind::Nothing;
}

/// The name of the workload of joins across cores.
const JOIN: &str = "join";

/// The name of the workload of two clusters next to one core.
const CLUSTERS: &str = "clusters";

/// Runs `bench native` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&TABLE, words, NativePlan::read, measure)
}

/// The plan of the measurement.
struct NativePlan {
    rounds: usize,
    jobs: u64,
    graphs: Vec<MeasuredGraph>,
    with_join: bool,
    with_clusters: bool,
    /// Whether instructions are counted instead.
    counts: bool,
    /// The figures of the baseline, if they are to be compared.
    before: Option<Vec<Figure>>,
    saves: bool,
}

/// The numbers of workers, each a thread with a processor of its own.
const WORKERS: [u32; 2] = [1, 2];

impl NativePlan {
    fn read(options: &CommandLine) -> Result<Self, String> {
        options.check_distinct(&[name::ONLY])?;
        let names = MeasuredGraph::ALL.iter().map(|graph| graph.name);
        let known: Vec<&str> = names.chain([JOIN, CLUSTERS]).collect();
        let chosen = options.text(name::ONLY);
        let chosen = chosen.map(|names| names.split(',').collect());
        let wanted: Vec<&str> = chosen.unwrap_or_else(|| known.clone());
        if let Some(name) = wanted.iter().find(|name| !known.contains(name)) {
            let (name, known) = (quoted(name), known.join(", "));
            return Err(format!(
                "`--only`: no workload is called {name}; there are {known}"
            ));
        }
        let of_baseline = [name::COMPARE, name::SAVE_BASELINE];
        let counts = options.given_of(&of_baseline).is_some();
        if counts {
            options.check_without(&[name::ONLY], "leaves workloads of the baseline out")?;
        }
        let before = options.is_given(name::COMPARE);
        let before = before.then(|| counted::BASELINE.read());
        let number = |name| options.number(name).unwrap_or(0);
        let is_wanted = |graph: &MeasuredGraph| wanted.contains(&graph.name);
        Ok(Self {
            rounds: usize::try_from(number(name::ROUNDS)).unwrap_or(usize::MAX),
            jobs: number(name::JOBS),
            graphs: MeasuredGraph::ALL.into_iter().filter(is_wanted).collect(),
            with_join: wanted.contains(&JOIN),
            with_clusters: wanted.contains(&CLUSTERS),
            counts: counts || options.is_given(name::INSTRUCTIONS),
            before: before.transpose()?,
            saves: options.is_given(name::SAVE_BASELINE),
        })
    }
}

/// A figure in nanoseconds, and its runner and policy.
type NativeRow = (Figure, &'static str);

/// Counts as `--compare` does, and [checks](baseline::Baseline::check) the figures.
///
/// # Errors
///
/// In words: a program failed, or the check.
pub(crate) fn check(list: Option<&Path>) -> Result<(), String> {
    counted::BASELINE.check(&counted::count(&MeasuredGraph::ALL)?, list)
}

/// Measures and prints. Returns whether no figure has grown; times have no limit.
fn measure(plan: &NativePlan) -> Result<bool, String> {
    if plan.counts {
        install::ensure(&install::VALGRIND)?;
        let figures = counted::count(&plan.graphs)?;
        for figure in &figures {
            let line = Object::new().text("kind", "bench").text("name", "native");
            println!("{}", figure.json(line));
        }
        print!(
            "{}",
            baseline::table(&[(Mode::Deterministic, figures.clone())])
        );
        return counted::BASELINE.judge(&figures, plan.before.as_deref(), plan.saves);
    }
    // Two workers that poll on one processor would only wait for each other.
    if linux::processors() < 2 {
        return Err("this host has one processor for us; two are needed".into());
    }
    let total = passes(&plan.graphs);
    let (mut progress, mut over) = (Progress::new(total, "passes"), 0);
    let mut show = || {
        over += 1;
        progress.show(over);
    };
    let mut rows = Vec::new();
    for &graph in &plan.graphs {
        let measured = throughput(graph, plan.rounds, &mut show)?;
        rows.extend(measured);
    }
    progress.wipe();
    if plan.with_join {
        rows.extend(across_cores::join(plan.jobs)?);
    }
    let together = match plan.with_clusters {
        true => across_cores::clusters(plan.rounds, &mut rows)?,
        false => Vec::new(),
    };
    print!("{}", table(&rows));
    for (graph, times) in &together {
        println!("{graph}: two clusters of one core each do {times:.2} times what one core does");
    }
    for row in &rows {
        println!("{}", machine_line(row));
    }
    for (graph, times) in &together {
        let line = Object::new().text("kind", "bench");
        let line = line.text("name", "native-clusters").text("workload", graph);
        let line = line.number("clusters", 2_u64);
        println!("{}", line.json("times", &format!("{times:.3}")).into_text());
    }
    Ok(true)
}

fn table(rows: &[NativeRow]) -> String {
    let columns = ":<14|ns:<38|bodies, policy:<18|workers:8|min:10.1|median:10.1|p99:10.1";
    let mut table = Table::new("", columns);
    let mut before = "";
    for (figure, runner) in rows {
        let is_same = std::mem::replace(&mut before, &figure.workload) == figure.workload;
        let [min, median, p99] =
            [figure.min, figure.median, figure.p99].map(|ns| figure.of_step(ns));
        let name = if is_same { "" } else { before };
        table.row(&[
            &name,
            &figure.figure,
            runner,
            &figure.cores,
            &min,
            &median,
            &p99,
        ]);
    }
    table.text()
}

fn machine_line((figure, runner): &NativeRow) -> String {
    let one = |ns| format!("{:.2}", figure.of_step(ns));
    Object::new()
        .text("kind", "bench")
        .text("name", "native")
        .text("workload", &figure.workload)
        .text("what", &figure.figure)
        .text("runner", runner)
        .number("workers", figure.cores)
        .number("samples", figure.samples)
        .json("min_ns", &one(figure.min))
        .json("median_ns", &one(figure.median))
        .json("p99_ns", &one(figure.p99))
        .into_text()
}

/// The number of turns of each runner: a change of the host's speed then affects all runners.
const PASSES: usize = 3;

/// The approximate number of instances of a round: some hundred microseconds.
const INSTANCES_A_ROUND: usize = 20_000;

/// The way of running the bodies.
#[derive(Clone, Copy)]
enum BodyRunner {
    /// A loop over the functions.
    Floor,
    /// The scheduler, with functions without values.
    Closures(Policy, &'static str),
    /// The scheduler, with a value on each edge, by static priority.
    Typed,
}

impl BodyRunner {
    const fn name(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::Closures(_, name) => name,
            Self::Typed => "typed, static",
        }
    }
}

/// Returns the number of passes of [`measure`].
fn passes(graphs: &[MeasuredGraph]) -> u64 {
    let of_graph = |graph: &MeasuredGraph| (PASSES * runners(*graph).len()) as u64;
    graphs.iter().map(of_graph).sum()
}

/// Measures all runners, calling `show` after each pass.
fn throughput(
    graph: MeasuredGraph,
    rounds: usize,
    show: &mut impl FnMut(),
) -> Result<Vec<NativeRow>, String> {
    let runners = runners(graph);
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
    let of_runner = |(&(runner, workers), samples): (&(BodyRunner, u32), Vec<u64>)| {
        let what = (u64::from(workers), graph.name, step);
        (Figure::new(what, per, samples), runner.name())
    };
    Ok(runners.iter().zip(samples).map(of_runner).collect())
}

fn runners(graph: MeasuredGraph) -> Vec<(BodyRunner, u32)> {
    let mut runners = vec![(BodyRunner::Floor, 1)];
    for workers in WORKERS {
        let (ranked, by_deadline) = (Policy::StaticPriority, Policy::Edf);
        let policies = [(ranked, "closures, static"), (by_deadline, "closures, edf")];
        runners
            .extend(policies.map(|(policy, name)| (BodyRunner::Closures(policy, name), workers)));
        runners.extend(graph.has_values().then_some((BodyRunner::Typed, workers)));
    }
    runners
}

fn jobs_a_round(graph: MeasuredGraph) -> u64 {
    (INSTANCES_A_ROUND / graph.instances()) as u64
}

/// Runs the rounds, after some to warm up, and returns the time of each in nanoseconds.
fn pass(
    graph: MeasuredGraph,
    runner: BodyRunner,
    workers: u32,
    rounds: usize,
) -> Result<Vec<u64>, String> {
    let jobs_a_round = jobs_a_round(graph);
    // One job more: the last round needs an end.
    let jobs = jobs_a_round * (rounds + rounds / 8) as u64 + 1;
    let marks = RoundTimes::default();
    let mut functions = empty(graph.shape, graph.dags, marks.source(jobs_a_round));
    match runner {
        BodyRunner::Floor => {
            for job in 0..jobs {
                functions.iter_mut().flatten().for_each(|tick| tick(job));
            }
        }
        BodyRunner::Closures(policy, _) => {
            let machine = machine(policy, workers)?;
            commit(graph.shape, jobs, PERIOD, vec![functions]);
            run_jobs(&machine, jobs)?;
        }
        BodyRunner::Typed => {
            let machine = machine(Policy::StaticPriority, workers)?;
            commit_typed(graph, jobs, marks.source(jobs_a_round));
            run_jobs(&machine, jobs)?;
        }
    }
    let times_ns = marks.times_ns();
    let rounds_ns = times_ns.windows(2).map(|pair| pair[1] - pair[0]);
    // The rounds at the beginning warm the caches up.
    Ok(rounds_ns.skip(times_ns.len() / 10).collect())
}

/// A measured graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MeasuredGraph {
    name: &'static str,
    /// The shape of each DAG.
    shape: Shape,
    /// The number of DAGs, released at once, each with a deadline of its own.
    dags: u16,
    /// The name of a step, and the number of steps of a job of all DAGs.
    steps: (&'static str, u64),
}

impl MeasuredGraph {
    const CHAIN: Self = Self::new("chain-64", Shape::Chain(64), 1, ("per hop", 63));
    const LAYERED: Self = {
        let (subtasks, seed) = (1_000, 1);
        let shape = Shape::Layered { subtasks, seed };
        Self::new("layered-1000", shape, 1, ("per instance", 1_000))
    };
    const JOIN: Self = Self::fork_join("fork-join-2", 2);
    const ALL: [Self; 6] = [
        Self::CHAIN,
        Self::JOIN,
        Self::fork_join("fork-join-4", 4),
        Self::fork_join("fork-join-6", 6),
        Self::LAYERED,
        Self::new("dags-1000", Shape::Chain(1), 1_000, ("per job", 1_000)),
    ];

    const fn new(name: &'static str, shape: Shape, dags: u16, steps: (&'static str, u64)) -> Self {
        Self {
            name,
            shape,
            dags,
            steps,
        }
    }

    const fn fork_join(name: &'static str, parallel: usize) -> Self {
        Self::new(name, Shape::ForkJoin(parallel), 1, ("per job", 1))
    }

    /// Returns the number of instances of one job of all DAGs.
    fn instances(self) -> usize {
        usize::from(self.dags) * self.shape.subtasks()
    }

    /// Reports whether there is a form with a value on each edge.
    const fn has_values(self) -> bool {
        self.dags == 1 && !matches!(self.shape, Shape::Layered { .. })
    }
}

/// Returns a time in nanoseconds.
fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// The times at which rounds begin and end, in nanoseconds since the first reading.
#[derive(Clone, Debug, Default)]
struct RoundTimes(Arc<Mutex<Vec<u64>>>);

impl RoundTimes {
    /// Returns the times.
    fn times_ns(&self) -> Vec<u64> {
        let times_ns = self.0.lock();
        times_ns.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns the source's function, which reads the clock once in `jobs_a_round` jobs.
    fn source(&self, jobs_a_round: u64) -> impl FnMut() + Send + 'static {
        static EPOCH: LazyLock<Instant> = LazyLock::new(Instant::now);
        let rounds = self.clone();
        let mut left = 1;
        move || {
            left -= 1;
            if left == 0 {
                left = jobs_a_round;
                let mut times_ns = rounds.0.lock().unwrap_or_else(PoisonError::into_inner);
                times_ns.push(nanoseconds(EPOCH.elapsed()));
            }
        }
    }
}

/// A period longer than any job. As idle time is skipped, releases are back to back.
const PERIOD: Duration = Duration::from_secs(1);

/// Makes a machine of `workers` polling threads. Jobs follow one another without a pause, and no
/// events are recorded. Only one thread of the program may measure at a time.
fn machine(policy: Policy, workers: u32) -> Result<Linux, String> {
    let linux = Linux::new(workers, Mechanism::Poll).map_err(|why| why.to_string())?;
    let linux = linux.with(|to| (to.scheduler.policy, to.most_events) = (policy, 0));
    Ok(linux.skipping_idle_time())
}

/// Runs the committed DAGs, and makes sure that each has completed all jobs.
fn run_jobs(linux: &Linux, jobs: u64) -> Result<(), String> {
    let run = linux.run().map_err(|why| why.to_string())?;
    let dags = (0..).map(DagId).take(run.task_set().dags().len());
    let completed = dags.map(|dag| run.statistics(dag).completed).min();
    match completed.unwrap_or(0) {
        least if least == jobs => Ok(()),
        least => Err(format!("{least} of {jobs} jobs are complete")),
    }
}

fn named(number: usize) -> SubtaskAttributes {
    SubtaskAttributes::named(&format!("s{number}"))
}

/// Commits a graph of one DAG with a value on each edge; its source also calls `tick`.
fn commit_typed(graph: MeasuredGraph, jobs: u64, mut tick: impl FnMut() + Send + 'static) {
    let dag = create_dag();
    dag.name("typed").jobs(jobs).in_flight(1);
    let source = move || {
        tick();
        (1u64,)
    };
    dag.register_periodic_subtask(source, vec!["t0"], PERIOD, named(0));
    let sink = graph.shape.subtasks() - 1;
    // Each subtask writes the topic with its number.
    let topics: Vec<String> = (0..sink).map(|number| format!("t{number}")).collect();
    let is_chain = matches!(graph.shape, Shape::Chain(_));
    for number in 1..sink {
        let input = &topics[if is_chain { number - 1 } else { 0 }];
        let body = |(value,): (u64,)| (value,);
        dag.register_subtask(
            body,
            [input.as_str()],
            [topics[number].as_str()],
            named(number),
        );
    }
    let last = if is_chain { sink - 1 } else { 1 };
    let inputs: Vec<&str> = topics[last..].iter().map(String::as_str).collect();
    let attributes = named(sink);
    match inputs.len() {
        1 => dag.register_sink_subtask(|_: (u64,)| (), inputs, PERIOD, attributes),
        2 => dag.register_sink_subtask(|_: (u64, u64)| (), inputs, PERIOD, attributes),
        4 => dag.register_sink_subtask(|_: (u64, u64, u64, u64)| (), inputs, PERIOD, attributes),
        _ => {
            let body = |_: (u64, u64, u64, u64, u64, u64)| ();
            dag.register_sink_subtask(body, inputs, PERIOD, attributes)
        }
    };
    finish_create_dags(&[dag]).expect("the graphs are right");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::right;

    fn plan(line: &str) -> Result<NativePlan, String> {
        NativePlan::read(&right(&TABLE, line))
    }

    #[test]
    fn workloads_are_chosen_by_name_and_unknown_ones_refused_with_those_there_are() {
        let chosen = plan("--only fork-join-2,chain-64").expect("right");
        assert_eq!(chosen.graphs, [MeasuredGraph::CHAIN, MeasuredGraph::JOIN]);
        assert!(!chosen.with_join && !chosen.with_clusters);
        let line = plan("--only chain-65").err().expect("refused");
        assert!(line.contains("called `chain-65`") && line.contains("chain-64, fork-join-2"));
    }

    #[test]
    fn a_baseline_is_of_instructions_and_of_all_workloads() {
        let why = plan("--compare --only join").err().expect("refused");
        assert!(why.starts_with("`--only` leaves workloads of"), "{why}");
        assert!(plan("--save-baseline").is_ok_and(|plan| plan.counts && plan.saves));
    }
}
