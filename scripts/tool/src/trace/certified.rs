//! The answer whether a run is certified, and by which theorems its bounds hold.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};

use sched_dag::analysis;
use views::certification::certify;
use views::findings::Findings;
use views::record::{Committed, Run};

use crate::{files, system};

/// Returns the answer in words, and the word of the condition that failed, empty if none did.
pub(super) fn told(run: &Run, findings: &Findings, asks_theorems: bool) -> (String, &'static str) {
    let theorems = certify(run, findings).and_then(|()| match asks_theorems {
        true => theorems(&run.commit).map_err(|why| ("witness", why)),
        false => Ok("by its witness; --proven asks for theorems".into()),
    });
    let count = run.bounds_ns.iter().flatten().count();
    match theorems {
        Ok(theorems) => {
            let held = "no rule broken, no WCET exceeded, no more lost than charged";
            let so = format!("so each of {count} bounds held, {theorems}");
            (format!("  certified: {held}; {so}\n"), "")
        }
        Err((condition, why)) => (format!("  not certified, {condition}: {why}\n"), condition),
    }
}

/// Asks the proven checker by which theorems the bounds of a commit hold.
fn theorems(commit: &Committed) -> Result<String, String> {
    let path = system::new_log("witness")?;
    let witness = analysis::witness(&commit.task_set, &commit.settings());
    files::write_named("witness", &path, witness)?;
    let mut command = Command::new(system::workspace().join("scripts/check-witness"));
    command.arg("--proven").arg(&path).stderr(Stdio::inherit());
    let said = command
        .output()
        .map_err(|error| format!("check-witness: {error}"))?;
    let said = String::from_utf8_lossy(&said.stdout);
    let answers = said
        .lines()
        .filter_map(|line| match line.split_once(" proven by machine") {
            Some((dag, _)) if dag.ends_with(" not") => Some("hand"),
            Some((_, by)) => by.strip_prefix(", by "),
            None => None,
        });
    let mut by_theorem: BTreeMap<&str, usize> = BTreeMap::new();
    answers.for_each(|theorem| *by_theorem.entry(theorem).or_default() += 1);
    let by = by_theorem
        .iter()
        .map(|(name, count)| format!("{count} by {name}"));
    match by.collect::<Vec<_>>().join(", ") {
        none if none.is_empty() && said.contains(": refused: ") => Err(said.trim().into()),
        none if none.is_empty() => Ok("by its witness; the proven checker says nothing".into()),
        by => Ok(by),
    }
}
