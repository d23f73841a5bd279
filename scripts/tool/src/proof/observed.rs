//! What runs were observed to take: per subtask the execution times, per DAG the response
//! times.
//!
//! The times are those that a guest prints with `times=dump`, after the DAGs that it has
//! committed by `graph=dump`. Runs of other boots can be added: DAGs are the same if the
//! hashes of their names and edges are.

use std::collections::BTreeMap;

use crate::json::{Object, Value};
use crate::protocol::{MachineLine, Transcript};

/// Values in buckets; count, minimum and maximum are exact.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// The smallest one.
    pub min: u64,
    /// The largest one.
    pub max: u64,
    /// The largest value of each bucket, and how many it has.
    pub buckets: BTreeMap<u64, u64>,
}

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
    pub subtasks: Vec<(String, Times)>,
}

impl Times {
    /// Returns how many values there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.buckets.values().sum()
    }

    /// Returns a value that at least so many thousandths of the values do not exceed.
    #[must_use]
    pub fn per_mille(&self, thousandths: u64) -> u64 {
        let rank = u128::from(self.count()) * u128::from(thousandths);
        let rank = rank.div_ceil(1000).max(1);
        let mut below = 0;
        let mut buckets = self.buckets.iter();
        let found = buckets.find(|(_, count)| {
            below += u128::from(**count);
            below >= rank
        });
        found.map_or(self.max, |(&top, _)| top.clamp(self.min, self.max))
    }

    fn add(&mut self, other: &Times) {
        self.min = match self.buckets.is_empty() {
            true => other.min,
            false if other.buckets.is_empty() => self.min,
            false => self.min.min(other.min),
        };
        self.max = self.max.max(other.max);
        for (top, count) in &other.buckets {
            *self.buckets.entry(*top).or_default() += count;
        }
    }

    fn read(line: &MachineLine) -> Option<Times> {
        let mut times = Times {
            min: line.number_at("execution_time_ns.min")?,
            max: line.number_at("execution_time_ns.max")?,
            ..Times::default()
        };
        for bucket in line.value.get("execution_histogram")?.elements() {
            let [top, count] = bucket.elements() else {
                return None;
            };
            times.buckets.insert(top.as_u64()?, count.as_u64()?);
        }
        Some(times)
    }
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
                    subtasks.push((name, Times::default()));
                }
                subtasks.get_mut(number)?.1.add(&Times::read(line)?);
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

/// Returns a machine line for each subtask.
pub fn lines(all: &[OfDag]) -> impl Iterator<Item = String> {
    let of_dag = |dag: &OfDag| -> Vec<String> {
        let lines = dag.subtasks.iter().map(|(name, times)| {
            let buckets = times.buckets.iter();
            let buckets = buckets.map(|(top, count)| format!("[{top},{count}]"));
            let times_ns = Object::new()
                .number("count", times.count())
                .number("min", times.min)
                .number("median", times.per_mille(500))
                .number("p99", times.per_mille(990))
                .number("max", times.max)
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
