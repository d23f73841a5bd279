//! The answer about sets of more and more DAGs, by doubling.
//!
//! Under static priorities, one a DAG. A set has DAGs of 10 subtasks at half the load of 8 cores, however many they are: each
//! takes an equal share of it, and its period follows from that. So what grows is the
//! number of DAGs alone. The *exponent* of a row is that of the growth since the row
//! before: 1 where twice the DAGs take twice the time, 2 where they take four times it.

use std::fmt::Write;
use std::time::Duration;

use sched_dag::analysis::{Overheads, Settings, answer};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, SubtaskSpec, verify,
};

use super::super::{ratio, shortest, time};
use crate::random::Random;

/// The numbers of DAGs, each twice the one before.
const DAGS: [u64; 5] = [125, 250, 500, 1_000, 2_000];

const SUBTASKS: u64 = 10;

const CORES: u32 = 8;

const ROUNDS: usize = 3;

/// What the answer about one set costs.
pub(super) struct Figure {
    pub(super) dags: u64,
    pub(super) time: Duration,
    /// The growth since half as many DAGs, as an exponent.
    pub(super) exponent: Option<f64>,
}

/// Measures all sets.
pub(super) fn measure() -> Vec<Figure> {
    let mut figures: Vec<Figure> = Vec::new();
    for dags in DAGS {
        let specs = set(dags);
        let time = shortest((0..ROUNDS).map(|_| round(&specs)).collect());
        let before = figures.last();
        let exponent = before.map(|before| ratio(time, before.time).log2());
        figures.push(Figure {
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
    let _ = writeln!(text, "  {:28}{:>12}{:>12}", "DAGs", "time, ms", "exponent");
    for figure in figures {
        let exponent = figure
            .exponent
            .map_or("-".into(), |exponent| format!("{exponent:.2}"));
        let dags = figure.dags;
        let ms = figure.time.as_secs_f64() * 1e3;
        let _ = writeln!(text, "  {dags:<28}{ms:>12.1}{exponent:>12}");
    }
    text
}

impl Figure {
    /// Returns the figure as a JSON object.
    pub(super) fn line(&self) -> String {
        let exponent = self
            .exponent
            .map_or("null".into(), |exponent| format!("{exponent:.3}"));
        format!(
            "{{\"kind\":\"bench\",\"name\":\"answer\",\"dags\":{},\"time_ns\":{},\
             \"exponent\":{exponent}}}",
            self.dags,
            self.time.as_nanos()
        )
    }
}

fn round(specs: &[DagSpec]) -> Duration {
    let policy = Policy::StaticPriority;
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
fn set(dags: u64) -> Vec<DagSpec> {
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
        let period = 2 * volume * dags / u64::from(CORES) * 100 / random.within(50, 150);
        let subtask = |wcet_ns| SubtaskSpec {
            wcet_ns: Some(wcet_ns),
            ..SubtaskSpec::default()
        };
        DagSpec {
            name: format!("dag {number}"),
            period_ns: Some(period),
            relative_deadline_ns: Some(period),
            subtasks: wcets.into_iter().map(subtask).collect(),
            edges,
            ..DagSpec::default()
        }
    };
    (0..dags).map(dag).collect()
}
