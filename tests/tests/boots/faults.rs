//! Faults have no lasting cost, and everything a run leaves behind has a name.

use harness::{Guest, Members, Said};
use views::protocol::Status;

/// A DAG survives a thousand faults, next to a DAG that must not notice.
#[test]
fn a_thousand_faults_cost_no_more_than_a_hundred() {
    const FAULTS: u64 = 1000;
    for (cores, preemption) in [(1, "on"), (2, "off"), (4, "on"), (8, "off")] {
        let words = format!("trace_events=1000 preemption={preemption} faults={FAULTS}");
        let outcome = Guest::new("faults").cores(cores).word(&words).succeed();
        let lines = outcome.lines("endurance");
        let [few, many] = lines[..] else {
            panic!("not two lines of kind `endurance`\n{}", outcome.tail());
        };
        for (line, faults) in [(few, 100), (many, FAULTS)] {
            line.has(["faults", "restarts", "completed"].map(|member| (member, faults)));
            line.has([
                ("healthy_jobs", 2 * faults),
                ("misses", 0),
                ("violations", 0),
            ]);
        }
        // While the run is held, where the journal's size varies a little, and after it.
        let held = [few, many].map(|line| line.number("held_bytes"));
        assert!(held[0] > 0 && held[1] <= held[0] + 64, "{held:?}");
        for member in ["heap_bytes", "contexts"] {
            assert_eq!(few.number(member), many.number(member), "{member}");
        }
    }
}

/// A device's driver commits each crime; another DAG's questions release the driver's DAG.
#[test]
fn the_faults_of_a_driver_end_its_dag_alone() {
    for (cores, words) in [(1, ""), (2, ""), (4, ""), (2, " clusters=1,1")] {
        let words = format!("by=driver{words}");
        let outcome = Guest::new("faults").cores(cores).word(&words).succeed();
        let (verdicts, faults) = (outcome.lines("containment"), outcome.lines("fault"));
        assert_eq!(
            [verdicts.len(), faults.len()],
            [19; 2],
            "{}",
            outcome.tail()
        );
        for (verdict, fault) in verdicts.iter().zip(&faults) {
            verdict.reads([("verdict", "contained")]);
            fault.reads([("dag_name", "doomed"), ("subtask_name", "process")]);
            fault.has([("job", 10)]);
        }
    }
}

#[test]
fn what_faults_have_left_on_the_heap_is_named() {
    let outcome = Guest::test("left").succeed();
    let line = outcome.only("left");
    line.reads([("dag_name", "careless")]);
    // Three vectors with their headers.
    line.has([("faults", 3), ("heap_bytes", 3 * 1024)]);
}

#[test]
fn what_cannot_be_dropped_after_a_run_ends_in_a_line_that_names_the_dag() {
    let panics = "it cannot be dropped (tests/guest/src/single.rs:";
    for (test, why) in [
        ("drop_panics", panics),
        ("drop_loops", "no return (within 5 s)"),
    ] {
        let outcome = Guest::test(test).end_in(Status::Failure);
        let begins = format!("dag `stubborn` has left behind what cannot be dropped: {why}");
        let lines = outcome.serial.lines();
        let said = lines.filter(|line| line.starts_with(&begins)).count();
        assert_eq!(said, 1, "{}", outcome.tail());
        assert!(!outcome.serial.contains("kernel "), "{}", outcome.tail());
    }
}
