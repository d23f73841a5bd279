//! The answer about sets of more and more DAGs, by doubling, in each way that they may delay
//! each other.
//!
//! A set has DAGs of 10 subtasks at half the load of 8 cores, however many they are, or at a
//! third where more is not proven: each takes an equal share of it, and its period follows from that. So what grows is the
//! number of DAGs alone. The *exponent* of a row is that of the growth since the row
//! before: 1 where twice the DAGs take twice the time, 2 where they take four times it.

use std::fmt::Write;
use std::time::Duration;

use sched_dag::analysis::{Overheads, Settings, answer};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, Priority, SubtaskSpec, verify,
};

use super::super::{ratio, shortest, time};
use crate::random::Random;

/// The numbers of DAGs, each twice the one before.
const DAGS: [u64; 5] = [125, 250, 500, 1_000, 2_000];

const SUBTASKS: u64 = 10;

const CORES: u32 = 8;

const ROUNDS: usize = 3;

/// Which DAGs may delay which.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Order {
    /// Static priorities, one a DAG.
    Apart,
    /// Static priorities of which each DAG has two, with a tenth of the others between.
    Interleaved,
    Edf,
}

/// What the answer about one set costs.
pub(super) struct Figure {
    order: Order,
    dags: u64,
    time: Duration,
    /// The growth since half as many DAGs, as an exponent.
    exponent: Option<f64>,
}

/// Measures all sets.
pub(super) fn measure() -> Vec<Figure> {
    let orders = [Order::Apart, Order::Interleaved, Order::Edf];
    orders.into_iter().flat_map(by_doubling).collect()
}

fn by_doubling(order: Order) -> Vec<Figure> {
    let mut figures: Vec<Figure> = Vec::new();
    for dags in DAGS {
        let specs = set(order, dags);
        let time = shortest((0..ROUNDS).map(|_| round(order, &specs)).collect());
        let before = figures.last();
        let exponent = before.map(|before| ratio(time, before.time).log2());
        figures.push(Figure {
            order,
            dags,
            time,
            exponent,
        });
    }
    figures
}

/// Writes a row a set.
pub(super) fn table(figures: &[Figure]) -> String {
    // Writing into a `String` cannot fail.
    let mut text = format!("commit with answer of DAGs of {SUBTASKS} subtasks on {CORES} cores\n");
    let _ = writeln!(
        text,
        "  {:30}{:>10}{:>12}{:>12}",
        "", "DAGs", "time, ms", "exponent"
    );
    for figure in figures {
        let exponent = figure
            .exponent
            .map_or("-".into(), |exponent| format!("{exponent:.2}"));
        let (order, dags) = (figure.order.name(), figure.dags);
        let ms = figure.time.as_secs_f64() * 1e3;
        let _ = writeln!(text, "  {order:30}{dags:>10}{ms:>12.1}{exponent:>12}");
    }
    text
}

impl Order {
    const fn name(self) -> &'static str {
        match self {
            Self::Apart => "static priorities",
            Self::Interleaved => "static ones that interleave",
            Self::Edf => "EDF",
        }
    }

    /// Returns how many times the DAGs' load the cores are.
    const fn cores_per_used(self) -> u64 {
        match self {
            Self::Apart | Self::Edf => 2,
            Self::Interleaved => 3,
        }
    }

    const fn policy(self) -> Policy {
        match self {
            Self::Apart | Self::Interleaved => Policy::StaticPriority,
            Self::Edf => Policy::Edf,
        }
    }

    /// Returns the priority of a subtask; `None`: that of its DAG.
    fn priority(self, dag: u64, dags: u64, subtask: usize) -> Option<Priority> {
        let later = if subtask % 2 == 1 { dags / 10 } else { 0 };
        let number = u32::try_from(dag + later).ok()?;
        (self == Self::Interleaved).then_some(Priority(number))
    }
}

impl Figure {
    /// Returns the figure as a JSON object.
    pub(super) fn line(&self) -> String {
        let exponent = self
            .exponent
            .map_or("null".into(), |exponent| format!("{exponent:.3}"));
        format!(
            "{{\"kind\":\"bench\",\"name\":\"answer\",\"order\":\"{}\",\"dags\":{},\
             \"time_ns\":{},\"exponent\":{exponent}}}",
            self.order.name(),
            self.dags,
            self.time.as_nanos()
        )
    }
}

fn round(order: Order, specs: &[DagSpec]) -> Duration {
    let policy = order.policy();
    let options =
        CommitOptions::new(policy, CORES).with_construction(ConstructionPolicy::any_graph());
    let settings = Settings {
        policy,
        preemption: Preemption::Enabled,
        cores: CORES,
        overheads: Overheads::default(),
    };
    time(|| {
        let verified = verify(specs, &options).expect("the DAGs are right");
        let answer = answer(&verified.task_set, &settings);
        assert!(answer.is_proven(), "{:?}", answer.first_failing);
        answer
    })
}

/// Draws a set of so many DAGs.
fn set(order: Order, dags: u64) -> Vec<DagSpec> {
    let mut random = Random::new(1);
    let dag = |number| {
        let wcets: Vec<u64> = (0..SUBTASKS)
            .map(|_| 1_000 * random.within(1, 100))
            .collect();
        let volume: u64 = wcets.iter().sum();
        let mut edges = Vec::new();
        for to in 1..10 {
            for from in 0..to {
                if random.within(0, 4) == 0 {
                    edges.push((from, to));
                }
            }
        }
        // Shares of the load from a half to one and a half times the mean one.
        let period = order.cores_per_used() * volume * dags / u64::from(CORES) * 100
            / random.within(50, 150);
        let subtask = |(subtask, wcet_ns)| SubtaskSpec {
            wcet_ns: Some(wcet_ns),
            priority: order.priority(number, dags, subtask),
            ..SubtaskSpec::default()
        };
        DagSpec {
            name: format!("dag {number}"),
            period_ns: Some(period),
            relative_deadline_ns: Some(period),
            subtasks: wcets.into_iter().enumerate().map(subtask).collect(),
            edges,
            ..DagSpec::default()
        }
    };
    (0..dags).map(dag).collect()
}
