//! What became of a recording or a replay.

use fass::edge::{Drained, Outcome};

use crate::json;

/// Tells how complete a recording is.
pub fn recorded(drained: &Drained) {
    let is_complete = !drained.is_cut && drained.lost == 0;
    json::emit("recorded", |line| {
        line.number("entries", drained.entries)
            .number("lost", drained.lost)
            .flag("complete", is_complete);
    });
}

/// Tells what a replay has found.
pub fn replayed(outcome: &Outcome) {
    let (compared, uncompared) = (outcome.compared, outcome.uncompared);
    crate::println!(
        "replay: {compared} values were compared, {uncompared} recorded ones were not computed"
    );
    if let Some((dag, first)) = &outcome.lacking {
        crate::println!(
            "replay: what functions of dag `{dag}` remember of jobs before {first} is not recorded"
        );
    }
    json::emit("replayed", |line| {
        line.number("compared", outcome.compared)
            .number("uncompared", outcome.uncompared);
        if let Some(divergence) = &outcome.divergence {
            line.text("dag_name", &divergence.dag)
                .text("topic", &divergence.topic)
                .number("job", divergence.job);
            let (recorded, computed) = (&divergence.recorded, &divergence.computed);
            for (name, value) in [("recorded", recorded), ("computed", computed)] {
                if let Some(value) = value {
                    line.text(name, value);
                }
            }
        }
    });
}
