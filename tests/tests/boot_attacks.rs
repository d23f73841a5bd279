//! What safe code cannot do to others: use up what all share, keep the serial line, forge
//! what a run is judged by, misuse a lock. The guest is the image `guest-tests`, which
//! commits one attack in a boot, next to a healthy DAG (`attack=NAME`).

use harness::Guest;
use tool::Outcome;
use tool::places::Places;
use tool::protocol::{MachineLine, Status};

/// Commits the attack on 1 and 4 cores. The healthy DAG must meet every deadline, and the
/// doomed one end by so many faults. Hands over what came of it, and the fault if any.
fn attacked(name: &str, faults: u64, judge: impl Fn(&Outcome, Option<&MachineLine>)) {
    for cores in [1, 4] {
        let guest = Guest::new("guest-tests").word("test=attack");
        let outcome = guest.word(&format!("attack={name}")).cores(cores).succeed();
        let tail = || format!("{name} on {cores} cores\n{}", outcome.tail());
        let line = outcome.transcript.of_kind("attack").next();
        let line = line.unwrap_or_else(|| panic!("no line of kind `attack`: {}", tail()));
        let number = |member| line.number_at(member);
        assert_eq!(number("healthy_jobs"), number("jobs"), "{}", tail());
        assert_eq!(number("healthy_misses"), Some(0), "{}", tail());
        assert_eq!(number("healthy_faults"), Some(0), "{}", tail());
        assert_eq!(number("doomed_faults"), Some(faults), "{}", tail());
        let reported: Vec<_> = outcome.transcript.of_kind("fault").collect();
        assert_eq!(reported.len() as u64, faults, "{}", tail());
        for fault in &reported {
            assert_eq!(fault.text_at("dag_name"), Some("doomed"), "{}", tail());
            assert_eq!(fault.text_at("subtask_name"), Some("process"), "{}", tail());
            assert_eq!(fault.number_at("job"), Some(10), "{}", tail());
        }
        judge(&outcome, reported.first().copied());
    }
}

/// The fault must be of this cause, and say this.
fn says(cause: &str, message: &str) -> impl Fn(&Outcome, Option<&MachineLine>) {
    move |outcome, fault| {
        let text = |member| fault.and_then(|fault| fault.text_at(member));
        let said = text("message").unwrap_or_default();
        assert_eq!(text("cause"), Some(cause), "{}", outcome.tail());
        assert!(said.contains(message), "{said:?} lacks {message:?}");
    }
}

#[test]
fn a_dag_that_uses_up_the_heap_in_small_pieces_ends_alone() {
    let no_memory = |function: &'static str| {
        move |outcome: &Outcome, fault: Option<&MachineLine>| {
            says("panic", "memory allocation of ")(outcome, fault);
            let told = calls_told(outcome);
            let line = told.lines().find(|line| line.contains(function));
            assert!(
                line.is_some_and(|line| line.contains(", tests/guest/src/attacks/heap.rs:")),
                "{told}"
            );
        }
    };
    attacked("leak_strings", 1, no_memory("leak_strings"));
    attacked("keep_boxes", 1, no_memory("keep_boxes"));
}

/// Returns the calls that led to the only fault, with names.
fn calls_told(outcome: &Outcome) -> String {
    let lines: Vec<_> = outcome.transcript.of_kind("backtrace").collect();
    assert_eq!(lines.len(), 1, "{}", outcome.tail());
    let told = Places::new(&outcome.image).explain(&lines[0].text);
    told.unwrap_or_else(|| panic!("nothing is told of {}", lines[0].text))
}

#[test]
fn a_stack_that_overflows_in_the_allocator_is_its_owners() {
    let overflow = says("page fault", "a stack overflow (the stack has 64 KiB)");
    attacked("allocator_stack", 1, |outcome, fault| {
        overflow(outcome, fault);
        let told = calls_told(outcome);
        assert!(told.contains("overflow_in_the_allocator"), "{told}");
        assert!(told.lines().count() > 3, "{told}");
    });
}

#[test]
fn a_display_that_panics_or_loops_is_the_printers_own_fault() {
    attacked("display_panics", 1, says("panic", "a panic in a `Display`"));
    attacked("display_loops", 1, says("budget overrun", "budget of 6ms"));
}

#[test]
fn a_display_may_print() {
    attacked("display_prints", 0, |outcome, _| {
        let texts: Vec<&str> = outcome
            .serial
            .lines()
            .filter(|line| line.contains("the "))
            .collect();
        assert_eq!(texts, ["the inner text", "the outer text"]);
    });
}

