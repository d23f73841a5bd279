//! The car in virtual time: which speeds it sends for which gaps.

use std::time::Duration;

use cruise::{ReleaseSource, build};
use fass::commit::Overheads;
use fass::finish_create_dags;
use fass::shared::Wire;
use virtual_time::{Silent, VirtualTime};

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

#[test]
fn the_car_follows_fresh_gaps_and_stops_without() {
    let wire = Wire::new("radar");
    let machine = VirtualTime::new().connect(&wire).silent(Silent::Wcet);
    // The most that a network card takes of a core.
    let machine = machine.overheads(Overheads {
        device_ns: 4_000,
        device_distance_ns: 100_000,
        ..Overheads::NONE
    });
    let dags = build(&wire, ReleaseSource::Period, 10);
    let commit = finish_create_dags(&dags).expect("it is sound");
    assert!(
        commit
            .answers()
            .iter()
            .all(|answer| answer.verdict.bound().is_some())
    );
    machine.arrive_at(&wire, ms(5), b"gap 1");
    machine.arrive_at(&wire, ms(15), b"111\ngap 3000\r\ngap -3\ngap much\n");
    let report = machine.run();
    assert_eq!(report.violations(), []);
    let speeds = String::from_utf8(machine.sent(&wire)).unwrap();
    let speeds: Vec<u32> = (speeds
        .lines()
        .map(|line| line.strip_prefix("speed ").unwrap()))
    .map(|speed| speed.parse().unwrap())
    .collect();
    assert_eq!(speeds, [0, 0, 100, 200, 300, 400, 500, 0, 0, 0]);
    assert_eq!((wire.counts().packets, wire.counts().malformed), (4, 2));
}

#[test]
fn released_by_packets_it_answers_each_but_not_too_often() {
    let wire = Wire::new("radar");
    let machine = VirtualTime::new().connect(&wire).silent(Silent::Wcet);
    finish_create_dags(&build(&wire, ReleaseSource::Packets, 10)).expect("it is sound");
    for at in [5, 6, 7, 40] {
        machine.arrive_at(&wire, ms(at), b"gap 2100\n");
    }
    let report = machine.run();
    let cruise = report.jobs.iter().filter(|job| job.dag.0 == 0);
    let releases: Vec<u64> = cruise
        .filter_map(|job| Some(job.release_ns? / 1_000_000))
        .collect();
    assert_eq!(releases, [5, 15, 40]);
    assert_eq!(machine.sent(&wire), b"speed 10\nspeed 20\nspeed 30\n");
}

#[test]
fn without_a_link_the_car_brakes_until_there_is_one() {
    let wire = Wire::new("radar");
    let machine = VirtualTime::new().connect(&wire).silent(Silent::Wcet);
    finish_create_dags(&build(&wire, ReleaseSource::Period, 12)).expect("it is sound");
    let run_to = |to| machine.run_for(ms(to));
    run_to(25);
    wire.link().set(false).unwrap();
    run_to(40);
    wire.link().set(true).unwrap();
    let report = machine.run();
    assert_eq!(report.violations(), []);
    let jobs = ["cruise", "brake", "watch"].map(|dag| report.statistics(dag).completed);
    // At 30 ms both have a job: `watch` looks then.
    assert_eq!(jobs, [8, 4, 12]);
}
