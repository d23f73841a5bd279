//! A car that packets release, recorded on the machine, and replayed there and on the host.

use std::fs;
use std::time::Duration;

use cruise::{Releases, build, careful};
use fass::finish_create_dags;
use fass::shared::Wire;
use harness::Guest;
use recording::{EntryKind, Recording};
use tool::{recordings, system};
use virtual_time::VirtualTime;

/// The jobs of the DAG that keeps the run going.
const JOBS: u64 = 30;

/// The output of a radar.
const INPUT: &str = include_str!("../../../apps/cruise/gaps.txt");

fn guest() -> Guest {
    let jobs = format!("jobs={JOBS}");
    Guest::new("cruise").word(&jobs).word("releases=packets")
}

/// Records a run, and returns the file, and what was sent on the wire.
fn recorded() -> (Vec<u8>, String) {
    let log = system::new_log("cruise").expect("a folder for logs");
    let file = log.with_extension("rec");
    let guest = guest().cores(2).input(INPUT).records(&file, 256);
    let (_, sent) = guest.succeed_sending();
    let bytes = recordings::received(&file).expect("the guest has sent it");
    let _ = fs::remove_file(&file);
    (bytes, text(sent))
}

fn text(sent: Vec<u8>) -> String {
    String::from_utf8(sent).expect("the car sends text")
}

#[test]
fn a_sporadic_dag_is_replayed_without_its_packets_on_the_machine_and_on_the_host() {
    let (bytes, wanted) = recorded();
    let recording = Recording::read(&bytes).expect("it is whole");
    let signals = recording
        .entries()
        .filter(|entry| entry.what == EntryKind::Signal);
    let signals = signals.count() as u64;
    assert!(
        signals > 3 && wanted.lines().count() as u64 == signals,
        "{signals} {wanted}"
    );

    for (cores, policy) in [(1, "static"), (2, "edf"), (4, "static")] {
        let log = system::new_log("cruise").expect("a folder for logs");
        let file = log.with_extension("rec");
        fs::write(&file, &bytes).expect("it is our file");
        let guest = guest().cores(cores).word(&format!("policy={policy}"));
        let (outcome, sent) = guest.replays(&file).succeed_sending();
        let line = outcome.transcript.of_kind("replayed").next();
        let line = line.expect("it says what came of it");
        let number = |name| line.number_at(name).expect("the line has it");
        assert_eq!([number("compared"), number("uncompared")], [signals, 0]);
        assert_eq!(text(sent), wanted, "{cores} cores, {policy}");
    }

    for cores in [1, 2, 4, 8] {
        let wire = Wire::new("radar");
        let machine = VirtualTime::new().cores(cores).connect(&wire);
        let machine = machine.replay(&bytes).expect("it is whole");
        let dags = build(&wire, Releases::Packets, careful, JOBS);
        finish_create_dags(&dags).expect("it is sound");
        machine.arrive_at(&wire, Duration::from_millis(1), b"gap 1\n");
        let report = machine.run();
        assert_eq!((report.compared, report.divergence), (signals, None));
        assert_eq!(text(machine.sent(&wire)), wanted, "{cores} cores");
    }
}
