//! What was proven next to what was observed: a table, machine lines, and a verdict.

use std::fmt::Write;

use sched_dag::DagId;

use super::observed::OfDag;
use super::slack::{self, Slack};
use super::wcets::shown;
use crate::json::Object;
use crate::record::model::Committed;

/// One DAG of one commit.
#[derive(Clone, Debug)]
pub struct Row {
    /// The file that the DAG is from, if there are several.
    file: Option<String>,
    commit: usize,
    dag: String,
    bound_ns: Option<u64>,
    longest_ns: u64,
    slack: Slack,
}

/// Puts the bounds of commits next to the longest responses of their DAGs.
///
/// # Errors
///
/// In words: a DAG was committed and not run.
pub fn rows(commits: &[Committed], observed: &[OfDag]) -> Result<Vec<Row>, String> {
    let mut rows = Vec::new();
    for commit in commits {
        for (number, dag) in (0..).map(DagId).zip(&commit.told.dags) {
            let of_dag = observed.iter().find(|observed| observed.hash == dag.hash);
            let longest_ns = of_dag.and_then(|dag| dag.longest_responses_ns.get(&commit.number));
            let longest_ns = longest_ns.ok_or_else(|| {
                let (name, commit) = (&dag.name, commit.number);
                format!("dag `{name}` of commit {commit} has not run")
            })?;
            rows.push(Row {
                file: None,
                commit: commit.number,
                dag: dag.name.clone(),
                bound_ns: dag.bound_ns,
                longest_ns: *longest_ns,
                slack: slack::of(commit, number),
            });
        }
    }
    Ok(rows)
}

impl Row {
    /// Names the file that the DAG is from.
    #[must_use]
    pub fn of_file(self, name: &str) -> Self {
        Self {
            file: Some(name.into()),
            ..self
        }
    }

    fn name(&self) -> String {
        match &self.file {
            Some(file) => format!("{file}: {}", self.dag),
            None => self.dag.clone(),
        }
    }

    fn exceeds(&self) -> bool {
        self.bound_ns
            .is_some_and(|bound_ns| self.longest_ns > bound_ns)
    }

    /// Returns the longest response in thousandths of the bound.
    fn permille(&self) -> Option<u64> {
        let permille = u128::from(self.longest_ns) * 1000 / u128::from(self.bound_ns?.max(1));
        u64::try_from(permille).ok()
    }

    fn parts(&self) -> [(&'static str, Option<u64>); 5] {
        [
            ("longest_path_ns", self.slack.length_ns),
            ("own_order_ns", self.slack.own_order_ns),
            ("interference_ns", self.slack.interference_ns),
            ("blocking_ns", self.slack.blocking_ns),
            ("overheads_ns", self.slack.overheads_ns),
        ]
    }

    /// Returns the row as a machine line.
    #[must_use]
    pub fn line(&self) -> String {
        let mut line = Object::new().text("kind", "proof");
        if let Some(file) = &self.file {
            line = line.text("file", file);
        }
        line = line
            .number("commit", self.commit as u64)
            .text("dag", &self.dag)
            .number("longest_ns", self.longest_ns);
        let permille = [
            ("bound_ns", self.bound_ns),
            ("tightness_permille", self.permille()),
        ];
        let parts = self.parts();
        for (name, number) in permille.into_iter().chain(parts) {
            if let (Some(number), true) = (number, self.bound_ns.is_some()) {
                line = line.number(name, number);
            }
        }
        line.end()
    }
}

/// Returns the table.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let names = rows.iter().map(|row| row.name().chars().count() + 1);
    let width = names.max().unwrap_or(0).max(20);
    let mut text = format!(
        "\n{:<width$}{:>12}{:>12}{:>9}   where the bound is from:\n{:<width$}{:>12}{:>12}{:>9}",
        "", "", "", "", "dag", "bound", "longest", "ratio"
    );
    // Writing into a `String` cannot fail.
    for name in ["path", "own order", "others", "blocking", "overheads"] {
        let _ = write!(text, "{name:>12}");
    }
    text.push('\n');
    for row in rows {
        let ratio = |permille| format!("{}.{} %", permille / 10, permille % 10);
        let none = || "-".to_string();
        let _ = write!(
            text,
            "{:<width$}{:>12}{:>12}{:>9}",
            row.name(),
            row.bound_ns.map_or("not proven".into(), shown),
            shown(row.longest_ns),
            row.permille().map_or_else(none, ratio)
        );
        for (_, part) in row.parts().into_iter().filter(|_| row.bound_ns.is_some()) {
            let _ = write!(text, "{:>12}", part.map_or_else(none, shown));
        }
        text.push('\n');
    }
    text
}

/// Returns how many DAGs are proven, and how many responses were above their bounds.
#[must_use]
pub fn summary(rows: &[Row]) -> String {
    let proven = rows.iter().filter(|row| row.bound_ns.is_some()).count();
    let above = rows.iter().filter(|row| row.exceeds()).count();
    let dags = rows.len();
    format!("{proven} of {dags} DAGs proven, {above} responses above a bound")
}

/// Returns what makes the proof worthless, if anything does: a response above its bound.
#[must_use]
pub fn complaint(rows: &[Row]) -> Option<String> {
    let row = rows.iter().find(|row| row.exceeds())?;
    Some(format!(
        "dag `{}` of commit {} took {}, beyond its bound of {}; a WCET or an overhead is too small",
        row.name(),
        row.commit,
        shown(row.longest_ns),
        shown(row.bound_ns?)
    ))
}
