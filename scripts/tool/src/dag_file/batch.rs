//! A folder of DAG files, one boot each, in one table.
//!
//! `./scripts/run --dag FOLDER` takes every file of it whose name ends in `.dag`,
//! `.yaml` or `.yml`, in the order of their names. One that is refused, or fails,
//! does not keep the others from being run.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use super::load::Format;
use crate::json::quoted;
use crate::options::Parsed;
use crate::outcome::Outcome;

/// Returns the folder that `--dag` names, if it is one.
#[must_use]
pub fn folder(options: &Parsed) -> Option<PathBuf> {
    let path = options.path("dag")?;
    path.is_dir().then(|| path.to_path_buf())
}

/// Returns the DAG files of a folder.
///
/// # Errors
///
/// In words: it cannot be read, or has none.
pub fn files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let place = folder.display();
    let entries = fs::read_dir(folder).map_err(|error| format!("{place}: {error}"))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| matches!(Format::of(path), Some(Format::Ours | Format::RdGen)));
    if files.is_empty() {
        return Err(format!(
            "{place}: the folder has no file .dag, .yaml or .yml; name another"
        ));
    }
    files.sort();
    Ok(files)
}

/// The heading of the table.
#[must_use]
pub fn heading() -> String {
    format!(
        "{:<18}{:<18}{:>8}{:>6}{:>6}{:>8}{:>11}{:>14}{:>14}{:>10}",
        "file",
        "dag",
        "subtasks",
        "cores",
        "jobs",
        "misses",
        "violations",
        "bound ms",
        "max ms",
        "max/bound"
    )
}

/// The rows of a file: one for each of its DAGs.
#[must_use]
pub fn rows(file: &Path, cores: u64, outcome: &Outcome) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let violations: u64 = outcome
        .transcript
        .of_kind("dag_set")
        .filter_map(|line| line.number_at("violations"))
        .sum();
    let mut text = String::new();
    for line in outcome.transcript.of_kind("dag_run") {
        let number = |name: &str| line.number_at(name).unwrap_or(0);
        let milliseconds = |ns: Option<u64>| ns.map_or("-".into(), decimal);
        // Writing into a `String` cannot fail.
        let _ = writeln!(
            text,
            "{name:<18}{:<18}{:>8}{cores:>6}{:>6}{:>8}{violations:>11}{:>14}{:>14}{:>10}",
            line.text_at("dag").unwrap_or("?"),
            number("subtasks"),
            number("completed"),
            number("deadline_misses"),
            milliseconds(line.number_at("bound_ns")),
            milliseconds(line.number_at("response_time_ns.max")),
            line.number_at("tightness_permille")
                .map_or("-".into(), |permille| format!(
                    "{}.{} %",
                    permille / 10,
                    permille % 10
                )),
        );
    }
    text
}

/// Writes nanoseconds as milliseconds with three places.
fn decimal(ns: u64) -> String {
    let us = ns / 1000;
    format!("{}.{:03}", us / 1000, us % 1000)
}

/// The machine lines of a file's DAGs, each with a member that names the file.
pub fn lines<'o>(file: &Path, outcome: &'o Outcome) -> impl Iterator<Item = String> + use<'o> {
    const BEGINNING: &str = "{\"kind\":\"dag_run\",";
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let name = quoted(&name);
    outcome.serial.lines().filter_map(move |line| {
        let rest = line.strip_prefix(BEGINNING)?;
        Some(format!("{BEGINNING}\"file\":{name},{rest}"))
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::lines;
    use crate::json::{self, Value};
    use crate::outcome::Outcome;
    use crate::qemu::Ending;

    #[test]
    fn any_name_of_a_file_is_one_member_of_a_machine_line() {
        let serial = "{\"kind\":\"dag_run\",\"dag\":\"x\"}\n";
        let place = Path::new("the log");
        let outcome = Outcome::of(Ending::Signal, serial.into(), place, place);
        for name in ["a.dag", "a\nb.dag", "\"\\.dag", "\u{1b}.dag"] {
            let all: Vec<String> = lines(Path::new(name), &outcome).collect();
            assert_eq!(all.concat().lines().count(), 1, "{all:?}");
            let line = json::parse(&all[0]).expect("JSON");
            assert_eq!(line.get("file").and_then(Value::as_text), Some(name));
        }
    }
}
