//! Stacks larger than usual, and the measured use of each.

use harness::{Guest, Members, Said};

#[test]
fn a_stated_stack_is_there_on_any_core_and_its_use_is_measured() {
    for cores in [1, 4] {
        let guest = Guest::test("stacks").cores(cores);
        let outcome = guest.word("measure=stacks").succeed();
        let used = outcome.lines("stack").into_iter().map(|line| {
            line.has([("stack_bytes", 256 << 10)]);
            line.number("used_bytes")
        });
        let used: Vec<u64> = used.collect();
        let [shallow, deep, sink] = used[..] else {
            panic!("three subtasks: {used:?}");
        };
        let array = 100 << 10;
        assert!((array..array + (16 << 10)).contains(&deep), "{used:?}");
        for little in [shallow, sink] {
            assert!((1..8 << 10).contains(&little), "{used:?}");
        }
    }
    // Without the word nothing is measured.
    let outcome = Guest::test("stacks").succeed();
    assert_eq!(outcome.lines("stack").len(), 0);
}

#[test]
fn a_chain_of_ten_thousand_subtasks_takes_a_few_stacks() {
    let guest = Guest::test("stacks_of_chain").cores(2);
    let outcome = guest.memory_mib(128).succeed();
    // One for each job in flight, and two for each core.
    let line = outcome.line("stacks_of_chain");
    line.has([("contexts", 6), ("violations", 0)]);
}
