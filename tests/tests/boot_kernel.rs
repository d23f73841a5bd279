//! What the kernel does when things go wrong or come thick and fast. The
//! guest is the image `guest-tests`, which runs the test named by the word
//! `test=NAME` on its command line.

use std::collections::{BTreeMap, BTreeSet};

use harness::Guest;
use harness::fault_page::{self, documented_faults};
use tool::protocol::Status;
use tool::{Mode, Outcome};

fn guest(test: &str) -> Guest {
    Guest::new("guest-tests").word(&format!("test={test}"))
}

#[test]
fn a_panic_in_the_kernel_ends_in_failure_and_names_its_place() {
    for cores in [1, 4] {
        let outcome = guest("panic").cores(cores).end_in(Status::Failure);
        let panic = outcome.transcript.of_kind("panic").next();
        let panic = panic.unwrap_or_else(|| panic!("no panic line\n{}", outcome.tail()));
        assert_eq!(panic.number_at("cpu"), Some(0), "{}", panic.text);
        let place = panic.text_at("place").unwrap_or_default();
        let numbers = place
            .rsplit(':')
            .take(2)
            .all(|part| part.parse::<u32>().is_ok());
        assert!(place.contains(".rs:") && numbers, "{}", panic.text);
        assert!(
            panic
                .text_at("message")
                .is_some_and(|text| !text.is_empty())
        );
        let verdict = outcome.transcript.verdict().expect("checked before");
        assert!(!verdict.reason.is_empty());
    }
}

/// Every fault that a subtask commits costs its DAG what its policy says, and no other
/// anything.
fn faults_are_contained(guest: Guest) {
    let outcome = guest.succeed();
    let transcript = &outcome.transcript;
    let verdicts: Vec<_> = transcript.of_kind("containment").collect();
    assert_eq!(verdicts.len(), 3 * 18, "{}", outcome.tail());
    for line in &verdicts {
        assert_eq!(line.text_at("verdict"), Some("contained"), "{}", line.text);
        // The jobs that the DAG at fault has completed, of 30, and those that it has lost.
        let expected = match line.text_at("on_fault") {
            Some("end") => [10, 0],
            _ => [29, 1],
        };
        let jobs = ["doomed_jobs", "lost_jobs"].map(|member| line.number_at(member));
        assert_eq!(jobs, expected.map(Some), "{}", line.text);
    }
    let faults: Vec<_> = transcript.of_kind("fault").collect();
    assert_eq!(faults.len(), verdicts.len(), "{}", outcome.tail());
    for (line, verdict) in faults.into_iter().zip(verdicts) {
        let cost = match verdict.text_at("on_fault") {
            Some("end") => "dag",
            Some("restart") => "job",
            _ => "degraded",
        };
        assert_eq!(line.text_at("cost"), Some(cost), "{}", line.text);
        assert_eq!(line.text_at("dag_name"), Some("doomed"), "{}", line.text);
        assert_eq!(
            line.text_at("subtask_name"),
            Some("process"),
            "{}",
            line.text
        );
        assert_eq!(line.number_at("job"), Some(10), "{}", line.text);
        assert!(line.text_at("place").is_some_and(|place| !place.is_empty()));
    }
    // The lock is lost with the first one's section, although its stack is used again.
    let said = transcript
        .of_kind("fault")
        .filter_map(|line| line.text_at("message"));
    let section = said
        .filter(|said| said.contains("section"))
        .collect::<Vec<_>>();
    assert_eq!(section.len(), 3, "{section:?}");
    assert_eq!(section[0], "a panic in a section");
    let lost = "a fault has ended a section of this lock; its data may be half changed";
    assert!(section[1..].iter().all(|said| *said == lost), "{section:?}");
}

#[test]
fn faults_of_a_subtask_end_its_dag_alone() {
    for cores in [1, 2, 4] {
        faults_are_contained(Guest::new("faults").cores(cores));
    }
}

#[test]
fn faults_of_a_subtask_end_its_dag_alone_in_its_cluster() {
    faults_are_contained(Guest::new("faults").cores(2).word("clusters=1,1"));
}

#[test]
fn a_fault_that_the_app_does_not_look_at_is_a_failure() {
    let outcome = guest("unnoticed").end_in(Status::Failure);
    assert_eq!(outcome.transcript.of_kind("fault").count(), 1);
    let verdict = outcome.transcript.verdict().expect("checked before");
    assert!(
        verdict.reason.starts_with("a fault ended dag `careless`"),
        "{}",
        verdict.reason
    );
}

