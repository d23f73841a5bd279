//! The kernel when things go wrong or come thick and fast. The guest is the image `guest-tests`,
//! which runs the test named by the word `test=NAME` on its command line.

use harness::markdown::page;
use harness::{Guest, Members, Said};
use tool::Mode;
use views::protocol::Status;

#[test]
fn a_panic_in_the_kernel_ends_in_failure_and_names_its_place() {
    for cores in [1, 4] {
        let guest = Guest::test("crime").word("crime=panic").cores(cores);
        let outcome = guest.end_in(Status::Failure);
        let panic = outcome.line("panic");
        panic.has([("cpu", 0)]);
        let place = panic.member("place");
        let numbers = place.rsplit(':').take(2);
        let numbers = numbers.filter(|part| part.parse::<u32>().is_ok());
        assert!(place.contains(".rs:") && numbers.count() == 2, "{place}");
        assert!(!panic.member("message").is_empty());
        assert!(!outcome.reason().is_empty());
    }
}

#[test]
fn output_that_does_not_fit_is_counted() {
    let outcome = Guest::test("talkative").succeed();
    let counted = outcome.serial.lines().find_map(|line| {
        let count = line.strip_suffix(" bytes of output did not fit in the buffer)")?;
        count.strip_prefix('(')?.parse::<usize>().ok()
    });
    // Whatever was printed, 20 lines of 1001 bytes, is shown or counted.
    let shown = outcome.serial.lines().filter(|line| line.ends_with("much"));
    assert_eq!(counted, Some((20 - shown.count()) * 1001));
}

/// Checks the cost of every fault committed by a subtask: its DAG pays as its policy states, and no
/// other DAG pays anything.
fn faults_are_contained(guest: &Guest) {
    let outcome = guest.succeed();
    let (verdicts, faults) = (outcome.lines("containment"), outcome.lines("fault"));
    assert_eq!(verdicts.len(), 3 * 19, "{}", outcome.tail());
    assert_eq!(faults.len(), verdicts.len(), "{}", outcome.tail());
    for (verdict, fault) in verdicts.iter().zip(&faults) {
        // The jobs that the DAG at fault has completed, of 30, and those that it has lost.
        let (cost, completed, lost) = match verdict.member("on_fault") {
            "end" => ("dag", 10, 0),
            "restart" => ("job", 29, 1),
            _ => ("degraded", 29, 1),
        };
        verdict.reads([("verdict", "contained")]);
        verdict.has([("doomed_jobs", completed), ("lost_jobs", lost)]);
        fault.reads([
            ("cost", cost),
            ("dag_name", "doomed"),
            ("subtask_name", "process"),
        ]);
        fault.has([("job", 10)]);
        assert!(!fault.member("place").is_empty(), "{}", fault.text);
    }
    // The lock is lost with the first one's section, although its stack is used again.
    let said = faults.iter().filter_map(|line| line.text_at("message"));
    let section: Vec<&str> = said.filter(|said| said.contains("section")).collect();
    let lost = "lock `shared`: a fault has ended a section, and its data may be half changed";
    let unstated = "lock `unstated`: the subtask enters a section and has not stated that, by \
                    `dag.using(lock.entering(N))`";
    let first = ["a panic in a section", unstated];
    assert_eq!(
        section,
        [first, [lost, unstated], [lost, unstated]].as_flattened()
    );
}

#[test]
fn faults_of_a_subtask_end_its_dag_alone() {
    for (cores, words) in [(1, ""), (2, ""), (4, ""), (2, "clusters=1,1")] {
        faults_are_contained(&Guest::new("faults").cores(cores).word(words));
    }
}

#[test]
fn a_fault_that_the_app_does_not_look_at_is_a_failure_and_its_function_has_said_lines_before() {
    let outcome = Guest::test("unnoticed").end_in(Status::Failure);
    outcome.only("fault");
    let reason = outcome.reason();
    let ended = "a fault ended dag `careless`";
    assert!(reason.starts_with(ended), "{reason}");
    let lines = outcome.lines("log");
    let [begins, _, last] = lines[..] else {
        panic!("{} lines", lines.len());
    };
    begins.reads([("level", "info"), ("message", "begins")]);
    assert!(begins.number_at("job").is_none(), "{}", begins.text);
    last.reads([("level", "warn"), ("message", "counted")]);
    last.reads([("dag_name", "careless"), ("subtask_name", "panics")]);
    last.has([("job", 1), ("left_out", 0)]);
    let fields = r#""fields":{"jobs":2,"of":"careless"}"#;
    assert!(last.text.contains(fields), "{}", last.text);
    assert!(last.number("time_ns") >= 10_000_000, "{}", last.text);
    let shown = "warn careless/panics[1] ";
    assert!(outcome.serial.lines().any(|line| line.starts_with(shown)));
    let warns = Guest::test("unnoticed").word("log=warn");
    assert_eq!(warns.end_in(Status::Failure).lines("log").len(), 2);
}

