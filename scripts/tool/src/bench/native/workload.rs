//! The graphs of `bench hand-off`, with bodies that do nothing.
//!
//! Only the source does something: once a round it reads the clock.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use hand_off::Shape;
use native::Closure;
use sched_dag::{
    ClusterId, Clusters, CommitOptions, ConstructionPolicy, DagSpec, Policy, SubtaskSpec, TaskSet,
    verify,
};

/// A graph that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Graph {
    /// 64 subtasks, one after the other.
    Chain,
    /// So many side by side, between a source and a sink.
    ForkJoin(usize),
    /// 1,000 subtasks in layers.
    Layered,
    /// So many DAGs of one subtask, released at once, each with a deadline of its own.
    Dags(u16),
}

impl fmt::Display for Graph {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chain => write!(f, "chain-64"),
            Self::ForkJoin(parallel) => write!(f, "fork-join-{parallel}"),
            Self::Layered => write!(f, "layered-1000"),
            Self::Dags(count) => write!(f, "dags-{count}"),
        }
    }
}

impl Graph {
    pub(super) const ALL: [Self; 6] = [
        Self::Chain,
        Self::ForkJoin(2),
        Self::ForkJoin(4),
        Self::ForkJoin(6),
        Self::Layered,
        Self::Dags(1_000),
    ];

    /// Returns the shape of each DAG.
    const fn shape(self) -> Shape {
        match self {
            Self::Chain => Shape::Chain(64),
            Self::ForkJoin(parallel) => Shape::ForkJoin(parallel),
            Self::Layered => Shape::Layered {
                subtasks: 1_000,
                seed: 1,
            },
            Self::Dags(_) => Shape::Chain(1),
        }
    }

    /// Returns how many DAGs there are.
    pub(super) fn dags(self) -> usize {
        match self {
            Self::Dags(count) => usize::from(count),
            _ => 1,
        }
    }

    /// Returns how many instances a job of each DAG has.
    pub(super) fn instances(self) -> usize {
        self.dags() * self.shape().subtasks()
    }

    /// Returns what a step is called, and how many steps a job of each DAG has.
    pub(super) fn steps(self) -> (&'static str, f64) {
        match self {
            Self::Chain => ("per hop", 63.0),
            Self::ForkJoin(_) => ("per job", 1.0),
            Self::Layered => ("per instance", 1_000.0),
            Self::Dags(count) => ("per job", f64::from(count)),
        }
    }
}

/// The times at which rounds begin and end.
#[derive(Clone, Debug, Default)]
pub(super) struct Rounds(Arc<Mutex<Vec<Instant>>>);

impl Rounds {
    /// Returns what each round took, without the first few, which warm up.
    pub(super) fn durations(&self) -> Vec<Duration> {
        let times = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let durations = times.windows(2).map(|pair| pair[1] - pair[0]);
        durations.skip(times.len() / 10).collect()
    }

    /// Returns the times themselves.
    pub(super) fn times(&self) -> Vec<Instant> {
        let times = self.0.lock();
        times.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns what a source does: it reads the clock once in `jobs_a_round` jobs.
    pub(super) fn source(&self, jobs_a_round: u64) -> impl FnMut() + Send + 'static {
        let rounds = self.clone();
        let mut left = 1;
        move || {
            left -= 1;
            if left == 0 {
                left = jobs_a_round;
                let mut times = rounds.0.lock().unwrap_or_else(PoisonError::into_inner);
                times.push(Instant::now());
            }
        }
    }
}

/// A period that no job needs, with which the releases are back to back.
const PERIOD: Duration = Duration::from_secs(1);

/// Makes empty functions, DAG by DAG; the first source counts rounds.
pub(super) fn closures(graph: Graph, rounds: &Rounds, jobs_a_round: u64) -> Vec<Vec<Closure>> {
    let empty = || -> Closure { Box::new(|_| ()) };
    let of_dag = || (0..graph.shape().subtasks()).map(|_| empty()).collect();
    let mut bodies: Vec<Vec<Closure>> = (0..graph.dags()).map(|_| of_dag()).collect();
    let mut source = rounds.source(jobs_a_round);
    bodies[0][0] = Box::new(move |_| source());
    bodies
}

/// Verifies the graph, each DAG with `jobs` jobs.
pub(super) fn task_set(graph: Graph, jobs: u64, policy: Policy, workers: u32) -> TaskSet {
    let specs: Vec<DagSpec> = (0..graph.dags())
        .map(|dag| spec(graph, dag, jobs))
        .collect();
    verified(&specs, CommitOptions::new(policy, workers))
}