#[test]
fn a_response_beyond_its_proven_bound_is_no_success() {
    let outcome = guest("exceeded").end_in(Status::Failure);
    let lines: Vec<_> = outcome.transcript.of_kind("bound_exceeded").collect();
    let [line] = lines[..] else {
        panic!("not one line of kind `bound_exceeded`\n{}", outcome.tail());
    };
    assert_eq!(line.text_at("dag_name"), Some("guess"), "{}", line.text);
    assert_eq!(line.number_at("jobs"), Some(2), "{}", line.text);
    assert_eq!(line.number_at("job"), Some(3), "{}", line.text);
    assert_eq!(line.number_at("bound_ns"), Some(1_000_000));
    assert!(line.number_at("response_ns") > Some(4_000_000));
    let verdict = outcome.transcript.verdict().expect("checked before");
    let names_both = verdict.reason.starts_with("dag `guess` took 4.")
        && verdict
            .reason
            .contains("in job 3, beyond its proven bound of 1.000 ms; ");
    assert!(names_both, "{}", verdict.reason);
    let several = guest("exceeded").cores(2).end_in(Status::Failure);
    let shared = several.transcript.verdict().expect("checked before").reason;
    let cause = "; in mode deterministic cores that compute share one clock: `--cores 1`";
    assert!(shared.contains(cause), "{shared}");
    assert!(!verdict.reason.contains("share one clock"));
    assert!(!shared.contains("does not optimize"));
    // So its WCET has not held either, in as many calls.
    let lines: Vec<_> = outcome.transcript.of_kind("wcet_exceeded").collect();
    let [line] = lines[..] else {
        panic!("not one line of kind `wcet_exceeded`\n{}", outcome.tail());
    };
    assert_eq!(line.text_at("dag_name"), Some("guess"), "{}", line.text);
    assert_eq!(line.number_at("beyond"), Some(2), "{}", line.text);
    assert!(line.number_at("longest_ns") > line.number_at("wcet_ns"));
    // An app may know that its WCETs are guesses; a line says it all the same.
    let outcome = guest("exceeded").word("accept=yes").succeed();
    assert_eq!(outcome.transcript.of_kind("bound_exceeded").count(), 1);
}

#[test]
fn values_that_are_left_behind_harm_nobody() {
    for cores in [1, 4] {
        let outcome = guest("large").cores(cores).succeed();
        let faults = outcome.transcript.of_kind("fault").map(|line| {
            let text = |name| line.text_at(name).unwrap_or_default().to_string();
            (text("subtask_name"), text("cause"), line.number_at("job"))
        });
        let expected = [
            ("panics", "panic", 3),
            ("source", "page fault", 0),
            ("source", "panic", 1),
            ("source", "budget overrun", 1),
        ];
        let expected =
            expected.map(|(subtask, cause, job)| (subtask.into(), cause.into(), Some(job)));
        assert_eq!(faults.collect::<Vec<_>>(), expected, "{}", outcome.tail());
    }
}

#[test]
fn a_run_that_comes_to_a_standstill_names_who_runs() {
    for cores in [1, 4] {
        let outcome = guest("stalled").cores(cores).succeed();
        let stalled: Vec<_> = outcome.transcript.of_kind("stalled").collect();
        let [line] = stalled[..] else {
            panic!("not one line of kind `stalled`\n{}", outcome.tail());
        };
        assert_eq!(line.text_at("dag_name"), Some("endless"), "{}", line.text);
        assert_eq!(line.text_at("subtask_name"), Some("holds"), "{}", line.text);
        assert_eq!(line.number_at("job"), Some(0), "{}", line.text);
        let still_ns = line.number_at("still_ns").unwrap_or(0);
        assert!((500_000_000..1_000_000_000).contains(&still_ns));
        assert_eq!(outcome.transcript.of_kind("fault").count(), 1);
    }
}

#[test]
fn an_overrun_of_an_inlined_closure_names_its_line() {
    let outcome = guest("overrun").succeed();
    assert_eq!(outcome.transcript.of_kind("fault").count(), 1);
    let tail = outcome.tail();
    let explained = tail.lines().find(|line| line.starts_with("  = 0x"));
    let explained = explained.unwrap_or_else(|| panic!("no address is explained\n{tail}"));
    let line = explained.rsplit_once(", of tests/guest/src/overrun.rs:");
    let line = line.and_then(|(_, line)| line.parse().ok());
    // The loop, and the call of it.
    assert!(
        line.is_some_and(|line: u32| (17..=24).contains(&line)),
        "{explained}"
    );
}

#[test]
fn a_processor_exception_ends_in_failure_and_is_named() {
    for test in [
        "null_write",
        "stack_overflow",
        "write_to_code",
        "undefined_instruction",
        "nmi",
        "machine_check",
        "double_fault",
    ] {
        let outcome = guest(test).end_in(Status::Failure);
        assert_eq!(
            outcome.transcript.of_kind("exception").count(),
            1,
            "{test}\n{}",
            outcome.tail()
        );
        // The host names the function that the address lies in.
        let named = outcome
            .tail()
            .lines()
            .any(|line| line.starts_with("  = 0x"));
        assert!(named, "{test}\n{}", outcome.tail());
    }
}

#[test]
fn output_that_does_not_fit_is_counted() {
    let outcome = guest("flood").succeed();
    let counted = outcome.serial.lines().find_map(|line| {
        let count = line.strip_suffix(" bytes of output did not fit in the buffer)")?;
        count.strip_prefix('(')?.parse::<u64>().ok()
    });
    let counted = counted.unwrap_or_else(|| panic!("nothing is counted\n{}", outcome.tail()));
    // Whatever was printed, 20 lines of 1001 bytes, is shown or counted.
    let shown = outcome.serial.lines().filter(|line| line.ends_with("much"));
    assert_eq!(counted + 1001 * shown.count() as u64, 20 * 1001);
}

