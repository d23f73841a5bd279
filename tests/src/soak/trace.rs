//! The traces of one boot, held against the rules.
//!
//! The guest prints a trace for each run: the first is its warm-up, then comes
//! one a round.

use super::judge::Judged;
use super::plan::Boot;
use crate::outcome::Outcome;
use crate::protocol::MachineLine;

/// Judges the traces of all rounds that have left one.
pub(super) fn judge(boot: &Boot<'_>, outcome: &Outcome, judged: &mut Judged) {
    let ends: Vec<&MachineLine> = outcome.transcript.of_kind("trace_end").collect();
    for round in boot.first..boot.first + boot.rounds {
        let position = usize::try_from(round - boot.first + 1).unwrap_or(usize::MAX);
        let Some(end) = ends.get(position) else {
            judged.fail(round, "it has no trace".into());
            continue;
        };
        judged.figures.events += end.number_at("events").unwrap_or(0);
        match end.number_at("lost") {
            Some(0) => {}
            lost => judged.fail(round, format!("its trace has lost {lost:?} events")),
        }
    }
}
