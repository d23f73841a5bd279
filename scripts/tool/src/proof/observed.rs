//! What runs were observed to take: per subtask the execution times, per DAG the response
//! times.
//!
//! The times are those that a guest prints with `times=dump`, after the DAGs that it has
//! committed by `graph=dump`. Runs of other boots can be added: DAGs are the same if the
//! hashes of their names and edges are.

use std::collections::BTreeMap;

use sched_dag::law::Distribution;

use crate::json::{Object, Value};
use crate::protocol::{MachineLine, Transcript};

/// A DAG of one shape, in all its runs.
#[derive(Clone, Debug)]
pub struct OfDag {
    /// Its name.
    pub name: String,
    /// The hash of its names and edges.
    pub hash: u64,
    /// The longest response time in nanoseconds, by the commit's number.
    pub longest_responses_ns: BTreeMap<u64, u64>,
    /// Its subtasks, by number: name and execution times in nanoseconds.
    pub subtasks: Vec<(String, Distribution)>,
}

/// Adds what a guest's runs took to what was seen before.
///
/// # Errors
///
/// In words: a line that is not as `docs/serial-protocol.md` says, or there are no times.
pub fn add(all: &mut Vec<OfDag>, transcript: &Transcript) -> Result<(), String> {
    let before = all.len();
    let mut committed: BTreeMap<u64, (u64, String)> = BTreeMap::new();
    let mut current: Option<usize> = None;
    let mut commit = 0;
    let mut is_told = false;
    for line in &transcript.machine {
        let read = || match line.kind.as_str() {
            "graph" => {
                let hash = line.value.get("hash").and_then(Value::as_u64)?;
                let name = line.text_at("name")?.to_string();
                commit = line.number_at("commit")?;
                committed.insert(line.number_at("dag")?, (hash, name));
                Some(())
            }
            "times_dag" => {
                let (hash, name) = committed.get(&line.number_at("dag")?)?;
                let place = all.iter().position(|dag| dag.hash == *hash);
                let place = place.unwrap_or_else(|| {
                    all.push(OfDag {
                        name: name.clone(),
                        hash: *hash,
                        longest_responses_ns: BTreeMap::new(),
                        subtasks: Vec::new(),
                    });
                    all.len() - 1
                });
                let longest = all[place].longest_responses_ns.entry(commit).or_default();
                *longest = line.number_at("response_time_ns.max")?.max(*longest);
                current = Some(place);
                is_told = true;
                Some(())
            }
            "times_subtask" => {
                let subtasks = &mut all.get_mut(current?)?.subtasks;
                let number = usize::try_from(line.number_at("subtask")?).ok()?;
                if number == subtasks.len() {
                    let name = line.text_at("name")?.to_string();
                    subtasks.push((name, Distribution::default()));
                }
                subtasks.get_mut(number)?.1.add(&execution_times(line)?);
                Some(())
            }
            _ => Some(()),
        };
        let mut read = read;
        read().ok_or_else(|| {
            let (number, kind) = (line.number, &line.kind);
            format!("serial line {number}: a line of kind `{kind}` is malformed or out of place")
        })?;
    }
    match is_told || before < all.len() {
        true => Ok(()),
        false => Err("the guest has run no DAG, or was told to record nothing".into()),
    }
}

/// Reads the execution times of a subtask; their count and maximum follow from the buckets.
fn execution_times(line: &MachineLine) -> Option<Distribution> {
    let buckets = line.value.get("execution_histogram")?.elements().iter();
    let buckets = buckets.map(|bucket| match bucket.elements() {
        [top, count] => Some((top.as_u64()?, count.as_u64()?)),
        _ => None,
    });
    let min_ns = line.number_at("execution_time_ns.min")?;
    let times = Distribution::counted(min_ns, buckets.collect::<Option<_>>()?);
    (line.number_at("execution_time_ns.max")? == times.max()).then_some(times)
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
