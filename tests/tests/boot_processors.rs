//! The kernel boots with one processor and with many, on both boards.

use harness::{Guest, Machine};

/// Boots the demo, short, and checks that all processors came up.
fn boots_with(guest: Guest, cores: u64) {
    let guest = guest.cores(cores).word("jobs=4").word("subtasks=2");
    let outcome = guest.succeed();
    let boots: Vec<_> = outcome.transcript.of_kind("boot").collect();
    assert_eq!(boots.len(), 1, "one boot line is due\n{}", outcome.tail());
    assert_eq!(boots[0].number_at("cpus"), Some(cores), "{}", boots[0].text);
    assert_eq!(boots[0].text_at("app"), Some("fork-join"));
}

#[test]
fn one_processor() {
    boots_with(Guest::new("fork-join"), 1);
}

#[test]
fn two_processors() {
    boots_with(Guest::new("fork-join"), 2);
}

#[test]
fn four_processors() {
    boots_with(Guest::new("fork-join"), 4);
}

#[test]
fn eight_processors() {
    boots_with(Guest::new("fork-join"), 8);
}

#[test]
fn sixty_four_processors() {
    boots_with(Guest::new("fork-join").memory_mib(128), 64);
}

#[test]
fn four_processors_on_a_q35() {
    boots_with(Guest::new("fork-join").machine(Machine::Q35), 4);
}

#[test]
fn four_processors_in_real_time() {
    boots_with(Guest::new("fork-join").in_real_time(), 4);
}

#[test]
fn four_processors_in_real_time_on_a_q35() {
    let guest = Guest::new("fork-join").in_real_time();
    boots_with(guest.machine(Machine::Q35), 4);
}
