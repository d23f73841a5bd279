//! What runs were observed to take: per subtask the execution times, per DAG the response
//! times.
//!
//! Runs of other boots can be added: DAGs are the same if the hashes of their names and edges are.

use std::collections::BTreeMap;

use recording::Counted;
use sched_dag::law::Distribution;

use crate::json::Object;
use crate::record::Record;

/// A DAG of one shape, in all its runs.
#[derive(Clone, Debug)]
pub struct OfDag {
    /// Its name.
    pub name: String,
    /// The hash of its names and edges.
    pub hash: u64,
    /// The longest response time in nanoseconds, by the commit's number.
    pub longest_responses_ns: BTreeMap<usize, u64>,
    /// Its subtasks, by number: name and execution times in nanoseconds.
    pub subtasks: Vec<(String, Distribution)>,
}

/// Adds what a boot's runs took to what was seen before.
///
/// # Errors
///
/// In words: there are no times, or not of all DAGs.
pub fn add(all: &mut Vec<OfDag>, record: &Record) -> Result<(), String> {
    let mut is_told = false;
    for (place, times) in &record.times {
        let committed = &record.commits[*place];
        is_told |= !times.dags.is_empty();
        for (dag, times) in committed.told.dags.iter().zip(&times.dags) {
            if times.subtasks.len() != dag.subtasks.len() {
                return Err(format!(
                    "the times of dag `{}` are not of its subtasks",
                    dag.name
                ));
            }
            let place = all.iter().position(|other| other.hash == dag.hash);
            let place = place.unwrap_or_else(|| {
                let names = dag.subtasks.iter().map(|subtask| subtask.name.clone());
                all.push(OfDag {
                    name: dag.name.clone(),
                    hash: dag.hash,
                    longest_responses_ns: BTreeMap::new(),
                    subtasks: names.map(|name| (name, Distribution::default())).collect(),
                });
                all.len() - 1
            });
            let of_dag = &mut all[place];
            let longest_ns = distribution(&times.response).max();
            let so_far = of_dag.longest_responses_ns.entry(committed.number);
            let so_far = so_far.or_default();
            *so_far = longest_ns.max(*so_far);
            for ((_, seen), times) in of_dag.subtasks.iter_mut().zip(&times.subtasks) {
                seen.add(&distribution(&times.execution));
            }
        }
    }
    match is_told {
        true => Ok(()),
        false => Err("the guest has run no DAG, or was told to record nothing".into()),
    }
}

/// Makes a distribution of what a record has counted.
#[must_use]
pub fn distribution(counted: &Counted) -> Distribution {
    Distribution::counted(counted.min_ns, counted.buckets.clone())
}

/// Returns a machine line for each subtask.
pub fn lines(all: &[OfDag]) -> impl Iterator<Item = String> {
    let of_dag = |dag: &OfDag| -> Vec<String> {
        let lines = dag.subtasks.iter().map(|(name, times)| {
            let buckets = times.values();
            let buckets = buckets.map(|(top, count)| format!("[{top},{count}]"));
            let times_ns = Object::new()
                .number("count", times.count())
                .number("min", times.min())
                .number("median", times.median())
                .number("p99", times.p99())
                .number("max", times.max())
                .end();
            Object::new()
                .text("kind", "observed")
                .text("dag", &dag.name)
                .number("hash", dag.hash)
                .text("subtask", name)
                .json("execution_time_ns", &times_ns)
                .list("execution_histogram", buckets)
                .end()
        });
        lines.collect()
    };
    all.iter().flat_map(of_dag)
}
