//! Judging one boot by the guest's own checks.
//!
//! A round passes if the guest says so, in its line of kind `soak`, and if `trace` finds
//! no fault with its trace. A round that left no line has failed: a boot that ends early
//! fails for all rounds that are missing.

use std::collections::BTreeMap;

use super::coverage::Coverage;
use super::figures::Figures;
use super::plan::Boot;
use crate::outcome::Outcome;
use crate::protocol::MachineLine;

/// What became of the rounds of one boot.
#[derive(Clone, Debug, Default)]
pub(super) struct Judged {
    /// The figures of the rounds that left any.
    pub(super) figures: Figures,
    /// What happened to their DAGs.
    pub(super) coverage: Coverage,
    /// What is wrong, by round.
    pub(super) failures: BTreeMap<u64, Vec<String>>,
}

impl Judged {
    /// Notes something that is wrong with a round.
    pub(super) fn fail(&mut self, round: u64, reason: String) {
        self.failures.entry(round).or_default().push(reason);
    }
}

/// Judges a boot by its lines and its end.
pub(super) fn judge(boot: &Boot<'_>, outcome: &Outcome) -> Judged {
    let mut judged = Judged::default();
    let mut rounds = boot.first..boot.first + boot.rounds;
    for line in outcome.transcript.of_kind("soak") {
        let round = line.number_at("round");
        if round != rounds.next() {
            let text = &line.text;
            judged.fail(boot.first, format!("a line that was not expected: {text}"));
        }
        let round = round.unwrap_or(boot.first);
        judged.figures.add_line(line);
        for reason in complaints(boot, line) {
            judged.fail(round, reason);
        }
    }
    let ending = outcome.judge().err().map(|fault| fault.reason);
    for round in rounds {
        let why = ending.as_deref().unwrap_or("without a reason");
        judged.fail(round, format!("did not run to its end: {why}"));
    }
    if let Some(reason) = ending.filter(|_| judged.failures.is_empty()) {
        judged.fail(boot.first, reason);
    }
    judged
}

/// Returns what a round's line says against it.
fn complaints(boot: &Boot<'_>, line: &MachineLine) -> Vec<String> {
    let mut found: Vec<String> = line
        .text_at("complaint")
        .map(String::from)
        .into_iter()
        .collect();
    let number = |name| line.number_at(name);
    for name in ["violations", "allocations"] {
        if number(name) != Some(0) {
            found.push(format!("`{name}` is not 0"));
        }
    }
    if number("contexts") != number("contexts_free") {
        found.push("not all contexts are free".into());
    }
    for (name, wanted) in [("policy", boot.part.policy), ("overrun", boot.part.overrun)] {
        if line.text_at(name) != Some(wanted) {
            found.push(format!("`{name}` is not `{wanted}`"));
        }
    }
    if number("load") != Some(boot.part.load) {
        found.push(format!("`load` is not {}", boot.part.load));
    }
    found
}
