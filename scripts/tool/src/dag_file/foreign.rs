//! Reads DAG files in foreign formats, by running `scripts/convert`.
//!
//! The converter writes our format and ends each record with a comment naming the line in the
//! person's file. So a fault found later by our own checks names the right line, too; faults that
//! the converter finds have their lines already. The converter reports left-out parts of a file on
//! standard error.

use std::path::Path;
use std::process::{Command, Stdio};

use fass_dag_file::time::Time;
use fass_dag_file::{DagFile, parse};

use super::ImportSettings;
use crate::files;
use crate::system::workspace;

/// The beginning of the converter's comment with a record's line.
const LINE: &str = " # line ";

/// Converts and reads a file.
///
/// # Errors
///
/// The converter's lines, or the reason why the converter did not run.
pub(super) fn read(path: &Path, import: &ImportSettings) -> Result<DagFile, Vec<String>> {
    let mut convert = Command::new("timeout");
    let limit_s = import.limit_s.to_string();
    // In the foreground, or ctrl-C would not reach the converter.
    convert.args(["--foreground", &limit_s, "python3"]);
    convert.arg(workspace().join("scripts/convert"));
    convert.arg("--lines").stdin(Stdio::null());
    if let Some(unit_ns) = import.unit_ns {
        convert.args(["--unit", &Time(unit_ns).to_string()]);
    }
    if let Some(graph) = &import.graph {
        convert.args(["--graph", graph]);
    }
    // With a folder before the name, no name begins with `-`.
    let output = convert.arg(Path::new(".").join(path)).output();
    let output = output.map_err(|why| vec![format!("`timeout` did not start: {why}")])?;
    let refused = |why: &str| Err(vec![format!("{}: {why}", files::shown_path(path))]);
    match output.status.code() {
        Some(124) => return refused("its conversion took too long; `--timeout` gives it longer"),
        Some(127) => return refused("no `python3`; install Python 3, which reads this format"),
        _ => {}
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let said: Vec<&str> = said.lines().map(without_folder).collect();
    if !output.status.success() {
        return Err(said.into_iter().map(String::from).collect());
    }
    said.iter().for_each(|line| eprintln!("{line}"));
    let text = String::from_utf8_lossy(&output.stdout);
    let mut file = parse(&text).map_err(|fault| {
        let said = format!("`{}`: the converter wrote {fault}", path.display());
        vec![said]
    })?;
    locate(&mut file, &text);
    Ok(file)
}

/// Removes the folder put before the path by [`read`].
fn without_folder(line: &str) -> &str {
    line.strip_prefix("./").unwrap_or(line)
}

/// Sets the line of each part of a file to its line in the person's file.
fn locate(file: &mut DagFile, text: &str) {
    let told = |line: &str| line.rsplit_once(LINE)?.1.parse().ok();
    let lines: Vec<usize> = text.lines().map(|line| told(line).unwrap_or(1)).collect();
    for dag in file.sets.iter_mut().flat_map(|set| &mut set.dags) {
        let subtasks = dag.subtasks.iter_mut().map(|subtask| &mut subtask.line);
        let all = subtasks.chain(&mut dag.edge_lines).chain([&mut dag.line]);
        all.for_each(|line| *line = lines[*line - 1]);
    }
}
