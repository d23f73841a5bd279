//! Instances that wait: on one core and on several, undivided and in clusters, and where a fault or
//! an end comes after a wait, or in it.

use std::fmt::Write;

use harness::{Guest, Members, Said, lawful_runs};
use sched_dag::journal::EventKind;
use tool::Outcome;
use tool::record::Run;
use tool::record::bound::COUNTED_NS;

/// Returns the events of a run's instances, in the order of the journal: a line for each instance,
/// with the times since the run's start in tenths of a millisecond.
fn told(run: &Run) -> String {
    let mut text = String::new();
    for event in &run.events {
        let Some(instance) = event.instance() else {
            continue;
        };
        let word = event.what.word();
        let _ = writeln!(text, "{} {word} c{} {instance:?}", event.time_ns, event.core.0);
    }
    text
}

#[test]
fn dump() {
    for (test, cores, clusters) in [("waits", 1, ""), ("waits", 4, ""), ("waits", 2, "clusters=1,1"), ("waits_faults", 1, "")] {
        let guest = Guest::test(test).cores(cores).word("events=on").word(clusters);
        let outcome = guest.succeed();
        for run in lawful_runs(&outcome, COUNTED_NS) {
            println!("=== {test} {cores} {clusters}\n{}", told(&run));
        }
    }
}
