//! Locks: what their sections cost others is charged, or there is no bound.

use harness::{Guest, Members, Said};
use tool::Outcome;

fn locks(cores: u64, words: &str) -> Outcome {
    let guest = Guest::test("locks").cores(cores).word("overheads=measured");
    guest.word(words).succeed()
}

#[test]
fn a_bound_holds_next_to_sections_of_less_urgent_dags_on_every_core() {
    for cores in [1, 2, 4] {
        for words in ["longest=310", "longest=310 preemption=off"] {
            let outcome = locks(cores, words);
            let line = outcome.line("locks");
            println!("{cores} {words}: {}", line.text);
            let [longest_ns, bound_ns] = ["longest_ns", "bound_ns"].map(|name| line.number(name));
            assert!((1..=bound_ns).contains(&longest_ns), "{}", line.text);
            let entered = 200 * (1 + 3 * cores);
            line.has([("entered", entered), ("allocations", 0), ("violations", 0)]);
        }
    }
}

#[test]
fn a_lock_without_a_longest_section_leaves_no_bound_to_those_that_share_its_cores() {
    for cores in [1, 2, 4] {
        let outcome = locks(cores, "longest=0 section=800");
        let line = outcome.line("locks");
        line.has([("bound_ns", 0)]);
        let said = "enters lock `registers`, which has no longest section";
        assert!(line.text.contains(said), "{}", line.text);
        assert!(line.number("longest_ns") > 800_000, "{}", line.text);
    }
}

#[test]
fn a_section_that_takes_longer_than_stated_is_said() {
    let outcome = locks(2, "longest=200");
    let lines = outcome.lines("log");
    let said = "a section has taken longer than its lock states, so no bound holds";
    assert!(lines.iter().any(|line| line.member("message") == said));
    assert!(
        lines[0].text.contains(r#""lock":"registers""#),
        "{}",
        lines[0].text
    );
}
