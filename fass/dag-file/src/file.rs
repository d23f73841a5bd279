//! The contents of a DAG file.
//!
//! The DAGs themselves are specs of `sched-dag`. Next to each stands what only the
//! file knows: the lines, for messages, and the samples of execution times.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{DagSpec, SubtaskSpec};

/// A whole file.
#[derive(Clone, Debug, Default)]
pub struct DagFile {
    /// The sets, at least one.
    pub sets: Vec<Set>,
}

/// DAGs that run together.
#[derive(Clone, Debug, Default)]
pub struct Set {
    /// The set's name; empty if the file names none.
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

/// One DAG.
#[derive(Clone, Debug, Default)]
pub struct FileDag {
    /// The DAG. If it states no number of jobs, a [`Length`](crate::Length) decides that.
    pub spec: DagSpec,
    /// The line that begins it, counted from 1.
    pub line: usize,
    /// More about each subtask, in the order of the spec.
    pub subtasks: Vec<FileSubtask>,
    /// The line of each edge, in the order of the spec.
    pub edge_lines: Vec<usize>,
}

/// The lines of a file about a subtask, beyond its spec.
#[derive(Clone, Debug, Default)]
pub struct FileSubtask {
    /// The line that states it, counted from 1.
    pub line: usize,
    /// Samples that were measured, one after the other, in nanoseconds; mostly none. Each has the
    /// execution time of every segment in turn, and between them how long the waits lasted.
    pub samples_ns: Arc<[u64]>,
}

impl FileDag {
    /// Returns the longest time that an instance of a subtask may execute: its WCET, or that of its
    /// samples.
    pub fn most_ns(&self, subtask: usize) -> u64 {
        let spec = &self.spec.subtasks[subtask];
        let samples = self.subtasks[subtask].samples_ns.chunks(sample_len(spec));
        let longest_ns = || samples.map(executed_ns).max().unwrap_or(0);
        spec.wcet_ns.unwrap_or_else(longest_ns)
    }
}

/// Returns how many times a sample of a subtask has: those of its segments and waits.
pub const fn sample_len(spec: &SubtaskSpec) -> usize {
    2 * spec.waits.len() + 1
}

/// Returns how long an instance executes whose times are those of a sample.
pub fn executed_ns(sample: &[u64]) -> u64 {
    sample
        .iter()
        .step_by(2)
        .fold(0, |sum, &ns| sum.saturating_add(ns))
}

impl DagFile {
    /// Returns the number of subtasks of the set that has most.
    pub fn most_subtasks(&self) -> usize {
        let of = |set: &Set| set.dags.iter().map(|dag| dag.subtasks.len()).sum();
        self.sets.iter().map(of).max().unwrap_or(0)
    }
}
