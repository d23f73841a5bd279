//! The echo in virtual time.

use std::time::Duration;

use echo::{build, wire};
use fass::finish_create_dags;
use virtual_time::{Silent, VirtualTime};

#[test]
fn each_packet_goes_back_whole_to_whom_it_came_from() {
    let wire = wire();
    let machine = VirtualTime::new().connect(&wire).silent(Silent::Wcet);
    finish_create_dags(&build(&wire, Duration::from_micros(200), 100)).expect("it is sound");
    let peers: Vec<_> = (1..=3)
        .map(|peer| format!("10.0.2.2:{peer}").parse().unwrap())
        .collect();
    let packet = |number: usize| vec![number.to_le_bytes()[0]; 1 + number * 49];
    // Several at once, and more than a job takes.
    for number in 0..30 {
        let at = Duration::from_micros(1_000 + 700 * (number / 12) as u64);
        machine.packet_at(&wire, at, peers[number % 3], &packet(number));
    }
    let report = machine.run();
    let sent = machine.sent_packets(&wire);
    let expected = (0..30).map(|number| (packet(number), Some(peers[number % 3])));
    assert!(sent.into_iter().eq(expected));
    assert_eq!(report.violations(), []);
    assert_eq!(report.statistics("echo").misses, 0);
    assert_eq!(wire.counts().lost_packets, 0);
}
