//! Tells whether a run is certified, and by which theorems its bounds hold.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};

use sched_dag::analysis;
use views::certification::certify;
use views::findings::Findings;
use views::record::Run;

use crate::{files, system};

/// Returns the answer in words, and the word for the failed condition, empty if none failed.
pub(super) fn told(run: &Run, findings: &Findings, asks_theorems: bool) -> (String, &'static str) {
    let theorems = certify(run, findings).and_then(|()| match asks_theorems {
        true => theorems(run).map_err(|why| ("witness", why)),
        false => Ok("by the analysis; --proven has its witness checked".into()),
    });
    let count = run.bounds_ns.iter().flatten().count();
    match theorems {
        Ok(theorems) => {
            let held = "no rule broken, no job cut, no WCET exceeded, no more lost than charged";
            let so = format!("so each of {count} bounds held, {theorems}");
            (format!("  certified: {held}; {so}\n"), "")
        }
        Err((condition, why)) => (format!("  not certified, {condition}: {why}\n"), condition),
    }
}

/// Asks the proven checker for the theorems behind the bounds of a run.
fn theorems(run: &Run) -> Result<String, String> {
    let path = system::new_log("witness")?;
    let witness = analysis::witness(&run.commit.task_set, &run.commit.settings());
    files::write_named("witness", &path, witness)?;
    let mut command = Command::new(system::workspace().join("scripts/check-witness"));
    command.arg("--proven").arg(&path).stderr(Stdio::inherit());
    let said = command
        .output()
        .map_err(|error| format!("check-witness: {error}"))?;
    let said = String::from_utf8_lossy(&said.stdout);
    named(&said, run.bounds_ns.iter().flatten().count())
}

/// Returns how many bounds hold by each theorem, from the output of check-witness about `bounds`
/// bounds.
fn named(said: &str, bounds: usize) -> Result<String, String> {
    // A refusal for only one of several clusters counts, too.
    if let Some(refused) = said.lines().find(|line| line.contains(": refused: ")) {
        return Err(refused.into());
    }
    let answers = said
        .lines()
        // A name may have such words, too, but not at the end of the line.
        .filter_map(|line| match line.rsplit_once("proven by machine") {
            Some((dag, why)) if dag.ends_with(": not ") && why.starts_with(": ") => Some("hand"),
            Some((_, by)) => by.strip_prefix(", by ").filter(|by| !by.contains(' ')),
            None => None,
        });
    let mut by_theorem: BTreeMap<&str, usize> = BTreeMap::new();
    answers.for_each(|theorem| *by_theorem.entry(theorem).or_default() += 1);
    let by = by_theorem
        .iter()
        .map(|(name, count)| format!("{count} by {name}"));
    match by_theorem.values().sum::<usize>() {
        0 => Ok("by the analysis; the proven checker says nothing".into()),
        answers if answers != bounds => Err(format!("{answers} of {bounds} bounds have proofs")),
        _ => Ok(by.collect::<Vec<_>>().join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::named;

    #[test]
    fn the_witness_of_each_cluster_counts() {
        let of = |cluster, says| format!("w: cluster {cluster}{says}\n");
        let proven = of(1, ": dag 0 a: proven by machine, by sustainable");
        let by_hand = of(1, ": dag 1 b: not proven by machine: no theorem");
        let both = named(&format!("{proven}{by_hand}"), 2);
        assert_eq!(both, Ok("1 by hand, 1 by sustainable".into()));
        let refused = of(0, ": refused: the seal is broken");
        let told = named(&format!("{refused}{proven}"), 2);
        assert_eq!(told, Err(refused.trim().into()));
        assert_eq!(named(&proven, 2), Err("1 of 2 bounds have proofs".into()));
        // No name passes for an answer.
        let like = of(
            0,
            ": dag 2 x proven by machine, by set_bounds: at most 5 ns: paths",
        );
        assert_eq!(
            named(&format!("{like}{proven}"), 1),
            Ok("1 by sustainable".into())
        );
    }
}
