//! The car on the machine: it sends the same bytes as in virtual time.

use std::time::Duration;

use cruise::{ReleaseSource, build};
use fass::finish_create_dags;
use fass::shared::{Wire, WireCounts};
use harness::Guest;
use tool::{Machine, Outcome, wire_script};
use views::protocol::Status;
use virtual_time::{Silent, VirtualTime};

/// The jobs of each run.
const JOBS: u64 = 30;

/// The output of a radar. The times are away from the releases.
const INPUT: &str = include_str!("../../../apps/cruise/gaps.txt");

/// Returns the bytes sent in virtual time, and the wire's counts.
fn in_virtual_time(input: &str, releases: ReleaseSource) -> (Vec<u8>, WireCounts) {
    let wire = Wire::new("radar");
    let machine = VirtualTime::new().connect(&wire).silent(Silent::Wcet);
    finish_create_dags(&build(&wire, releases, JOBS)).expect("it is sound");
    for entry in wire_script::read(input).expect("it is well written") {
        machine.arrive_at(&wire, Duration::from_nanos(entry.at_ns), &entry.bytes);
    }
    machine.run();
    (machine.sent(&wire), wire.counts())
}

fn guest(input: &str) -> Guest {
    Guest::new("cruise")
        .word(&format!("jobs={JOBS}"))
        .input(input)
}

/// Returns the counts in the line of kind `wire`.
fn counted(outcome: &Outcome) -> WireCounts {
    let line = outcome.transcript.of_kind("wire").next();
    let line = line.expect("the kernel prints it");
    let number = |name| line.number_at(name).expect("the line has it");
    WireCounts {
        packets: number("packets"),
        bytes: number("bytes"),
        lost_packets: number("lost_packets"),
        lost_bytes: 0,
        malformed: number("malformed"),
        sent_bytes: number("sent_bytes"),
        unsent_bytes: number("unsent_bytes"),
    }
}

#[test]
fn a_run_sends_what_virtual_time_sends_on_any_cores_and_each_time() {
    for (releases, word) in [
        (ReleaseSource::Period, "releases=period"),
        (ReleaseSource::Packets, "releases=packets"),
    ] {
        let (wanted, counts) = in_virtual_time(INPUT, releases);
        assert!(!wanted.is_empty());
        for (cores, clusters) in [(1, ""), (4, ""), (4, "clusters=2,2"), (4, "")] {
            let guest = guest(INPUT).word(word).cores(cores);
            let (outcome, sent) = guest.word(clusters).succeed_sending();
            let text = String::from_utf8_lossy(&sent);
            assert_eq!(
                text,
                String::from_utf8_lossy(&wanted),
                "{word}, {cores} cores"
            );
            assert_eq!(counted(&outcome), counts);
            let none = |line: &str| line == "0 allocations while jobs ran";
            assert!(outcome.serial.lines().any(none), "{}", outcome.tail());
        }
    }
}

#[test]
fn a_pc_has_the_port_too() {
    let (wanted, _) = in_virtual_time(INPUT, ReleaseSource::Period);
    let (_, sent) = guest(INPUT).machine(Machine::Q35).succeed_sending();
    assert_eq!(sent, wanted);
}

#[test]
fn a_burst_beyond_the_room_is_lost_and_counted() {
    let burst = "5ms \"gap 1500\\ngap 2500\\ngap 3500\\ngap 4500\\n\"\n".repeat(80);
    let input = format!(
        "{burst}5ms \"{}\\n\"\n25ms \"gap 3000\\n\"\n",
        "x".repeat(300)
    );
    let (wanted, counts) = in_virtual_time(&input, ReleaseSource::Period);
    assert_eq!(
        (counts.packets + counts.lost_packets, counts.malformed),
        (321, 1)
    );
    assert!(counts.lost_packets > 100, "{counts:?}");
    let (outcome, sent) = guest(&input).cores(2).succeed_sending();
    assert_eq!(sent, wanted);
    let lost_bytes = counts.lost_bytes;
    assert_eq!(
        WireCounts {
            lost_bytes,
            ..counted(&outcome)
        },
        counts
    );
}

#[test]
fn a_wire_without_a_port_is_refused() {
    let outcome = Guest::new("cruise").end_in(Status::Usage);
    let reason = outcome.transcript.verdict().expect("checked before").reason;
    assert!(reason.starts_with("wire `radar` has no device"), "{reason}");
}