#[test]
fn stacks_that_faults_have_taken_come_back() {
    for cores in [1, 4] {
        let _ = guest("spend_stacks").cores(cores).succeed();
    }
}

#[test]
fn a_budget_does_not_count_the_time_in_which_an_instance_is_suspended() {
    let outcome = guest("suspend").succeed();
    assert_eq!(outcome.transcript.of_kind("fault").count(), 0);
}

#[test]
fn every_commit_fault_is_printed_as_documented() {
    let outcome = guest("commit_faults").succeed();
    let lines = outcome.transcript.of_kind("provoked");
    let printed: BTreeMap<String, String> = lines
        .map(|line| {
            let text = |name| line.text_at(name).unwrap_or_default().to_string();
            (text("fault"), text("message"))
        })
        .collect();
    let cases = guest_tests::faults::CASES.iter().map(|(fault, _)| *fault);
    let names: BTreeSet<&str> = printed.keys().map(String::as_str).collect();
    assert_eq!(names, cases.collect());
    let documented = documented_faults();
    for (fault, text) in &printed {
        fault_page::assert_is(fault, &documented[fault].text, text);
    }
}

/// Makes `interrupts` timer interrupts, over all processors, hit computing cores.
fn storm(mode: Mode, cores: u64, interrupts: u64) {
    let guest = guest("storm").mode(mode).cores(cores);
    let guest = guest.word(&format!("interrupts={interrupts}"));
    let outcome = guest.succeed();
    let line = outcome.transcript.of_kind("storm").next();
    let line = line.unwrap_or_else(|| panic!("no storm line\n{}", outcome.tail()));
    assert!(
        line.number_at("interrupts") >= Some(interrupts),
        "{}",
        line.text
    );
    assert_eq!(line.number_at("diverged"), Some(0), "{}", line.text);
    assert!(line.number_at("rounds") > Some(0), "{}", line.text);
    assert_eq!(line.number_at("cpus"), Some(cores), "{}", line.text);
}

#[test]
fn a_million_timer_interrupts_leave_every_checksum_alone() {
    storm(Mode::Deterministic, 4, 1_000_000);
}

#[test]
fn a_storm_of_interrupts_in_real_time_leaves_every_checksum_alone() {
    storm(Mode::Threads, 2, 200_000);
}

/// Runs DAGs that preempt one another and check themselves.
fn preemption(mode: Mode, cores: u64, policy: &str, least_preemptions: u64) -> Outcome {
    let guest = guest("preemption").mode(mode).cores(cores).memory_mib(64);
    let guest = guest.word(&format!("policy={policy}")).word("ms=500");
    let guest = guest.word("trace=dump");
    let outcome = guest.succeed();
    let line = outcome.transcript.of_kind("preemption").next();
    let line = line.unwrap_or_else(|| panic!("no preemption line\n{}", outcome.tail()));
    let preemptions = line.number_at("preemptions");
    assert!(preemptions >= Some(least_preemptions), "{}", line.text);
    assert_eq!(line.number_at("diverged"), Some(0), "{}", line.text);
    assert_eq!(line.number_at("violations"), Some(0), "{}", line.text);
    if mode == Mode::Deterministic {
        assert_eq!(line.number_at("passed_over"), Some(0), "{}", line.text);
    }
    outcome
}

/// Checks that the trace shows no breach: nobody waited for longer than the
/// processors' taking turns explains.
fn keeps_the_rules(outcome: &Outcome) {
    const BOUND_NS: u64 = 200_000;
    let runs = tool::trace::read(&outcome.serial)
        .unwrap_or_else(|fault| panic!("line {}: {}", fault.line, fault.reason));
    assert_eq!(runs.len(), 1);
    let findings = tool::trace::check(&runs[0], BOUND_NS);
    assert_eq!(runs[0].lost, 0);
    let breaches: Vec<String> = findings.breaches.iter().map(ToString::to_string).collect();
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

#[test]
fn preempted_instances_lose_nothing() {
    for cores in [1, 2, 4] {
        for policy in ["static", "edf"] {
            keeps_the_rules(&preemption(Mode::Deterministic, cores, policy, 100));
        }
    }
}

#[test]
fn preempted_instances_lose_nothing_in_real_time() {
    preemption(Mode::Threads, 2, "static", 1);
    preemption(Mode::Threads, 4, "edf", 1);
}

#[test]
fn an_instance_that_computes_for_a_time_does_so_for_all_of_it() {
    for mode in [Mode::Deterministic, Mode::Threads] {
        let outcome = guest("occupation").mode(mode).cores(1).succeed();
        let line = outcome.transcript.of_kind("occupation").next();
        let line = line.unwrap_or_else(|| panic!("no occupation line\n{}", outcome.tail()));
        assert_eq!(line.number_at("too_short"), Some(0), "{}", line.text);
    }
}
