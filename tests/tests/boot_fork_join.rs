//! The demo on the bare machine: every join happens, once, after all of its
//! predecessors; nothing allocates while jobs run; and a deterministic run is
//! the same run every time.

use std::path::Path;

use harness::Guest;
use tool::protocol::{MachineLine, Status};
use tool::trace::{bound, check, read};
use tool::{Outcome, system};

const JOBS: u64 = 60;

fn demo() -> Guest {
    demo_of(JOBS)
}

fn demo_of(jobs: u64) -> Guest {
    let guest = Guest::new("fork-join").cores(8);
    guest.word(&format!("jobs={jobs}"))
}

/// Checks the demo's lines: one for each N, all jobs joined, no violation.
fn joins_are_right(outcome: &Outcome, jobs: u64, expected: &[u64]) {
    let lines: Vec<&MachineLine> = outcome.transcript.of_kind("fork_join").collect();
    let subtasks: Vec<_> = lines
        .iter()
        .filter_map(|line| line.number_at("subtasks"))
        .collect();
    assert_eq!(subtasks, expected, "{}", outcome.tail());
    for line in lines {
        let text = &line.text;
        assert_eq!(line.number_at("violations"), Some(0), "{text}");
        assert_eq!(line.number_at("jobs"), Some(jobs), "{text}");
        assert_eq!(line.number_at("joins"), Some(jobs), "{text}");
        for distribution in ["join_latency_ns", "response_time_ns", "release_jitter_ns"] {
            let ascending: Vec<_> = ["min", "median", "p99", "max"]
                .iter()
                .filter_map(|of| line.number_at(&format!("{distribution}.{of}")))
                .collect();
            assert_eq!(ascending.len(), 4, "{distribution} in {text}");
            assert!(ascending.is_sorted(), "{distribution} in {text}");
        }
        // An instance executes for at least 1 ms, so no response is shorter.
        let shortest = line.number_at("response_time_ns.min");
        assert!(shortest >= Some(1_000_000), "{text}");
    }
}

#[test]
fn every_job_joins_with_two_four_and_six_subtasks() {
    joins_are_right(&demo().succeed(), JOBS, &[2, 4, 6]);
}

#[test]
fn every_job_joins_by_earliest_deadline_first() {
    joins_are_right(&demo().word("policy=edf").succeed(), JOBS, &[2, 4, 6]);
}

#[test]
fn every_job_joins_on_one_processor() {
    let outcome = demo().cores(1).word("subtasks=2").succeed();
    joins_are_right(&outcome, JOBS, &[2]);
}

#[test]
fn every_job_joins_in_real_time() {
    let guest = demo().in_real_time().word("subtasks=4");
    joins_are_right(&guest.succeed(), JOBS, &[4]);
}

#[test]
fn every_job_joins_while_its_subtasks_spin() {
    // Few jobs: here every nanosecond of execution is an instruction to emulate.
    let guest = demo_of(12).cores(4).word("occupy=spin").word("subtasks=2");
    joins_are_right(&guest.succeed(), 12, &[2]);
}

#[test]
fn every_job_joins_while_its_subtasks_compute() {
    // Some 300 million instructions each: all cores compute in one clock.
    const FEW: u64 = 6;
    for cores in [1, 2, 4, 8] {
        let guest = demo_of(FEW).cores(cores).word("work=compute");
        let outcome = guest.word("subtasks=2").word("trace=dump").succeed();
        joins_are_right(&outcome, FEW, &[2]);
        let runs = read(&outcome.serial).expect("a trace");
        assert_eq!(runs[0].lost, 0);
        let found = check(&runs[0], bound::COUNTED_NS);
        assert_eq!(found.breaches, [], "{cores} cores");
    }
}

#[test]
fn two_deterministic_runs_print_the_same_bytes() {
    let run = || demo().word("seed=7").succeed().serial;
    let (first, second) = (run(), run());
    let differ = first.lines().zip(second.lines()).find(|(a, b)| a != b);
    assert_eq!(differ, None);
    assert_eq!(first.len(), second.len());
}

#[test]
fn another_seed_is_another_run() {
    let run = |seed: &str| demo().word("subtasks=4").word(seed).succeed();
    let response = |outcome: &Outcome| {
        let line = outcome.transcript.of_kind("fork_join").next();
        line.and_then(|line| line.value.get("response_time_ns").cloned())
    };
    assert_ne!(response(&run("seed=1")), response(&run("seed=2")));
}

#[test]
fn nothing_allocates_while_jobs_run_and_32_mib_suffice() {
    let outcome = demo().memory_mib(32).succeed();
    for line in outcome.transcript.of_kind("fork_join") {
        assert_eq!(line.number_at("allocations"), Some(0), "{}", line.text);
    }
    let memory = outcome.transcript.of_kind("memory").last();
    let memory = memory.unwrap_or_else(|| panic!("no memory line\n{}", outcome.tail()));
    let peak = memory.number_at("heap_peak_bytes");
    assert!(peak > Some(0), "{}", memory.text);
    assert!(peak <= memory.number_at("heap_bytes"), "{}", memory.text);
}

#[test]
fn the_first_release_is_within_100_ms_of_the_kernels_entry() {
    let outcome = demo().word("subtasks=6").succeed();
    let line = outcome.transcript.of_kind("fork_join").next();
    let first = line.and_then(|line| line.number_at("first_release_ns"));
    assert!(
        first.is_some_and(|ns| ns <= 100_000_000),
        "{first:?}\n{}",
        outcome.tail()
    );
}

#[test]
fn work_that_computes_has_no_simulated_execution() {
    let guest = Guest::new("fork-join").word("work=compute");
    let outcome = guest.word("occupy=spin").end_in(Status::Usage);
    let reason = &outcome.transcript.verdict().expect("checked before").reason;
    assert!(reason.starts_with("`occupy` says how"), "{reason}");
}

#[test]
fn a_wrong_guest_command_line_ends_in_a_usage_error() {
    for word in [
        "job=5",
        "jobs=0",
        "jobs=many",
        "policy=rr",
        "subtasks=0",
        "subtasks=2,,4",
        "occupy=wait",
        "work=hard",
        "stray",
    ] {
        let outcome = Guest::new("fork-join").word(word).end_in(Status::Usage);
        let reason = outcome.transcript.verdict().expect("checked before").reason;
        let (key, _) = word.split_once('=').unwrap_or((word, ""));
        assert!(reason.contains(key), "`{word}` is not named: {reason}");
        assert_eq!(reason.lines().count(), 1, "{reason}");
        assert_eq!(
            outcome.transcript.of_kind("fork_join").count(),
            0,
            "half-run"
        );
    }
}

#[test]
fn a_build_without_optimization_evaluates_its_run() {
    let words = [
        "build",
        "--quiet",
        "--package",
        "fork-join",
        "--bin",
        "fork-join",
    ];
    let built = system::cargo().args(words).output().expect("cargo starts");
    assert!(built.status.success(), "{built:?}");
    let image = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("debug/fork-join");
    let guest = Guest::new("fork-join").image(&image);
    let outcome = guest.word("jobs=20").word("subtasks=6").succeed();
    let line = outcome.transcript.of_kind("fork_join").next();
    let line = line.expect("the app's line");
    assert_eq!(line.number_at("violations"), Some(0), "{}", line.text);
    assert_eq!(line.number_at("joins"), Some(20), "{}", line.text);
}
