//! The traces of one boot, held against the rules.
//!
//! The guest prints a trace for each run: first those of its warm-up, which are
//! judged as if they belonged to the boot's first round; then comes one a round.

use super::judge::Judged;
use super::plan::Boot;
use crate::outcome::Outcome;
use crate::trace::model::Run;
use crate::trace::{check, read};

/// How many breaches of a round are told in words.
const SHOWN: usize = 5;

/// The runs before the first round, all of the largest set: with trouble on divided cores, too.
fn warm_ups(boot: &Boot<'_>) -> usize {
    if boot.part.has_trouble() { 3 } else { 1 }
}

/// Judges the traces of all rounds that have left one, in which nothing may wait longer
/// than `bound_ns` for what it is owed.
pub(super) fn judge(boot: &Boot<'_>, outcome: &Outcome, bound_ns: u64, judged: &mut Judged) {
    let runs = match read(&outcome.serial) {
        Ok(runs) => runs,
        Err(fault) => {
            judged.fail(boot.first, format!("trace: {fault}"));
            return;
        }
    };
    let warm_ups = warm_ups(boot);
    for round in boot.first..boot.first + boot.rounds {
        let position = usize::try_from(round - boot.first)
            .map_or(usize::MAX, |round| round.saturating_add(warm_ups));
        match runs.get(position) {
            Some(run) => {
                judged.coverage.add_run(run);
                judge_run(run, round, bound_ns, judged);
            }
            None => judged.fail(round, "it has no trace".into()),
        }
    }
    for warm_up in runs.iter().take(warm_ups) {
        judge_run(warm_up, boot.first, bound_ns, judged);
    }
}

fn judge_run(run: &Run, round: u64, bound_ns: u64, judged: &mut Judged) {
    if run.lost > 0 {
        let lost = run.lost;
        judged.fail(round, format!("its trace has lost {lost} events"));
    }
    let findings = check(run, bound_ns);
    judged.figures.add_trace(&findings);
    let breaches = &findings.breaches;
    for breach in breaches.iter().take(SHOWN) {
        judged.fail(round, breach.with_names(&run.task_set).to_string());
    }
    if let Some(more) = breaches.len().checked_sub(SHOWN + 1) {
        judged.fail(round, format!("and {} breaches more", more + 1));
    }
}
