//! The graphs of `bench hand-off`, with bodies that do nothing.
//!
//! Only the source does something: once a round it reads the clock.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use hand_off::Shape;
use native::Closure;
use sched_dag::{CommitOptions, ConstructionPolicy, DagSpec, Policy, SubtaskSpec, TaskSet, verify};

/// A graph that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Graph {
    /// 64 subtasks, one after the other.
    Chain,
    /// So many side by side, between a source and a sink.
    ForkJoin(usize),
    /// 1,000 subtasks in layers.
    Layered,
}

impl fmt::Display for Graph {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chain => write!(f, "chain-64"),
            Self::ForkJoin(parallel) => write!(f, "fork-join-{parallel}"),
            Self::Layered => write!(f, "layered-1000"),
        }
    }
}

impl Graph {
    pub(super) const ALL: [Self; 5] = [
        Self::Chain,
        Self::ForkJoin(2),
        Self::ForkJoin(4),
        Self::ForkJoin(6),
        Self::Layered,
    ];

    pub(super) const fn shape(self) -> Shape {
        match self {
            Self::Chain => Shape::Chain(64),
            Self::ForkJoin(parallel) => Shape::ForkJoin(parallel),
            Self::Layered => Shape::Layered {
                subtasks: 1_000,
                seed: 1,
            },
        }
    }

    /// Returns what a step is called, and how many steps a job has.
    pub(super) fn steps(self) -> (&'static str, f64) {
        match self {
            Self::Chain => ("per hop", 63.0),
            Self::ForkJoin(_) => ("per job", 1.0),
            Self::Layered => ("per instance", 1_000.0),
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

/// Makes empty functions; the source counts rounds.
pub(super) fn closures(graph: Graph, rounds: &Rounds, jobs_a_round: u64) -> Vec<Closure> {
    let mut source = rounds.source(jobs_a_round);
    let mut bodies: Vec<Closure> = vec![Box::new(move |_| source())];
    bodies.resize_with(graph.shape().subtasks(), || Box::new(|_| ()));
    bodies
}

/// Verifies the graph as a DAG of `jobs` jobs.
pub(super) fn task_set(shape: Shape, jobs: u64, policy: Policy, workers: u32) -> TaskSet {
    let period_ns = u64::try_from(PERIOD.as_nanos()).ok();
    let spec = DagSpec {
        name: "native".to_owned(),
        period_ns,
        relative_deadline_ns: period_ns,
        jobs: Some(jobs),
        in_flight: Some(1),
        subtasks: vec![SubtaskSpec::default(); shape.subtasks()],
        edges: shape.edges(),
        ..DagSpec::default()
    };
    let options =
        CommitOptions::new(policy, workers).with_construction(ConstructionPolicy::any_graph());
    let verified = verify(&[spec], &options);
    verified.expect("the graphs are right").task_set
}

/// Commits the graph by `fass` to the thread's machine, as an app would write it.
pub(super) fn commit_typed(graph: Graph, jobs: u64, rounds: &Rounds, jobs_a_round: u64) {
    let dag = create_dag();
    dag.name("typed").jobs(jobs).in_flight(1);
    let named = |number: usize| SubtaskAttributes::named(&format!("s{number}"));
    let mut tick = rounds.source(jobs_a_round);
    let shape = graph.shape();
    if graph == Graph::Layered {
        dag.period(PERIOD);
        dag.relative_deadline(PERIOD);
        let mut subtasks = vec![dag.register_untyped_subtask(move |_| tick(), named(0))];
        subtasks.extend(
            (1..shape.subtasks()).map(|number| dag.register_untyped_subtask(|_| (), named(number))),
        );
        for (earlier, later) in shape.edges() {
            dag.precede(&subtasks[earlier], &subtasks[later]);
        }
        finish_create_dags(&[dag]).expect("the graph is right");
        return;
    }
    let source = move || {
        tick();
        (1u64,)
    };
    dag.register_periodic_subtask(source, vec!["t0"], PERIOD, named(0));
    let sink = shape.subtasks() - 1;
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
    finish_create_dags(&[dag]).expect("the graph is right");
}
