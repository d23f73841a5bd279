//! The tests of `fass/linux` on Debian's Linux in QEMU, which has `sched_ext`.

use std::path::Path;
use std::time::Duration;

use tool::debian::{Guest, GuestOrder};
use tool::qemu::Mode;
use tool::{image, program, system};

/// The most time for a guest; Linux starts in half of this time.
const LIMIT: Duration = Duration::from_secs(300);

/// Runs a program's tests with `only` in their names in the guest, with our policy, and returns the
/// output.
fn run(test: &Path, only: &str) -> String {
    let log = system::new_log("debian-tests").expect("a folder for logs");
    let order = GuestOrder {
        program: test,
        words: &["--test-threads=1".into(), "--nocapture".into(), only.into()],
        with_policy: true,
        busy: 0,
        mode: Mode::Deterministic,
        cores: 4,
    };
    let guest = Guest::new(&order, &log).expect("Debian's packages are had");
    let order = program::ProgramOrder {
        program: &guest.program,
        words: &guest.words,
        is_live: false,
        stops: false,
        log: &log,
        limit: LIMIT,
    };
    let mut said = String::new();
    let mut keep = |line: &str| said.extend([line, "\n"]);
    let outcome = program::run_for(&order, &mut keep, |_| guest.code());
    outcome.unwrap_or_else(|why| panic!("{why}; {}", guest.said()));
    assert_eq!(guest.code(), Some(0), "{said}\n{}", guest.said());
    said
}

#[test]
#[ignore = "fetches 145 MB of Debian's; `cargo test -p harness --test boots -- --ignored` runs it"]
fn the_tests_of_linux_pass_by_sched_ext_too() {
    let program = image::build_target("linux", "linux", ["--test", "it"], None);
    let program = program.expect("it is built");
    // The policy goes with the first program that takes it, so each recording has its guest.
    for (only, passed) in [
        ("lives::", 7),
        ("mechanism_records", 1),
        ("mechanism_replays", 1),
        ("wires::", 2),
    ] {
        let said = run(&program, only);
        assert!(said.contains("by SchedExt"), "{said}");
        assert!(said.contains(&format!("ok. {passed} passed")), "{said}");
    }
}
