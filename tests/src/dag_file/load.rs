//! Reading a file of any of the formats.

use std::fs;
use std::path::Path;

use dag_file::{DagFile, Length, Malformed, check, parse};
use sched_dag::Policy;

use super::{rd_gen, stg};

/// How a file is read.
#[derive(Clone, Debug)]
pub struct Import {
    /// The length of a unit, for formats whose numbers have none.
    pub unit_ns: u64,
    /// The one graph wanted of a set of task graphs.
    pub graph: Option<String>,
    /// The number of cores that it will run on.
    pub cores: u32,
    /// For how long it will run.
    pub length: Length,
}

/// Reads a file: RD-Gen's YAML if its name ends in `.yaml` or `.yml`, a set of
/// task graphs if in `.json`, otherwise our own format. It is then checked as its
/// commit will be.
///
/// # Errors
///
/// Lines for people, each beginning with the file and mostly the line.
pub fn load(path: &Path, import: &Import) -> Result<DagFile, Vec<String>> {
    let place = path.display();
    let located = |faults: Vec<Malformed>| -> Vec<String> {
        let located = faults.into_iter();
        located
            .map(|Malformed { line, reason }| format!("{place}:{line}: {reason}"))
            .collect()
    };
    let bytes = fs::read(path).map_err(|error| {
        vec![format!(
            "{place}: cannot be read: {error}; name another file"
        )]
    })?;
    let text = str::from_utf8(&bytes).map_err(|error| {
        let before = bytes[..error.valid_up_to()].iter();
        let line = 1 + before.filter(|byte| **byte == b'\n').count();
        vec![format!(
            "{place}:{line}: this is not UTF-8 text; is it a DAG file?"
        )]
    })?;
    let extension = path.extension().and_then(|extension| extension.to_str());
    let file = match extension {
        Some("yaml" | "yml") => {
            let stem = path.file_stem().map(|stem| stem.to_string_lossy());
            let name = stem.unwrap_or_default().replace(char::is_whitespace, "_");
            rd_gen::read(text, &name, import.unit_ns)
        }
        Some("json") => {
            stg::read(text, import.graph.as_deref(), import.unit_ns).map_err(|one| vec![one])
        }
        _ => parse(text).map_err(|one| vec![one]),
    };
    let file = file.map_err(located)?;
    if extension != Some("json")
        && let Some(graph) = &import.graph
    {
        return Err(vec![format!(
            "{place}: `--graph {graph}` is for a set of task graphs in JSON; leave it out"
        )]);
    }
    for set in &file.sets {
        // Static priorities ask for all that EDF does, and more.
        check(set, Policy::StaticPriority, import.cores, import.length).map_err(located)?;
    }
    Ok(file)
}