#[test]
fn a_response_beyond_its_proven_bound_is_no_success() {
    let guest = Guest::test("exceeded");
    let outcome = guest.end_in(Status::Failure);
    let line = outcome.only("bound_exceeded");
    line.reads([("dag_name", "guess")]);
    line.has([("jobs", 2), ("job", 3), ("bound_ns", 1_000_000)]);
    assert!(line.number("response_ns") > 4_000_000, "{}", line.text);
    let reason = outcome.reason();
    let beyond = "in job 3, beyond its proven bound of 1.000 ms; ";
    assert!(reason.starts_with("dag `guess` took 4."), "{reason}");
    assert!(reason.contains(beyond), "{reason}");
    let shared = guest.clone().cores(2).end_in(Status::Failure).reason();
    let cause = "; in mode deterministic cores that compute share one clock: `--cores 1`";
    assert!(shared.contains(cause), "{shared}");
    assert!(!reason.contains("share one clock"));
    assert!(!shared.contains("does not optimize"));
    // So its WCET has not held either, in as many calls.
    let line = outcome.only("wcet_exceeded");
    line.reads([("dag_name", "guess")]);
    line.has([("beyond", 2)]);
    assert!(line.number("longest_ns") > line.number("wcet_ns"));
    // An app may know that its WCETs are guesses; a line says it all the same.
    guest.word("accept=yes").succeed().only("bound_exceeded");
}

#[test]
fn values_that_are_left_behind_harm_nobody() {
    for cores in [1, 4] {
        let outcome = Guest::test("large").cores(cores).succeed();
        let faults = outcome.lines("fault");
        let faults = faults.iter().map(|line| {
            let texts = ["subtask_name", "cause"].map(|name| line.member(name));
            (texts, line.number("job"))
        });
        let expected = [
            (["panics", "panic"], 3),
            (["source", "page fault"], 0),
            (["source", "panic"], 1),
            (["source", "budget overrun"], 1),
        ];
        assert_eq!(faults.collect::<Vec<_>>(), expected, "{}", outcome.tail());
    }
}

#[test]
fn a_run_that_comes_to_a_standstill_names_who_runs() {
    for cores in [1, 4] {
        let outcome = Guest::test("stalled").cores(cores).succeed();
        let line = outcome.only("stalled");
        line.reads([("dag_name", "endless"), ("subtask_name", "holds")]);
        line.has([("job", 0)]);
        let still_ns = line.number("still_ns");
        assert!((500_000_000..1_000_000_000).contains(&still_ns));
        outcome.only("fault");
    }
}

#[test]
fn an_overrun_of_an_inlined_closure_names_its_line() {
    const FILE: &str = "tests/guest/src/overrun.rs";
    let outcome = Guest::test("overrun").succeed();
    outcome.only("fault");
    let tail = outcome.tail();
    let explained = tail.lines().find(|line| line.starts_with("  = 0x"));
    let explained = explained.unwrap_or_else(|| panic!("no address is explained\n{tail}"));
    let line = explained.rsplit_once(&format!(", of {FILE}:"));
    let line = line.and_then(|(_, line)| line.parse::<usize>().ok());
    let line = line.unwrap_or_else(|| panic!("no line is named: {explained}"));
    // The loop, and the call of it.
    let source = page(FILE);
    let (before, rest) = source.split_once("|| {").expect("the loop");
    let first = before.lines().count();
    let last = first + rest.split("});").next().map_or(0, |it| it.lines().count());
    assert!((first..=last).contains(&line), "{explained}");
}

#[test]
fn a_processor_exception_ends_in_failure_and_is_named() {
    for crime in [
        "null_write",
        "stack_overflow",
        "write_to_code",
        "undefined_instruction",
        "nmi",
        "machine_check",
        "double_fault",
    ] {
        let guest = Guest::test("crime").word(&format!("crime={crime}"));
        let outcome = guest.end_in(Status::Failure);
        outcome.only("panic");
        // The host names the function that the address lies in.
        let tail = outcome.tail();
        let named = tail.lines().any(|line| line.starts_with("  = 0x"));
        assert!(named, "{crime}\n{tail}");
    }
}

#[test]
fn stacks_that_faults_have_taken_come_back() {
    for cores in [1, 4] {
        let _ = Guest::test("spend_stacks").cores(cores).succeed();
    }
}

/// Timer interrupts, over all processors, hit computing cores.
#[test]
fn a_storm_of_timer_interrupts_leaves_every_checksum_alone() {
    for (mode, cores, interrupts) in [
        (Mode::Deterministic, 4, 200_000),
        (Mode::Threads, 2, 50_000),
    ] {
        let guest = Guest::test("storm").mode(mode).cores(cores);
        let outcome = guest.word(&format!("interrupts={interrupts}")).succeed();
        let line = outcome.line("storm");
        line.has([("diverged", 0), ("violations", 0), ("cpus", cores)]);
        assert!(line.number("interrupts") >= interrupts, "{}", line.text);
        assert!(line.number("rounds") > 0, "{}", line.text);
    }
}