#[test]
fn a_long_message_is_cut_and_delays_nobody() {
    for (name, bytes) in [("message_1_mb", 1_000_000), ("message_10_mb", 10_000_000)] {
        let left_out = format!(" ... and {} more bytes", bytes - 400);
        attacked(name, 1, says("panic", &left_out));
    }
}

#[test]
fn a_flood_of_text_delays_nobody_and_is_counted() {
    attacked("flood", 0, |outcome, _| {
        let counted = outcome
            .serial
            .contains(" bytes of output did not fit in the buffer");
        assert!(counted, "{}", outcome.tail());
    });
}

/// No machine line of the log is forged, and `texts` is how often what was to be one is
/// there as text.
fn forged_is_text(texts: usize) -> impl Fn(&Outcome, Option<&MachineLine>) {
    move |outcome, _| {
        let forged = |line: &&MachineLine| line.text.contains("forged");
        assert_eq!(outcome.transcript.machine.iter().find(forged), None);
        let is_text = |line: &&str| line.starts_with(" {") && line.contains("\"forged\"");
        let found = outcome.serial.lines().filter(is_text).count();
        assert_eq!(found, texts, "{}", outcome.tail());
    }
}

#[test]
fn forged_machine_lines_are_text() {
    attacked("forge_lines", 0, forged_is_text(4));
}

#[test]
fn forged_lines_in_a_message_are_text() {
    for cores in [1, 4] {
        let guest = Guest::new("guest-tests").word("test=attack").cores(cores);
        let outcome = guest.word("attack=forge_message").succeed();
        // The kernel's own line quotes the message, which is how it should be.
        let forged = |line: &&MachineLine| line.text.contains("forged") && line.kind != "fault";
        assert_eq!(outcome.transcript.machine.iter().find(forged), None);
        assert_eq!(outcome.transcript.of_kind("fault").count(), 1);
    }
}

#[test]
fn a_machine_line_cannot_hold_another_one() {
    for cores in [1, 4] {
        let guest = Guest::new("guest-tests").word("test=attack").cores(cores);
        let outcome = guest.word("attack=forge_list").boot();
        assert_eq!(outcome.transcript.of_kind("verdict").count(), 1);
        // It is damaged, and that is what the run fails for.
        let fault = outcome.judge().expect_err("a damaged line");
        assert!(fault.reason.starts_with("serial line "), "{}", fault.reason);
    }
}

#[test]
fn the_kinds_of_the_kernel_are_refused() {
    let refusal = "a machine line of kind `verdict` is the kernel's to print";
    attacked("forge_kind", 1, says("panic", refusal));
}

#[test]
fn a_lock_misused_is_its_holders_fault() {
    attacked("lock_twice", 1, says("panic", "taken by its holder"));
    attacked("lock_loop", 1, says("budget overrun", "budget of 6ms"));
}

#[test]
fn an_app_that_ends_the_machine_itself_has_not_succeeded() {
    let outcome = Guest::new("guest-tests").word("test=exit_port").boot();
    let fault = outcome.judge().expect_err("no verdict");
    assert_eq!(fault.status, Status::Failure);
    let said = "the guest ended in success, but the kernel gave no verdict: the app has written to \
                QEMU's exit port itself";
    assert_eq!(fault.reason, said, "{}", outcome.tail());
}

#[test]
fn a_core_that_takes_no_interrupts_is_noticed_by_another() {
    let cores = ["deaf_alone", "deaf_beside"].map(|test| {
        let guest = Guest::new("guest-tests").word(&format!("test={test}"));
        let outcome = guest.cores(2).end_in(Status::Failure);
        let line = outcome.transcript.of_kind("exception").next();
        let line = line.unwrap_or_else(|| panic!("no exception\n{}", outcome.tail()));
        let message = line.text_at("message").unwrap_or_default();
        assert!(
            message.starts_with("interrupts disabled for seconds"),
            "{message}"
        );
        assert!(
            outcome
                .serial
                .contains("that is subtask `deaf` of dag `deaf`")
        );
        assert_eq!(line.number_at("job"), Some(0), "{}", line.text);
        line.number_at("cpu")
    });
    assert!(
        cores.contains(&Some(0)) && cores.contains(&Some(1)),
        "{cores:?}"
    );
}
