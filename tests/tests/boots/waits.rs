//! Instances that wait: on one core and on several, undivided and in clusters. (Faults and ends, the
//! scenarios tell.)
//!
//! Schedules are told as the events of instances in the order of the journal, with their times in
//! milliseconds: a core is free at the same tenth at which a wait begins, and an instance goes on
//! at that at which its wait ends.

use harness::{Guest, Members, Said, lawful_runs};
use sched_dag::journal::{Event, EventKind};
use tool::Outcome;
use tool::record::COUNTED_TOLERANCE_NS;
use tool::record::Run;

/// Returns the events of instances, a line for each job of the subtask `first`: from its start to
/// that of the next one.
fn told(run: &Run, is_told: impl Fn(&Event) -> bool, first: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for event in run.events.iter().filter(|event| is_told(event)) {
        let Some(subtask) = event.subtask else {
            continue;
        };
        let name = run.task_set.dag(event.dag).subtask(subtask).name();
        // Where no interrupt has to come, nobody is asked for a core.
        if matches!(event.what, EventKind::Ready | EventKind::Request) {
            continue;
        }
        let tenths = event.time_ns / 100_000;
        let (whole, tenth) = (tenths / 10, tenths % 10);
        let said = format!("{whole}.{tenth} {} {name}", event.what.word());
        match lines.last_mut() {
            Some(line) if (event.what, name) != (EventKind::Start, first) => {
                *line = format!("{line}, {said}");
            }
            _ => lines.push(said),
        }
    }
    lines
}

#[track_caller]
fn assert_told(found: &[String], expected: &str) {
    let expected: Vec<&str> = expected.lines().map(str::trim).skip(1).collect();
    assert_eq!(found, expected, "{found:#?}");
}

/// Boots a camera that asks an accelerator, and returns its run.
fn camera(guest: &Guest) -> (Outcome, Run) {
    let outcome = guest.clone().word("events=on").succeed();
    // Each answer is given twice, and the second one of four comes too late at all.
    outcome.line("waits").has([
        ("right", 3),
        ("timed_out", 1),
        ("returned", 5),
        ("allocations", 0),
        ("violations", 0),
    ]);
    let mut runs = lawful_runs(&outcome, COUNTED_TOLERANCE_NS);
    assert!(runs.len() == 1 && runs[0].complete && runs[0].lost == 0);
    (outcome, runs.remove(0))
}

/// An instance loses its core to an instance whose wait ends, by an answer or by its limit.
#[test]
fn one_core_executes_others_while_an_instance_waits() {
    let guest = Guest::test("waits");
    let (outcome, run) = camera(&guest);
    let expected = "
        0.0 start ask, 1.0 wait ask, 2.0 start serve, 4.0 wake ask, 4.0 suspend serve, 4.0 resume ask, 4.5 suspend ask, 4.5 start control, 4.8 finish control, 4.8 resume ask, 5.3 wait ask, 5.3 resume serve, 5.3 finish serve, 7.3 wake ask, 7.3 resume ask, 8.3 finish ask, 14.5 start control, 14.8 finish control
        20.0 start ask, 21.0 wait ask, 22.0 start serve, 24.5 suspend serve, 24.5 start control, 24.8 finish control, 24.8 resume serve, 26.0 wake ask, 26.0 suspend serve, 26.0 resume ask, 27.0 wait ask, 27.0 resume serve, 29.0 wake ask, 29.0 suspend serve, 29.0 resume ask, 30.0 finish ask, 30.0 resume serve, 31.3 finish serve, 34.5 start control, 34.8 finish control
        40.0 start ask, 41.0 wait ask, 42.0 start serve, 42.0 wake ask, 42.0 suspend serve, 42.0 resume ask, 43.0 wait ask, 43.0 resume serve, 43.0 finish serve, 44.5 start control, 44.8 finish control, 45.0 wake ask, 45.0 resume ask, 46.0 finish ask, 54.5 start control, 54.8 finish control
        60.0 start ask, 61.0 wait ask, 62.0 start serve, 64.5 suspend serve, 64.5 start control, 64.8 finish control, 64.8 resume serve, 65.3 wake ask, 65.3 suspend serve, 65.3 resume ask, 66.3 wait ask, 66.3 resume serve, 66.3 finish serve, 68.3 wake ask, 68.3 resume ask, 69.3 finish ask, 74.5 start control, 74.8 finish control";
    assert_told(&told(&run, |_| true, "ask"), expected);
    assert!(camera(&guest).0.serial == outcome.serial, "two runs differ");
}

