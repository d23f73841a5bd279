//! Locks: what their sections cost others is charged.

use harness::{Guest, Members, Said};

#[test]
fn a_bound_holds_next_to_sections_of_less_urgent_dags_on_every_core() {
    for cores in [1, 2, 4] {
        for words in ["overheads=measured", "overheads=measured preemption=off"] {
            let outcome = Guest::test("locks").cores(cores).word(words).succeed();
            let line = outcome.line("locks");
            println!("{cores} {words}: {}", line.text);
            let [longest_ns, bound_ns] = ["longest_ns", "bound_ns"].map(|name| line.number(name));
            assert!((1..=bound_ns).contains(&longest_ns), "{}", line.text);
            let entered = 200 * (1 + 3 * cores);
            line.has([("entered", entered), ("allocations", 0), ("violations", 0)]);
        }
    }
}
