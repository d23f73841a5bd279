//! The contents of a DAG file.
//!
//! The DAGs themselves are specs of `sched-dag`. Next to each stands what only the
//! file knows: the lines, for messages, and the samples of execution times.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::DagSpec;

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
}

/// One DAG.
#[derive(Clone, Debug, Default)]
pub struct FileDag {
    /// The DAG. It has no number of jobs; a [`Length`](crate::Length) decides that.
    pub spec: DagSpec,
    /// The line that begins it, counted from 1.
    pub line: usize,
    /// More about each subtask, in the order of the spec.
    pub subtasks: Vec<FileSubtask>,
    /// The line of each edge, in the order of the spec.
    pub edge_lines: Vec<usize>,
    /// Remarks about the DAG for a reader of the file, a sentence each; comments
    /// in our own format.
    pub remarks: Vec<String>,
}

/// The lines of a file about a subtask, beyond its spec.
#[derive(Clone, Debug, Default)]
pub struct FileSubtask {
    /// The line that states it, counted from 1.
    pub line: usize,
    /// Execution times that were measured, in nanoseconds; mostly none.
    pub samples_ns: Arc<[u64]>,
}

impl DagFile {
    /// Returns the number of subtasks of the set that has most.
    #[must_use]
    pub fn most_subtasks(&self) -> usize {
        let of = |set: &Set| set.dags.iter().map(|dag| dag.subtasks.len()).sum();
        self.sets.iter().map(of).max().unwrap_or(0)
    }
}
