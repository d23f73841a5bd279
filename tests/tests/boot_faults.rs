//! Faults cost nothing that lasts, and what a run leaves behind has a name.

use harness::Guest;
use tool::protocol::Status;

fn guest(test: &str) -> Guest {
    Guest::new("guest-tests").word(&format!("test={test}"))
}

/// Has one DAG survive a thousand faults, next to one that must not notice.
fn faults_cost_nothing_that_lasts(preemption: &str) {
    const FAULTS: u64 = 1000;
    for cores in [1, 2, 4, 8] {
        let guest = Guest::new("faults").cores(cores).word("trace_events=1000");
        let guest = guest.word(&format!("preemption={preemption}"));
        let outcome = guest.word(&format!("faults={FAULTS}")).succeed();
        let lines: Vec<_> = outcome.transcript.of_kind("endurance").collect();
        let [few, many] = lines[..] else {
            panic!("not two lines of kind `endurance`\n{}", outcome.tail());
        };
        for (line, faults) in [(few, 100), (many, FAULTS)] {
            for member in ["faults", "restarts", "completed"] {
                assert_eq!(line.number_at(member), Some(faults), "{}", line.text);
            }
            assert_eq!(line.number_at("healthy_jobs"), Some(2 * faults));
            assert_eq!(line.number_at("misses"), Some(0), "{}", line.text);
            assert_eq!(line.number_at("violations"), Some(0), "{}", line.text);
        }
        // While the run is held, where the journal's size varies a little, and after it.
        let held = [few, many].map(|line| line.number_at("held_bytes").unwrap_or(0));
        assert!(held[0] > 0 && held[1] <= held[0] + 64, "{held:?}");
        for member in ["heap_bytes", "contexts"] {
            assert_eq!(few.number_at(member), many.number_at(member), "{member}");
        }
    }
}

#[test]
fn a_thousand_faults_cost_no_more_than_a_hundred() {
    faults_cost_nothing_that_lasts("on");
}

#[test]
fn a_thousand_faults_cost_no_more_than_a_hundred_without_preemption() {
    faults_cost_nothing_that_lasts("off");
}

#[test]
fn what_faults_have_left_on_the_heap_is_named() {
    let outcome = guest("left").succeed();
    let lines: Vec<_> = outcome.transcript.of_kind("left").collect();
    let [line] = lines[..] else {
        panic!("not one line of kind `left`\n{}", outcome.tail());
    };
    assert_eq!(line.text_at("dag_name"), Some("careless"));
    assert_eq!(line.number_at("faults"), Some(3));
    // Three vectors with their headers.
    assert_eq!(
        line.number_at("heap_bytes"),
        Some(3 * 1024),
        "{}",
        line.text
    );
}

#[test]
fn what_cannot_be_dropped_after_a_run_ends_in_a_line_that_names_the_dag() {
    for (test, why) in [
        (
            "drop_panics",
            "it cannot be dropped (tests/guest/src/left.rs:",
        ),
        ("drop_loops", "no return (within 5 s)"),
    ] {
        let outcome = guest(test).end_in(Status::Failure);
        let begins = format!("dag `stubborn` has left behind what cannot be dropped: {why}");
        let lines = outcome.serial.lines();
        let said = lines.filter(|line| line.starts_with(&begins)).count();
        assert_eq!(said, 1, "{}", outcome.tail());
        assert!(!outcome.serial.contains("kernel "), "{}", outcome.tail());
    }
}
