//! Instances waiting for bytes of the serial port, and the cost of a wait. (The scenarios show the
//! effects of waits, on the machine by their traces, and `camera` has answers of a device.)

use harness::{Guest, Members, Said, lawful_runs};
use sched_dag::journal::EventKind;
use views::record::{COUNTED_TOLERANCE_NS, Run};

/// Returns the events of the only subtask, a line for each job, with times in milliseconds, cut to
/// tenths: a core becomes free at the tenth of a wait's begin, and an instance goes on at the tenth
/// of the wait's end.
fn told(run: &Run) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for event in run.events.iter().filter(|event| event.subtask.is_some()) {
        // Where no interrupt has to come, nobody is asked for a core.
        if matches!(event.what, EventKind::Ready | EventKind::Request) {
            continue;
        }
        let (whole, tenth) = (event.time_ns / 1_000_000, event.time_ns / 100_000 % 10);
        let said = format!("{whole}.{tenth} {}", event.what);
        match lines.last_mut() {
            Some(line) if event.what != EventKind::Start => *line += &format!(", {said}"),
            _ => lines.push(said),
        }
    }
    lines
}

/// Bytes of the serial port end waits; a byte coming too late is there for the next job.
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
        let expected = [
            "0.0 start, 1.0 wait, 1.0 wake, 1.0 resume, 1.0 wait, 4.0 wake, 4.0 resume, 5.0 finish",
            "20.0 start, 21.0 wait, 21.0 wake, 21.0 resume, 21.0 wait, 26.0 wake, 26.0 resume, 27.0 finish",
            "40.0 start, 41.0 wait, 41.0 wake, 41.0 resume, 41.0 wait, 41.0 wake, 41.0 resume, 42.0 finish",
            "60.0 start, 61.0 wait, 61.0 wake, 61.0 resume, 61.0 wait, 64.0 wake, 64.0 resume, 65.0 finish",
        ];
        assert_eq!(told(&run), expected);
    }
}

/// Counts the instructions added by a wait and its wake to an instance alone on the machine,
/// including the function's own instructions; for a wait taking time, counts the delay after its
/// end.
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