/// The answers come from another core; in clusters, from another one's. Where two cores are one
/// cluster's, nobody loses a core.
#[test]
fn answers_come_from_other_cores_and_from_other_clusters() {
    let of_camera = |run: &Run| {
        let camera = run.task_set.find("camera");
        told(run, |event| event.dag == camera, "ask")
    };
    let (_, run) = camera(&Guest::test("waits").cores(4));
    let expected = "
        0.0 start ask, 1.0 wait ask, 4.0 wake ask, 4.0 resume ask, 5.0 wait ask, 7.0 wake ask, 7.0 resume ask, 8.0 finish ask
        20.0 start ask, 21.0 wait ask, 26.0 wake ask, 26.0 resume ask, 27.0 wait ask, 29.0 wake ask, 29.0 resume ask, 30.0 finish ask
        40.0 start ask, 41.0 wait ask, 42.0 wake ask, 42.0 resume ask, 43.0 wait ask, 45.0 wake ask, 45.0 resume ask, 46.0 finish ask
        60.0 start ask, 61.0 wait ask, 65.0 wake ask, 65.0 resume ask, 66.0 wait ask, 68.0 wake ask, 68.0 resume ask, 69.0 finish ask";
    assert_told(&of_camera(&run), expected);

    let (_, run) = camera(&Guest::test("waits").cores(2).word("clusters=1,1"));
    // Of a cluster of one core, so `control` preempts it in job 0.
    let preempted =
        "4.5 suspend ask, 4.8 resume ask, 5.3 wait ask, 7.3 wake ask, 7.3 resume ask, 8.3";
    let at_once = "5.0 wait ask, 7.0 wake ask, 7.0 resume ask, 8.0";
    assert_told(&of_camera(&run), &expected.replacen(at_once, preempted, 1));
}

/// Bytes of the serial port end waits; one that comes too late is there for the next job.
#[test]
fn a_function_waits_until_its_bytes_have_gone_and_for_those_that_come() {
    let input = "4ms \"1000\\n\"\n28ms \"200\\n\"\n64ms \"30\\n\"\n";
    for (cores, clusters) in [(1, ""), (4, ""), (2, "clusters=1,1")] {
        let guest = Guest::test("waits_wire").input(input).cores(cores);
        let guest = guest.word("events=on").word(clusters);
        let (outcome, sent) = guest.succeed_sending();
        assert_eq!(sent, b"0\n1\n2\n3\n");
        let line = outcome.line("waits_wire");
        line.has([("sum", 1230), ("timed_out", 1), ("unsent", 0)]);
        line.has([("allocations", 0), ("violations", 0)]);
        let run = lawful_runs(&outcome, COUNTED_TOLERANCE_NS).remove(0);
        if !clusters.is_empty() {
            // The port is of an idle core of the other one, which looks each millisecond.
            continue;
        }
        let expected = "
            0.0 start ask, 1.0 wait ask, 1.0 wake ask, 1.0 resume ask, 1.0 wait ask, 4.0 wake ask, 4.0 resume ask, 5.0 finish ask
            20.0 start ask, 21.0 wait ask, 21.0 wake ask, 21.0 resume ask, 21.0 wait ask, 26.0 wake ask, 26.0 resume ask, 27.0 finish ask
            40.0 start ask, 41.0 wait ask, 41.0 wake ask, 41.0 resume ask, 41.0 wait ask, 41.0 wake ask, 41.0 resume ask, 42.0 finish ask
            60.0 start ask, 61.0 wait ask, 61.0 wake ask, 61.0 resume ask, 61.0 wait ask, 64.0 wake ask, 64.0 resume ask, 65.0 finish ask";
        assert_told(&told(&run, |_| true, "ask"), expected);
    }
}

/// The instructions that a wait and its wake add to an instance which has the machine for itself,
/// the function's own included; and for one that takes time, how late it goes on.
#[test]
fn a_wait_costs_no_step_of_the_scheduler() {
    let outcome = Guest::test("waits_cost").succeed();
    let lines = outcome.lines("waits_cost");
    assert_eq!(lines.len(), 2);
    // One that takes time ends by the timer's interrupt, which two context switches frame.
    for (line, (word, most)) in lines.iter().zip([("at_once", 600), ("later", 1_200)]) {
        line.reads([("wait", word)]);
        line.has([("allocations", 0)]);
        let instructions = line.number("instructions");
        assert!((1..=most).contains(&instructions), "{}", line.text);
    }
}

/// In real time their number and order are held, not their times.
#[test]
fn each_wait_is_taken_in_real_time() {
    for (cores, clusters) in [(1, ""), (4, ""), (2, "clusters=1,1")] {
        let guest = Guest::test("waits").in_real_time().cores(cores);
        let outcome = guest.word("events=on").word(clusters).succeed();
        let line = outcome.line("waits");
        line.has([("allocations", 0), ("violations", 0)]);
        let [right, timed_out] = ["right", "timed_out"].map(|name| line.number(name));
        assert_eq!(right + timed_out, 4, "{}", line.text);
        let run = lawful_runs(&outcome, u64::MAX).remove(0);
        let camera = run.task_set.find("camera");
        let of_camera = run.events.iter().filter(|event| event.dag == camera);
        let [waits, wakes] = [EventKind::Wait, EventKind::Wake]
            .map(|what| of_camera.clone().filter(|event| event.what == what).count());
        assert_eq!((waits, wakes), (8, 8), "two of each job");
    }
}
