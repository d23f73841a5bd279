//! The demo on the bare machine: every join happens, once, after all of its
//! predecessors; nothing allocates while jobs run; and a deterministic run is
//! the same run every time.

use harness::{Guest, Members, Said, lawful_runs};
use tool::Outcome;
use views::record::COUNTED_TOLERANCE_NS;

fn demo(cores: u64, words: &str) -> Guest {
    Guest::new("fork-join").cores(cores).word(words)
}

/// Checks the demo's lines: one for each N, all jobs joined, no violation.
#[track_caller]
fn joins_are_right(outcome: &Outcome, jobs: u64, expected: &[u64]) {
    let lines = outcome.lines("fork_join");
    let subtasks: Vec<u64> = lines.iter().map(|line| line.number("subtasks")).collect();
    assert_eq!(subtasks, expected, "{}", outcome.tail());
    for line in lines {
        let text = &line.text;
        line.has([("violations", 0), ("jobs", jobs), ("joins", jobs)]);
        line.has([("allocations", 0)]);
        for distribution in ["join_latency_ns", "response_time_ns", "release_jitter_ns"] {
            let ascending = ["min", "median", "p99", "max"];
            let ascending = ascending.map(|of| line.number(&format!("{distribution}.{of}")));
            assert!(ascending.is_sorted(), "{distribution} in {text}");
        }
        // An instance executes for at least 1 ms, so no response is shorter.
        assert!(line.number("response_time_ns.min") >= 1_000_000, "{text}");
    }
    let memory = outcome.lines("memory").pop().expect("the kernel says it");
    let peak = memory.number("heap_peak_bytes");
    assert!(0 < peak && peak <= memory.number("heap_bytes"));
}

#[test]
fn every_job_joins() {
    for (cores, words, jobs, subtasks) in [
        (8, "jobs=60 policy=edf", 60, &[2, 4, 6][..]),
        (1, "jobs=60 subtasks=2", 60, &[2]),
        // Few jobs: here every nanosecond of execution is an instruction to emulate.
        (4, "jobs=12 subtasks=2 occupy=spin", 12, &[2]),
    ] {
        joins_are_right(&demo(cores, words).succeed(), jobs, subtasks);
    }
    let guest = demo(8, "jobs=60 subtasks=4").in_real_time();
    joins_are_right(&guest.succeed(), 60, &[4]);
}

#[test]
fn every_job_joins_while_its_subtasks_compute() {
    // Some 300 million instructions each: all cores compute in one clock.
    for cores in [1, 2, 4, 8] {
        let words = "jobs=6 subtasks=2 work=compute events=on";
        let outcome = demo(cores, words).succeed();
        joins_are_right(&outcome, 6, &[2]);
        assert_eq!(lawful_runs(&outcome, COUNTED_TOLERANCE_NS)[0].lost, 0);
    }
}

#[test]
fn two_deterministic_runs_print_the_same_bytes_and_another_seed_is_another_run() {
    let run = || demo(8, "jobs=60 seed=7").succeed();
    let (first, second) = (run(), run());
    let mut lines = first.serial.lines().zip(second.serial.lines());
    assert_eq!(lines.find(|(a, b)| a != b), None);
    assert_eq!(first.serial.len(), second.serial.len());
    joins_are_right(&first, 60, &[2, 4, 6]);
    // From the kernel's entry.
    let first_ns = first.line("fork_join").number("first_release_ns");
    assert!(first_ns <= 100_000_000, "{first_ns}");
    let other = demo(8, "jobs=60 seed=8").succeed();
    let responses = |of: &Outcome| of.line("fork_join").value.get("response_time_ns").cloned();
    assert_ne!(responses(&first), responses(&other));
}

/// The tests of the kernel's options have other faults of words.
#[test]
fn how_a_computation_occupies_a_core_is_not_said() {
    let reason = demo(1, "work=compute occupy=spin").refusal();
    assert!(reason.starts_with("`occupy` says how"), "{reason}");
}
