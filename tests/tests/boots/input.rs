//! Bytes from the serial port release a DAG.

use harness::{Guest, Members, Said};
use sched_dag::journal::{Event, EventKind};
use tool::trace;

// A text ends its line: two bytes. The second comes early and is kept. Both come while jobs run:
// before time 0 one of them would be dropped.
#[test]
fn bytes_release_a_dag() {
    let typed = [("\"kind\":\"progress\"", "a")];
    let guest = Guest::test("input").cores(2).word("policy=edf");
    let outcome = guest.typing(&typed).succeed();
    outcome
        .line("input")
        .has([("answers", 2), ("violations", 0)]);
}

#[test]
fn what_comes_before_time_0_releases_nothing_yet() {
    let typed = [("\"kind\":\"listening\"", "a")];
    let guest = Guest::test("input").cores(2).word("later_ms=50 events=on");
    let outcome = guest.typing(&typed).succeed();
    outcome
        .line("input")
        .has([("answers", 1), ("violations", 0)]);
    assert_eq!(outcome.lines("fault").len(), 0);
    let runs = trace::read(&outcome.serial).expect("its events are there");
    let mut events = runs.iter().flat_map(|run| &run.events);
    let is_early = |event: &Event| (event.time_ns, event.what) == (0, EventKind::Signalled);
    assert!(events.any(is_early), "the byte came late");
}
