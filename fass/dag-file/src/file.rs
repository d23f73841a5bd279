//! The contents of a DAG file.
//!
//! The DAGs themselves are specs of `sched-dag`. Beside each spec are data found only in the file:
//! line numbers, for messages, and samples of execution times.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{DagSpec, SubtaskSpec};

/// The contents of a whole DAG file.
#[derive(Clone, Debug, Default)]
pub struct DagFile {
    /// The sets, at least one.
    pub sets: Vec<Set>,
}

/// DAGs running together.
#[derive(Clone, Debug, Default)]
pub struct Set {
    /// The set's name; empty if the file gives no name.
    pub name: String,
    /// The DAGs, at least one.
    pub dags: Vec<FileDag>,
    /// The lists of cores, each with its line.
    pub lists: Vec<(usize, String)>,
    /// The certificate, a line each; empty if there is none.
    pub certificate: String,
}

impl Set {
    /// Returns the lists of cores.
    pub fn core_lists(&self) -> Vec<&str> {
        self.lists.iter().map(|(_, list)| list.as_str()).collect()
    }
}

/// One DAG of a set.
#[derive(Clone, Debug, Default)]
pub struct FileDag {
    /// The DAG. If the spec has no number of jobs, a [`Length`](crate::Length) decides the number.
    pub spec: DagSpec,
    /// The DAG's first line, counted from 1.
    pub line: usize,
    /// More about each subtask, in the order of the spec.
    pub subtasks: Vec<FileSubtask>,
    /// The line of each edge, in the order of the spec.
    pub edge_lines: Vec<usize>,
}

/// The file's data on a subtask, beyond its spec.
#[derive(Clone, Debug, Default)]
pub struct FileSubtask {
    /// The line of the subtask, counted from 1.
    pub line: usize,
    /// Measured samples, one after the other, in nanoseconds; usually none. Each sample has the
    /// execution time of every segment in turn, with the durations of the waits between them.
    pub samples_ns: Arc<[u64]>,
}

impl FileDag {
    /// Returns the longest possible execution time of a subtask's instance: the WCET, or, without a
    /// WCET, the longest sample.
    pub fn most_ns(&self, subtask: usize) -> u64 {
        let spec = &self.spec.subtasks[subtask];
        let samples = self.subtasks[subtask].samples_ns.chunks(sample_len(spec));
        let longest_ns = || samples.map(executed_ns).max().unwrap_or(0);
        spec.wcet_ns.unwrap_or_else(longest_ns)
    }
}

/// Returns the number of times in a sample of a subtask: one for each segment and each wait.
pub const fn sample_len(spec: &SubtaskSpec) -> usize {
    2 * spec.waits.len() + 1
}

/// Returns the execution time of an instance with the times of a sample.
pub fn executed_ns(sample: &[u64]) -> u64 {
    sample
        .iter()
        .step_by(2)
        .fold(0, |sum, &ns| sum.saturating_add(ns))
}

impl DagFile {
    /// Returns the number of subtasks of the largest set.
    pub fn most_subtasks(&self) -> usize {
        let of = |set: &Set| set.dags.iter().map(|dag| dag.subtasks.len()).sum();
        self.sets.iter().map(of).max().unwrap_or(0)
    }
}
