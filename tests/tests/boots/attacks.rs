//! Attacks by safe code: they cannot use up shared things, keep the serial line, forge the lines
//! judging a run, or misuse a lock. The guest is the image `guest-tests`, which commits attacks
//! next to a healthy DAG. This DAG must meet every deadline.

use harness::{Guest, Members, Said, lawful_runs};
use tool::Outcome;
use tool::places;
use views::protocol::{MachineLine, Status};
use views::record::COUNTED_TOLERANCE_NS;

/// Boots one attack, or all attacks possible one after the other, on a number of cores.
fn attacks(word: &str, cores: u64) -> Guest {
    Guest::test("attack").word(word).cores(cores)
}

/// Checks each attack's number of faults, 0 or 1, and each fault's line. `expected` has the
/// attacks' names, the faults' causes and parts of their messages.
#[track_caller]
fn harm_nobody(outcome: &Outcome, expected: &[(&str, &str, &str)]) {
    let attacks = outcome.lines("attack");
    assert_eq!(attacks.len(), expected.len(), "{}", outcome.tail());
    let mut faults = outcome.lines("fault").into_iter();
    for (attack, (name, cause, message)) in attacks.iter().zip(expected) {
        attack.reads([("name", name)]);
        let is_fault = !cause.is_empty();
        attack.has([
            ("lost_jobs", 0),
            ("misses", 0),
            ("faults", u64::from(is_fault)),
        ]);
        if is_fault {
            let fault = faults.next().expect("a fault");
            fault.reads([
                ("cause", cause),
                ("dag_name", "doomed"),
                ("subtask_name", "process"),
            ]);
            fault.has([("job", 10)]);
            let said = fault.member("message");
            assert!(said.contains(message), "{said:?} lacks {message:?}");
        }
    }
    assert_eq!(faults.next(), None, "{}", outcome.tail());
}

#[test]
fn attacks_harm_their_own_dag_alone() {
    for cores in [1, 4] {
        let outcome = attacks("", cores).memory_mib(64).succeed();
        harm_nobody(
            &outcome,
            &[
                (
                    "allocator_stack",
                    "page fault",
                    "a stack overflow (the stack has 64 KiB)",
                ),
                ("display_panics", "panic", "a panic in a `Display`"),
                ("display_prints", "", ""),
                ("display_loops", "budget overrun", "budget of 6ms"),
                ("message_1_mb", "panic", " ... and 999600 more bytes"),
                ("message_10_mb", "panic", " ... and 9999600 more bytes"),
                ("forge_lines", "", ""),
                ("forge_message", "panic", "a message"),
                (
                    "forge_kind",
                    "panic",
                    "a machine line of kind `verdict` is the kernel's to print",
                ),
                ("lock_twice", "panic", "in a section already"),
                ("lock_loop", "budget overrun", "budget of 6ms"),
                ("flood", "", ""),
            ],
        );
        let told = &calls_told(&outcome)[0];
        assert!(told.contains("overflow_in_the_allocator"), "{told}");
        assert!(told.lines().count() > 3, "{told}");
        let lines: Vec<&str> = outcome.serial.lines().collect();
        let texts = lines.iter().filter(|line| line.ends_with("er text"));
        let texts: Vec<&str> = texts.copied().collect();
        assert_eq!(texts, ["the inner text", "the outer text"]);
        forged_is_text(&outcome);
        let is_counted =
            |line: &&str| line.ends_with(" bytes of output did not fit in the buffer)");
        assert!(lines.iter().any(is_counted), "{}", outcome.tail());
    }
}

/// Checks that no machine line is forged: each attempt is there as text, four times of one attack
/// and twice of a message. A genuine line of the kernel quotes the text, as it should.
fn forged_is_text(outcome: &Outcome) {
    let is_forged = |line: &&MachineLine| line.text.contains("forged") && line.kind != "fault";
    assert_eq!(outcome.transcript.machine.iter().find(is_forged), None);
    let is_text = |line: &&str| line.starts_with(" {") && line.contains("\"forged\"");
    let found = outcome.serial.lines().filter(is_text).count();
    assert_eq!(found, 6, "{}", outcome.tail());
}

/// Returns the calls leading to the faults, with names.
fn calls_told(outcome: &Outcome) -> Vec<String> {
    let lines = outcome.lines("backtrace").into_iter();
    let told = lines.map(|line| places::explain(&outcome.image, &line.text).expect("names"));
    told.collect()
}

#[test]
fn a_dag_that_uses_up_the_heap_in_small_pieces_ends_alone() {
    for attack in ["leak_strings", "keep_boxes"] {
        for cores in [1, 4] {
            let outcome = attacks(&format!("attack={attack}"), cores).succeed();
            harm_nobody(&outcome, &[(attack, "panic", "memory allocation of ")]);
            let told = calls_told(&outcome);
            let [told] = &told[..] else {
                panic!("not one fault: {told:?}");
            };
            // The allocator's code that is inlined into it may bear its name, too.
            let place = ", tests/guest/src/attacks/heap.rs:";
            let mut of_attack = told.lines().filter(|line| line.contains(attack));
            assert!(of_attack.any(|line| line.contains(place)), "{told}");
        }
    }
}

#[test]
fn a_commit_in_an_instance_leaves_the_runs_record_whole() {
    for cores in [1, 2] {
        let outcome = attacks("attack=commit", cores).word("events=on").succeed();
        let refused = "the platform did not take the plan: other DAGs are committed already";
        harm_nobody(&outcome, &[("commit", "panic", refused)]);
        let runs = lawful_runs(&outcome, COUNTED_TOLERANCE_NS);
        assert_eq!(runs.len(), 1);
        assert_eq!(runs[0].task_set.dags().len(), 2);
    }
}

#[test]
fn a_machine_line_cannot_hold_another_one() {
    for cores in [1, 4] {
        let outcome = attacks("attack=forge_list", cores).boot();
        outcome.only("verdict");
        // It is damaged, and that is what the run fails for.
        let fault = outcome.judge().expect_err("a damaged line");
        assert!(fault.reason.starts_with("serial line "), "{}", fault.reason);
    }
}

#[test]
fn an_app_that_ends_the_machine_itself_has_not_succeeded() {
    let outcome = Guest::test("crime").word("crime=exit_port").boot();
    let fault = outcome.judge().expect_err("no verdict");
    assert_eq!(fault.status, Status::Failure);
    let said = "the guest ended in success, but the kernel gave no verdict: the app has written to \
                QEMU's exit port itself";
    assert_eq!(fault.reason, said, "{}", outcome.tail());
}

#[test]
fn a_core_that_takes_no_interrupts_is_noticed_by_another() {
    let mut cores = ["deaf_alone", "deaf_beside"].map(|test| {
        let outcome = Guest::test(test).cores(2).end_in(Status::Failure);
        let line = outcome.line("panic");
        line.has([("job", 0)]);
        let message = line.member("message");
        let begins = "interrupts disabled for seconds";
        assert!(message.starts_with(begins), "{message}");
        let whose = "that is subtask `deaf` of dag `deaf`";
        assert!(outcome.serial.contains(whose), "{}", outcome.tail());
        line.number("cpu")
    });
    cores.sort_unstable();
    assert_eq!(cores, [0, 1]);
}
