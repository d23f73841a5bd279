//! Stacks that are larger than usual, and what of each is used.

use harness::Guest;

fn guest(test: &str) -> Guest {
    Guest::new("guest-tests").word(&format!("test={test}"))
}

#[test]
fn a_stated_stack_is_there_on_any_core_and_its_use_is_measured() {
    for cores in [1, 2, 4] {
        let outcome = guest("stacks")
            .cores(cores)
            .word("measure=stacks")
            .succeed();
        let lines = outcome.transcript.of_kind("stack");
        let used: Vec<u64> = lines
            .map(|line| {
                assert_eq!(line.number_at("stack_bytes"), Some(256 << 10));
                line.number_at("used_bytes").expect("a number")
            })
            .collect();
        let [shallow, deep, sink] = used[..] else {
            panic!("three subtasks: {used:?}");
        };
        let array = 100 << 10;
        assert!((array..array + (16 << 10)).contains(&deep), "{used:?}");
        for little in [shallow, sink] {
            assert!((1..8 << 10).contains(&little), "{used:?}");
        }
    }
}

#[test]
fn without_the_word_nothing_is_measured() {
    let outcome = guest("stacks").succeed();
    assert_eq!(outcome.transcript.of_kind("stack").count(), 0);
}

#[test]
fn a_chain_of_ten_thousand_subtasks_takes_a_few_stacks() {
    let outcome = guest("stacks_of_chain").cores(2).memory_mib(128).succeed();
    let line = outcome.transcript.of_kind("chain").next().expect("a line");
    // One for each job in flight, and two for each core.
    assert_eq!(line.number_at("contexts"), Some(6), "{}", line.text);
    assert_eq!(line.number_at("violations"), Some(0), "{}", line.text);
}
