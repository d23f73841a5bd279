//! The graphs of `bench hand-off`, with bodies that do nothing.
//!
//! Only the source does something: once a round it reads the clock.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use fass::{
    ConstructionPolicy, Dag, Policy, SubtaskAttributes, create_dag, finish_create_dags,
    finish_create_dags_with,
};
use hand_off::Shape;
use linux::{Linux, Mechanism};
use sched_dag::DagId;

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

    /// Reports whether there is a form of it with a value on each edge.
    pub(super) const fn has_values(self) -> bool {
        matches!(self, Self::Chain | Self::ForkJoin(_))
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

/// So many cores of this host by threads that poll, and the right to be the program's only ones.
pub(super) struct Machine {
    pub(super) linux: Linux,
    _right: MutexGuard<'static, ()>,
}

/// Takes them; jobs follow one another as fast as they go, and nothing is written down.
pub(super) fn machine(policy: Policy, workers: u32) -> Result<Machine, String> {
    static RIGHT: Mutex<()> = Mutex::new(());
    let right = RIGHT.lock().unwrap_or_else(PoisonError::into_inner);
    let linux = Linux::new(workers, Mechanism::Poll).map_err(|why| why.to_string())?;
    Ok(Machine {
        linux: linux.policy(policy).skipping_idle_time().most_events(0),
        _right: right,
    })
}

impl Machine {
    /// Divides the cores into clusters of one each, if there are several.
    pub(super) fn divided(self) -> Self {
        let sizes = vec![1; self.linux.cores() as usize];
        let linux = match sizes.len() {
            1 => self.linux,
            _ => self.linux.clusters(&sizes),
        };
        Self { linux, ..self }
    }

    /// Runs what is committed, and reports whether each DAG has completed so many jobs.
    pub(super) fn run(&self, jobs: u64) -> Result<(), String> {
        let run = self.linux.run().map_err(|why| why.to_string())?;
        let dags = (0..).map(DagId).take(run.task_set().dags().len());
        let completed = dags.map(|dag| run.statistics(dag).completed).min();
        match completed.unwrap_or(0) {
            least if least == jobs => Ok(()),
            least => Err(format!("{least} of {jobs} jobs are complete")),
        }
    }
}

/// A function of no values.
pub(super) type Tick = Box<dyn FnMut(u64) + Send>;

/// Makes empty functions of a graph's DAGs, subtask by subtask; the first source counts rounds.
pub(super) fn empty(graph: Graph, rounds: &Rounds, jobs_a_round: u64) -> Vec<Vec<Tick>> {
    let of_dag = || (0..graph.shape().subtasks()).map(|_| Box::new(|_| ()) as Tick);
    let mut all: Vec<Vec<Tick>> = (0..graph.dags()).map(|_| of_dag().collect()).collect();
    let mut source = rounds.source(jobs_a_round);
    all[0][0] = Box::new(move |_| source());
    all
}

/// Returns the relative deadline of a DAG: the period, or as many microseconds less as DAGs
/// are before it in a shuffled order.
fn deadline(graph: Graph, dag: usize) -> Duration {
    // 617 shares no divisor with 1,000, so no two have the same.
    let before = dag * 617 % graph.dags();
    PERIOD - Duration::from_micros(before as u64)
}

fn named(number: usize) -> SubtaskAttributes {
    SubtaskAttributes::named(&format!("s{number}"))
}

/// Commits DAGs without values, of a shape that is any graph; each of the clusters has such ones.
pub(super) fn commit(graph: Graph, jobs: u64, clusters: Vec<Vec<Vec<Tick>>>) {
    let is_divided = clusters.len() > 1;
    let mut dags = Vec::new();
    for (cluster, of_dags) in (0..).zip(clusters) {
        for (number, functions) in of_dags.into_iter().enumerate() {
            let dag = create_dag();
            dag.name(&format!("native{cluster}-{number}"));
            dag.jobs(jobs).in_flight(1).period(PERIOD);
            dag.relative_deadline(deadline(graph, number));
            if is_divided {
                dag.cluster(cluster);
            }
            let functions = functions.into_iter().enumerate();
            let subtasks: Vec<_> = functions
                .map(|(number, tick)| dag.register_untyped_subtask(tick, named(number)))
                .collect();
            for (earlier, later) in graph.shape().edges() {
                dag.precede(&subtasks[earlier], &subtasks[later]);
            }
            dags.push(dag);
        }
    }
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).expect("the graphs are right");
}

/// Commits a graph of one DAG with a value on each edge.
pub(super) fn commit_typed(graph: Graph, jobs: u64, rounds: &Rounds, jobs_a_round: u64) {
    let dag = typed(graph, jobs, rounds.source(jobs_a_round));
    finish_create_dags(&[dag]).expect("the graphs are right");
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