/// Verifies a graph of one DAG twice, each in a cluster of one core.
pub(super) fn divided(graph: Graph, jobs: u64, policy: Policy) -> TaskSet {
    let specs = [0, 1].map(|cluster| DagSpec {
        cluster: Some(ClusterId(cluster)),
        ..spec(graph, 0, jobs)
    });
    let options = CommitOptions::new(policy, 2).with_clusters(Clusters::Of(vec![1, 1]));
    verified(&specs, options)
}

fn spec(graph: Graph, dag: usize, jobs: u64) -> DagSpec {
    let nanoseconds = |time: Duration| u64::try_from(time.as_nanos()).ok();
    DagSpec {
        name: format!("native{dag}"),
        period_ns: nanoseconds(PERIOD),
        relative_deadline_ns: nanoseconds(deadline(graph, dag)),
        jobs: Some(jobs),
        in_flight: Some(1),
        subtasks: vec![SubtaskSpec::default(); graph.shape().subtasks()],
        edges: graph.shape().edges(),
        ..DagSpec::default()
    }
}

fn verified(specs: &[DagSpec], options: CommitOptions) -> TaskSet {
    let options = options.with_construction(ConstructionPolicy::any_graph());
    verify(specs, &options)
        .expect("the graphs are right")
        .task_set
}

/// Returns the relative deadline of a DAG: the period, or as many microseconds less as DAGs
/// are before it in a shuffled order.
fn deadline(graph: Graph, dag: usize) -> Duration {
    // 617 shares no divisor with 1,000, so no two have the same.
    let before = dag * 617 % graph.dags();
    PERIOD - Duration::from_micros(before as u64)
}

/// Commits the graph by `fass` to the thread's machine, as an app would write it.
pub(super) fn commit_typed(graph: Graph, jobs: u64, rounds: &Rounds, jobs_a_round: u64) {
    let tick = rounds.source(jobs_a_round);
    let dags = match graph {
        Graph::Layered | Graph::Dags(_) => untyped(graph, jobs, tick),
        _ => vec![typed(graph, jobs, tick)],
    };
    finish_create_dags(&dags).expect("the graphs are right");
}

fn named(number: usize) -> SubtaskAttributes {
    SubtaskAttributes::named(&format!("s{number}"))
}

/// Makes DAGs without values.
fn untyped(graph: Graph, jobs: u64, tick: impl FnMut() + Send + 'static) -> Vec<Dag> {
    let mut tick = Some(tick);
    let mut register = |dag: &Dag, number| match tick.take() {
        Some(mut tick) => dag.register_untyped_subtask(move |_| tick(), named(number)),
        None => dag.register_untyped_subtask(|_| (), named(number)),
    };
    let dag = |number| {
        let dag = create_dag();
        dag.name(&format!("untyped{number}"))
            .jobs(jobs)
            .in_flight(1);
        dag.period(PERIOD);
        dag.relative_deadline(deadline(graph, number));
        let shape = graph.shape();
        let subtasks = 0..shape.subtasks();
        let subtasks: Vec<_> = subtasks.map(|number| register(&dag, number)).collect();
        for (earlier, later) in shape.edges() {
            dag.precede(&subtasks[earlier], &subtasks[later]);
        }
        dag
    };
    (0..graph.dags()).map(dag).collect()
}

/// Makes one DAG with a value on each edge.
fn typed(graph: Graph, jobs: u64, mut tick: impl FnMut() + Send + 'static) -> Dag {
    let dag = create_dag();
    dag.name("typed").jobs(jobs).in_flight(1);
    let source = move || {
        tick();
        (1u64,)
    };
    dag.register_periodic_subtask(source, vec!["t0"], PERIOD, named(0));
    let sink = graph.shape().subtasks() - 1;
    let topics: Vec<String> = (0..sink).map(|number| format!("t{number}")).collect();
    for number in 1..sink {
        let input = match graph {
            Graph::ForkJoin(_) => "t0",
            _ => &topics[number - 1],
        };
        let body = |(value,): (u64,)| (value,);
        dag.register_subtask(body, vec![input], vec![&topics[number]], named(number));
    }
    let inputs: Vec<&str> = match graph {
        Graph::ForkJoin(_) => topics[1..].iter().map(String::as_str).collect(),
        _ => vec![&topics[sink - 1]],
    };
    let attributes = named(sink);
    match inputs.len() {
        1 => dag.register_sink_subtask(|_: (u64,)| (), inputs, PERIOD, attributes),
        2 => dag.register_sink_subtask(|_: (u64, u64)| (), inputs, PERIOD, attributes),
        4 => dag.register_sink_subtask(|_: (u64, u64, u64, u64)| (), inputs, PERIOD, attributes),
        _ => {
            let body = |_: (u64, u64, u64, u64, u64, u64)| ();
            dag.register_sink_subtask(body, inputs, PERIOD, attributes);
        }
    };
    dag
}
