//! Traces by hand: one good one for each part of the rules, and each breach.
//!
//! A trace is written in the order of time, one event a line: time in ns, word,
//! core as `cN`, and `dag.job` or `dag.job.subtask`. A breach is made by
//! replacing lines of a good trace. Times and bounds are a few nanoseconds.

mod dispatch;
mod lost;
mod malformed;
mod rules;
mod sporadic;

use super::model::Run;
use super::{Findings, check, read};
use sched_dag::journal::Event;
use sched_dag::{CoreId, DagId, SubtaskId};

/// How long one may wait in these traces.
const BOUND_NS: u64 = 5;

/// Makes a run of events in the order of time, under the given header lines.
pub(super) fn run_of(header: &str, events: &str) -> Run {
    let log = format!("{header}\n{{\"kind\":\"trace_end\",\"events\":0,\"lost\":0}}\n");
    let mut run = read(&log).unwrap().remove(0);
    let lines = events.lines().map(str::trim);
    run.events = lines.filter(|line| !line.is_empty()).map(event).collect();
    run
}

fn event(line: &str) -> Event {
    let [time, word, core, of] = line.split(' ').collect::<Vec<_>>()[..] else {
        panic!("`{line}` is no event");
    };
    let of: Vec<u64> = of
        .split('.')
        .map(|number| number.parse().unwrap())
        .collect();
    let small = |number: u64| u32::try_from(number).unwrap();
    Event {
        time_ns: time.parse().unwrap(),
        what: word.parse().unwrap(),
        core: CoreId(core.strip_prefix('c').unwrap().parse().unwrap()),
        dag: DagId(small(of[0])),
        job: of[1],
        subtask: of.get(2).map(|&subtask| SubtaskId(small(subtask))),
    }
}

/// Replaces lines of a trace, each of which must be there once.
fn with(events: &str, changes: &[(&str, &str)]) -> String {
    let mut events = events.to_string();
    for (from, to) in changes {
        assert_eq!(events.matches(from).count(), 1, "{from}");
        events = events.replace(from, to);
    }
    events
}

/// Checks a run and returns its breaches as texts.
fn breaches(run: &Run) -> Vec<String> {
    let Findings { breaches, .. } = check(run, BOUND_NS);
    let texts = breaches
        .iter()
        .map(|breach| breach.with_names(&run.task_set).to_string());
    texts.collect()
}

/// Asserts that a run shows this breach, perhaps among others.
fn assert_shows(run: &Run, breach: &str) {
    let found = breaches(run);
    assert!(
        found.iter().any(|text| text == breach),
        "not `{breach}`, but\n{}",
        found.join("\n")
    );
}
