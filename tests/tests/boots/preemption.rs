//! Preempted functions: they lose nothing, nothing waits long for them, and the time of
//! suspensions, or of other instances' computing, never counts as theirs. With AVX they use it;
//! with AVX off the same image tells them so.

use harness::{Guest, Members, Said, lawful_runs};
use sched_dag::journal::{Event, EventKind};
use tool::{Mode, Outcome};
use views::protocol::{MachineLine, Status};
use views::record::Run;

/// The longest wait of a core for the others' time slices, and for the kernel's work meanwhile
/// (`docs/decisions/0008-deterministic-by-default.md`).
const TURN_NS: u64 = 20_000;

/// Describes DAGs preempting each other; their instances keep values in all registers and compare
/// them.
fn preemption(mode: Mode, cores: u64) -> Guest {
    let guest = Guest::test("preemption").mode(mode).cores(cores);
    guest.memory_mib(64)
}

/// Checks that the output shows no losses, with at least `least_preemptions` preemptions.
#[track_caller]
fn keeps_all(outcome: &Outcome, has_avx: bool, least_preemptions: u64) {
    let line = outcome.line("preemption");
    line.has([("diverged", 0), ("violations", 0)]);
    let preemptions = line.number("preemptions");
    assert!(preemptions >= least_preemptions, "{}", line.text);
    let flag = format!("\"avx\":{has_avx}");
    let is_told = |line: &MachineLine| line.text.contains(&flag);
    assert!(is_told(line) && is_told(outcome.line("boot")), "{flag}");
}

/// Returns the longest time from an instance's start to its end, of the most urgent DAG's source.
/// This source has next to nothing to do, and no other preempts it by static priorities.
fn longest_of_the_source(run: &Run) -> u64 {
    let dag = run.task_set.find("every-2-ms");
    let source = run.task_set.dag(dag).find("source");
    let is_of = |event: &&Event| (event.dag, event.subtask) == (dag, Some(source));
    let mut started_ns = 0;
    let mut longest_ns = 0;
    for event in run.events.iter().filter(is_of) {
        match event.what {
            EventKind::Start => started_ns = event.time_ns,
            EventKind::Finish => longest_ns = longest_ns.max(event.time_ns - started_ns),
            _ => {}
        }
    }
    longest_ns
}

/// The budgets are so short that an instance would exceed its budget if suspensions, or the time
/// slices of others, counted as its own time.
#[test]
fn preempted_instances_lose_nothing_and_wait_for_a_turn_at_most() {
    for cores in [1, 2, 4, 8] {
        for policy in ["static", "edf"] {
            let words = format!("ms=250 rounds=5 budgets=yes events=on policy={policy}");
            let guest = preemption(Mode::Deterministic, cores).word(&words);
            let outcome = guest.succeed();
            keeps_all(&outcome, true, 50);
            let line = outcome.line("preemption");
            line.has([("passed_over", 0), ("allocations", 0)]);
            let least_interrupts = if cores == 1 { 1_000 } else { 20_000 };
            assert!(
                line.number("interrupts") >= least_interrupts,
                "{}",
                line.text
            );
            let runs = lawful_runs(&outcome, TURN_NS);
            assert_eq!((runs.len(), runs[0].lost), (1, 0));
            if policy == "static" {
                // A short first slice of each core released at the same time, and a whole slice of
                // each if the function is not done in its own first slice.
                let longest_ns = longest_of_the_source(&runs[0]);
                assert!(longest_ns <= (2_000 + 8_000) * cores, "{longest_ns}");
            }
            if (cores, policy) == (4, "edf") {
                assert!(guest.succeed().serial == outcome.serial, "two runs differ");
            }
        }
    }
}

#[test]
fn preempted_instances_lose_nothing_in_real_time() {
    for (cores, policy) in [(2, "static"), (4, "edf")] {
        // Emulated AVX is slow: where too much is to be done, only the most urgent DAG runs.
        let words = format!("ms=200 rounds=4 held=yes policy={policy}");
        let outcome = preemption(Mode::Threads, cores).word(&words).succeed();
        keeps_all(&outcome, true, 1);
    }
}

/// The first processor has no AVX, the next no instruction for saving only the registers in use.
#[test]
fn the_same_image_runs_where_avx_is_missing_or_off() {
    for (model, words) in [
        ("Nehalem", ""),
        ("max,-xsaveopt", ""),
        ("max,-avx", ""),
        ("max", "avx=off"),
    ] {
        let guest = preemption(Mode::Deterministic, 2).model(model);
        keeps_all(&guest.word("ms=200").word(words).succeed(), false, 10);
    }
}

#[test]
fn avx_that_is_off_is_an_undefined_instruction() {
    let guest = Guest::test("crime").word("crime=avx avx=off");
    let outcome = guest.end_in(Status::Failure);
    let exception = &outcome.line("panic").text;
    assert!(exception.contains("invalid opcode"), "{exception}");
}

#[test]
fn an_instance_that_computes_for_a_time_does_so_for_all_of_it() {
    for mode in [Mode::Deterministic, Mode::Threads] {
        let outcome = Guest::test("occupation").mode(mode).succeed();
        outcome.line("occupation").has([("too_short", 0)]);
    }
}
