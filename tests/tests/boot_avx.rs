//! Functions use AVX where the processor has it, and lose nothing by it when they are
//! preempted; where it is off they are told so, by the same image.

use std::fs;

use harness::Guest;
use harness::altered::qemu_with;
use tool::Mode;
use tool::protocol::Status;

/// Describes DAGs that preempt one another, of instances that keep values in all registers
/// of AVX if there are any, and compare them.
fn halves(mode: Mode, cores: u64) -> Guest {
    let guest = Guest::new("guest-tests").mode(mode).cores(cores);
    let guest = guest.memory_mib(64).word("test=preemption");
    guest.word("work=halves").word("ms=200")
}

/// Boots it and checks that it is told whether there is AVX, and that nothing is lost.
fn keeps_all(guest: &Guest, has_avx: bool, least_preemptions: u64) {
    let outcome = guest.succeed();
    let flag = format!("\"avx\":{has_avx}");
    for kind in ["boot", "preemption"] {
        let line = outcome.transcript.of_kind(kind).next();
        let line = line.unwrap_or_else(|| panic!("no {kind} line\n{}", outcome.tail()));
        assert!(line.text.contains(&flag), "{}", line.text);
        if kind == "preemption" {
            assert_eq!(line.number_at("diverged"), Some(0), "{}", line.text);
            let preemptions = line.number_at("preemptions");
            assert!(preemptions >= Some(least_preemptions), "{}", line.text);
        }
    }
}

#[test]
fn preempted_instances_keep_256_bits_of_each_register() {
    for cores in [1, 2, 4] {
        keeps_all(&halves(Mode::Deterministic, cores), true, 50);
    }
}

#[test]
fn preempted_instances_keep_256_bits_of_each_register_in_real_time() {
    for cores in [2, 4] {
        // Emulated AVX is slow: where too much is to be done, only the most urgent DAG runs.
        let guest = halves(Mode::Threads, cores).word("rounds=4");
        keeps_all(&guest, true, 1);
    }
}

/// One has no AVX, the next not the instruction that leaves out what is not in use.
#[test]
fn the_same_image_runs_where_avx_is_missing_or_off() {
    for (model, words) in [
        ("Nehalem", ""),
        ("max,-xsaveopt", ""),
        ("max,-avx", ""),
        ("max", "avx=off"),
    ] {
        let program = qemu_with("#max", model);
        let guest = halves(Mode::Deterministic, 2).program(&program);
        keeps_all(&guest.word(words), false, 10);
        fs::remove_file(&program).expect("it is ours");
    }
}

#[test]
fn avx_that_is_off_is_an_undefined_instruction() {
    let guest = Guest::new("guest-tests").word("test=avx");
    let outcome = guest.word("avx=off").end_in(Status::Failure);
    let exception = outcome.transcript.of_kind("exception").next();
    let exception = exception.unwrap_or_else(|| panic!("no exception\n{}", outcome.tail()));
    assert!(
        exception.text.contains("invalid opcode"),
        "{}",
        exception.text
    );
}

#[test]
fn another_value_of_the_word_is_refused() {
    let outcome = Guest::new("fork-join")
        .word("avx=512")
        .end_in(Status::Usage);
    let reason = outcome.transcript.verdict().expect("checked before").reason;
    assert_eq!(reason, "`avx=512`: allowed are on, off");
}
