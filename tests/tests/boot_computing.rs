//! Functions that really compute, in counted time: no core waits long for another's turn,
//! and no function answers for the time in which others compute.

use harness::Guest;
use tool::Outcome;
use tool::protocol::MachineLine;
use tool::trace::{check, read};

/// For how long a core waits for others' turns, and for what the kernel executes meanwhile
/// (`docs/decisions/0021-turns.md`).
const TURN_NS: u64 = 20_000;

fn computing(cores: u64) -> Guest {
    let guest = Guest::new("guest-tests").cores(cores);
    guest.word("test=computing").word("trace=dump")
}

fn line(outcome: &Outcome) -> &MachineLine {
    let line = outcome.transcript.of_kind("computing").next();
    line.unwrap_or_else(|| panic!("no line of kind computing\n{}", outcome.tail()))
}

#[test]
fn a_short_function_beside_those_that_compute_is_served_at_once() {
    for cores in [1, 2, 4, 8] {
        let outcome = computing(cores).word("trace_events=8192").succeed();
        let line = line(&outcome);
        let text = &line.text;
        let number = |name| line.number_at(name).unwrap_or(u64::MAX);
        assert_eq!(number("jobs"), 300, "{text}");
        for none in ["misses", "computing_misses", "wrong", "violations"] {
            assert_eq!(number(none), 0, "{none} in {text}");
        }
        assert_eq!(number("allocations"), 0, "{text}");
        // The wait for the core; a first short turn of each that is released at the same
        // time; and a turn of each if the function is not done in its own first one. Which
        // of these it takes depends on the layout of the code.
        let longest_ns = number("longest_response_ns");
        assert!(longest_ns <= 20_000 + (2_000 + 8_000) * cores, "{text}");
        let runs = read(&outcome.serial).expect("a trace");
        assert_eq!(runs[0].lost, 0);
        assert_eq!(check(&runs[0], TURN_NS).breaches, [], "{cores} cores");
    }
}

#[test]
fn a_budget_that_the_function_alone_would_keep_is_kept_beside_others() {
    for cores in [2, 8] {
        let outcome = computing(cores).word("innocent=yes").succeed();
        assert_eq!(line(&outcome).number_at("computing_misses"), Some(0));
    }
}

#[test]
fn computing_repeats_to_the_byte() {
    let run = || computing(4).succeed().serial;
    assert!(run() == run(), "two runs differ");
}
