//! The graphs of `bench hand-off`, with bodies that do nothing.
//!
//! Only the source does something: once a round it reads the clock.

use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

use fass::{
    ConstructionPolicy, Policy, SubtaskAttributes, create_dag, finish_create_dags,
    finish_create_dags_with,
};
use hand_off::Shape;
use linux::{Linux, Mechanism};
use sched_dag::DagId;

/// A graph that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Graph {
    pub(super) name: &'static str,
    /// The shape of each DAG.
    shape: Shape,
    /// How many DAGs there are: released at once, each with a deadline of its own.
    dags: u16,
    /// What a step is called, and how many a job of all DAGs has.
    pub(super) steps: (&'static str, u64),
}

impl Graph {
    pub(super) const CHAIN: Self = Self::new("chain-64", Shape::Chain(64), 1, ("per hop", 63));
    pub(super) const LAYERED: Self = {
        let (subtasks, seed) = (1_000, 1);
        let shape = Shape::Layered { subtasks, seed };
        Self::new("layered-1000", shape, 1, ("per instance", 1_000))
    };
    pub(super) const JOIN: Self = Self::fork_join("fork-join-2", 2);
    pub(super) const ALL: [Self; 6] = [
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

    /// Returns how many instances a job of each DAG has.
    pub(super) fn instances(self) -> usize {
        usize::from(self.dags) * self.shape.subtasks()
    }

    /// Reports whether there is a form of it with a value on each edge.
    pub(super) const fn has_values(self) -> bool {
        self.dags == 1 && !matches!(self.shape, Shape::Layered { .. })
    }
}

/// Returns a time in nanoseconds.
pub(super) fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// The times at which rounds begin and end, in nanoseconds since the first one.
#[derive(Clone, Debug, Default)]
pub(super) struct Rounds(Arc<Mutex<Vec<u64>>>);

impl Rounds {
    /// Returns them.
    pub(super) fn times_ns(&self) -> Vec<u64> {
        let times_ns = self.0.lock();
        times_ns.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns what a source does: it reads the clock once in `jobs_a_round` jobs.
    pub(super) fn source(&self, jobs_a_round: u64) -> impl FnMut() + Send + 'static {
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

/// A period that no job needs, with which the releases are back to back.
const PERIOD: Duration = Duration::from_secs(1);

/// Takes so many cores of this host by threads that poll. Jobs follow one another as fast as they
/// go, and nothing is written down. Only one thread of the program may measure at a time.
pub(super) fn machine(policy: Policy, workers: u32) -> Result<Linux, String> {
    let linux = Linux::new(workers, Mechanism::Poll).map_err(|why| why.to_string())?;
    let linux = linux.with(|to| (to.scheduler.policy, to.most_events) = (policy, 0));
    Ok(linux.skipping_idle_time())
}

/// Runs what is committed, and makes sure that each DAG has completed so many jobs.
pub(super) fn run(linux: &Linux, jobs: u64) -> Result<(), String> {
    let run = linux.run().map_err(|why| why.to_string())?;
    let dags = (0..).map(DagId).take(run.task_set().dags().len());
    let completed = dags.map(|dag| run.statistics(dag).completed).min();
    match completed.unwrap_or(0) {
        least if least == jobs => Ok(()),
        least => Err(format!("{least} of {jobs} jobs are complete")),
    }
}

/// A function of no values.
pub(super) type Tick = Box<dyn FnMut(u64) + Send>;

/// Makes empty functions of a graph's DAGs, subtask by subtask; the first source counts rounds.
pub(super) fn empty(graph: Graph, rounds: &Rounds, jobs_a_round: u64) -> Vec<Vec<Tick>> {
    let of_dag = |_| (0..graph.shape.subtasks()).map(|_| Box::new(|_| ()) as Tick);
    let mut all: Vec<Vec<Tick>> = (0..graph.dags).map(|dag| of_dag(dag).collect()).collect();
    let mut source = rounds.source(jobs_a_round);
    all[0][0] = Box::new(move |_| source());
    all
}

fn named(number: usize) -> SubtaskAttributes {
    SubtaskAttributes::named(&format!("s{number}"))
}

/// Commits DAGs without values, of a shape that is any graph; each of the clusters has such ones.
pub(super) fn commit(graph: Graph, jobs: u64, clusters: Vec<Vec<Vec<Tick>>>) {
    let is_divided = clusters.len() > 1;
    let mut dags = Vec::new();
    for (cluster, of_dags) in (0..).zip(clusters) {
        for (number, functions) in (0_u64..).zip(of_dags) {
            let dag = create_dag();
            dag.name(&format!("native{cluster}-{number}"));
            dag.jobs(jobs).in_flight(1).period(PERIOD);
            // Deadlines in a shuffled order, of which no two are the same: 617 shares no
            // divisor with 1,000.
            let earlier = number * 617 % u64::from(graph.dags);
            dag.relative_deadline(PERIOD - Duration::from_micros(earlier));
            if is_divided {
                dag.cluster(cluster);
            }
            let functions = functions.into_iter().enumerate();
            let subtasks: Vec<_> = functions
                .map(|(number, tick)| dag.register_untyped_subtask(tick, named(number)))
                .collect();
            for (earlier, later) in graph.shape.edges() {
                dag.precede(&subtasks[earlier], &subtasks[later]);
            }
            dags.push(dag);
        }
    }
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).expect("the graphs are right");
}

/// Commits a graph of one DAG with a value on each edge; its source does `tick`, too.
pub(super) fn commit_typed(graph: Graph, jobs: u64, mut tick: impl FnMut() + Send + 'static) {
    let dag = create_dag();
    dag.name("typed").jobs(jobs).in_flight(1);
    let source = move || {
        tick();
        (1u64,)
    };
    dag.register_periodic_subtask(source, vec!["t0"], PERIOD, named(0));
    let sink = graph.shape.subtasks() - 1;
    // Each subtask writes the topic of its number.
    let topics: Vec<String> = (0..sink).map(|number| format!("t{number}")).collect();
    let is_chain = matches!(graph.shape, Shape::Chain(_));
    for number in 1..sink {
        let input = &topics[if is_chain { number - 1 } else { 0 }];
        let body = |(value,): (u64,)| (value,);
        dag.register_subtask(body, vec![input], vec![&topics[number]], named(number));
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
