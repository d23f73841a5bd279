//! Bytes in and out: what arrives, what is sent, what is lost, and when.

mod support;

use std::fmt::Write;

use fass::{
    Dag, Framing, Packet, Received, Sender, Wire, WireOptions, create_dag, finish_create_dags,
};
use support::{ms, named, run};
use virtual_time::{Silent, VirtualTime};

fn number(packet: &[u8]) -> Option<u32> {
    str::from_utf8(packet).ok()?.parse().ok()
}

/// Each job's packets, as numbers and the time of each in ms.
type Seen = support::sharing::Seen<Vec<(u32, u64)>>;

fn look(seen: &Seen) -> impl FnMut(Received<'_, u32>) + Send + use<> {
    let seen = seen.clone();
    move |packets| {
        let look = |packet: Packet<u32>| (packet.value, packet.received_ns / 1_000_000);
        seen.add(packets.map(look).collect());
    }
}

/// A DAG of one subtask that receives every 10 ms, for `jobs` jobs.
fn periodic(wire: &Wire, jobs: u64, seen: &Seen) -> Dag {
    let dag = create_dag();
    dag.jobs(jobs).relative_deadline(ms(10));
    dag.period(ms(10))
        .using(wire.receiving(number))
        .source(look(seen))
        .register(named("receive").wcet(ms(1)));
    dag
}

#[test]
fn a_periodic_source_takes_all_that_came_since_its_last_job() {
    let (wire, seen) = (Wire::new("numbers"), Seen::default());
    let machine = VirtualTime::new();
    finish_create_dags(&[periodic(&wire, 4, &seen)]).unwrap();
    machine.arrive_at(&wire, ms(1), b"1\n2");
    machine.arrive_at(&wire, ms(4), b"3\nnone\n4\n");
    machine.arrive_at(&wire, ms(20), b"5\n"); // at a release: that job has it
    machine.run();
    let jobs = [vec![], vec![(1, 1), (23, 4), (4, 4)], vec![(5, 20)], vec![]];
    assert_eq!(seen.all(), jobs);
    let counts = wire.counts();
    assert_eq!((counts.packets, counts.bytes, counts.malformed), (5, 9, 1));
}

#[test]
fn a_packet_raises_the_sporadic_dag_that_receives_it() {
    let (wire, seen) = (Wire::new("numbers"), Seen::default());
    let dag = create_dag();
    dag.relative_deadline(ms(5));
    let attributes = named("receive").wcet(ms(1));
    dag.sporadic(ms(10));
    let receiving = dag.using(wire.receiving(number));
    receiving.source(look(&seen)).register(attributes);
    let machine = VirtualTime::new().silent(Silent::Wcet);
    finish_create_dags(&[dag]).unwrap();
    machine.arrive_at(&wire, ms(3), b"7");
    machine.arrive_at(&wire, ms(5), b"\n"); // whole now
    machine.arrive_at(&wire, ms(6), b"8\n"); // early: at 15 ms
    machine.arrive_at(&wire, ms(9), b"9\n10\n"); // no signal is kept besides, no packet is lost
    machine.arrive_at(&wire, ms(40), b"\n\n"); // no packet
    machine.arrive_at(&wire, ms(50), b"11\n");
    let report = machine.run();
    let releases: Vec<_> = report
        .jobs
        .iter()
        .map(|job| job.release_ns / 1_000_000)
        .collect();
    assert_eq!(releases, [5, 15, 50]);
    assert_eq!(
        seen.all(),
        [vec![(7, 5)], vec![(8, 6), (9, 9), (10, 9)], vec![(11, 50)]]
    );
    assert_eq!(report.violations(), []);
}

#[test]
fn a_wire_without_room_loses_the_newest_packets_and_counts_them() {
    let (room_bytes, seen) = (64, Seen::default());
    let options = WireOptions {
        longest_bytes: 4,
        room_bytes,
        ..WireOptions::default()
    };
    let wire = Wire::with("numbers", options);
    let machine = VirtualTime::new();
    finish_create_dags(&[periodic(&wire, 3, &seen)]).unwrap();
    // 14 bytes each, so there is room for four; and one that is too long.
    machine.arrive_at(&wire, ms(1), b"11\n12\n13\n14\n15\n16\n54321\n");
    machine.arrive_at(&wire, ms(11), b"17\n");
    machine.run();
    let jobs = [
        vec![],
        vec![(11, 1), (12, 1), (13, 1), (14, 1)],
        vec![(17, 11)],
    ];
    assert_eq!(seen.all(), jobs);
    let counts = wire.counts();
    assert_eq!(
        (counts.packets, counts.lost_packets, counts.lost_bytes),
        (5, 2, 4)
    );
    assert_eq!(counts.malformed, 1);
}

#[test]
fn what_is_not_taken_stays_for_the_next_job() {
    let (wire, seen) = (Wire::new("numbers"), Seen::default());
    let mut look = look(&seen);
    let dag = create_dag();
    dag.jobs(3).relative_deadline(ms(10));
    let one_by_one = move |mut packets: Received<'_, u32>| {
        let _first = packets.next();
        if packets.next().is_some() {
            look(packets);
        }
    };
    let attributes = named("receive");
    (dag.period(ms(10)).using(wire.receiving(number)))
        .source(one_by_one)
        .register(attributes);
    let machine = VirtualTime::new();
    finish_create_dags(&[dag]).unwrap();
    machine.arrive_at(&wire, ms(1), b"1\n");
    machine.arrive_at(&wire, ms(11), b"2\n3\n4\n");
    machine.run();
    assert_eq!(seen.all(), [[(4, 11)]]);
}

/// A DAG whose sink sends each job's number, and panics in job 1 before it is complete.
fn sending(wire: &Wire, jobs: u64, panics: bool) -> Dag {
    let (mut job, dag) = (0_u32.., create_dag());
    dag.jobs(jobs);
    let source = move || (job.next().expect("it has no end"),);
    dag.register_periodic_subtask(source, vec!["job"], ms(10), named("count"));
    dag.using(wire.sending())
        .subtask(move |mut wire: Sender<'_>, (job,): (u32,)| {
            wire.send(format!("job {job}").as_bytes());
            assert!(!panics || job != 1, "job 1");
            wire.send(b"\n");
        })
        .reads(&["job"])
        .due(ms(10))
        .register(named("send").wcet(ms(3)));
    dag
}

#[test]
fn r3_bytes_go_when_their_instance_is_complete() {
    let wire = Wire::new("out");
    let machine = VirtualTime::new().connect(&wire).silent(Silent::Wcet);
    finish_create_dags(&[sending(&wire, 2, false)]).unwrap();
    machine.run_for(ms(2));
    assert_eq!(machine.sent(&wire), b"");
    machine.run_for(ms(1));
    assert_eq!(machine.sent(&wire), b"job 0\n");
    machine.run();
    assert_eq!(machine.sent(&wire), b"job 0\njob 1\n");
    assert_eq!(wire.counts().sent_bytes, 12);
}

#[test]
fn an_instance_that_fails_sends_nothing() {
    let wire = Wire::new("out");
    let machine = VirtualTime::new().connect(&wire).contain_panics();
    finish_create_dags(&[sending(&wire, 3, true)]).unwrap();
    assert_eq!(machine.run().panics.len(), 1);
    assert_eq!(machine.sent(&wire), b"job 0\n");
}

#[test]
fn an_instance_that_sends_too_much_sends_nothing_and_that_is_counted() {
    let options = WireOptions {
        room_bytes: 16,
        ..WireOptions::default()
    };
    let wire = Wire::with("out", options);
    let mut lengths = [16, 17, 5].into_iter();
    let dag = create_dag();
    dag.jobs(3).relative_deadline(ms(10));
    let send = move |mut wire: Sender<'_>| wire.send(&vec![b'x'; lengths.next().unwrap()]);
    let attributes = named("send");
    (dag.period(ms(10)).using(wire.sending()))
        .source(send)
        .register(attributes);
    let machine = VirtualTime::new().connect(&wire);
    run(&machine, &[dag]);
    assert_eq!(machine.sent(&wire).len(), 21);
    let counts = wire.counts();
    assert_eq!((counts.sent_bytes, counts.unsent_bytes), (21, 17));
}

#[test]
fn a_decoder_that_panics_is_contained_like_a_function() {
    fn hostile(packet: &[u8]) -> Option<u32> {
        Some(packet.first().map_or(0, |byte| 10 / u32::from(byte - b'0')))
    }
    let (bad, good, seen) = (Wire::new("bad"), Wire::new("good"), Seen::default());
    let dag = create_dag();
    dag.jobs(3).relative_deadline(ms(10));
    let attributes = named("receive");
    let count = |packets: Received<'_, u32>| assert_eq!(packets.count(), 0);
    (dag.period(ms(10)).using(bad.receiving(hostile)))
        .source(count)
        .register(attributes);
    let machine = VirtualTime::new().contain_panics();
    let healthy = periodic(&good, 3, &seen);
    finish_create_dags(&[dag.clone(), healthy.clone()]).unwrap();
    machine.arrive_at(&bad, ms(1), b"0\n");
    machine.arrive_at(&good, ms(1), b"1\n");
    let report = machine.run();
    assert_eq!(report.panics.len(), 1);
    assert_eq!(report.panics[0].message, "attempt to divide by zero");
    assert_eq!(
        (
            report.dag(&dag).statistics().completed,
            report.dag(&healthy).statistics().completed
        ),
        (1, 3)
    );
    assert_eq!(seen.all(), [vec![], vec![(1, 1)], vec![]]);
}

#[test]
fn a_replay_takes_what_the_receiver_wrote_and_no_bytes() {
    let build = |wire: &Wire| {
        let dag = create_dag();
        dag.name("sum").record::<u32>("sum");
        let sum = |packets: Received<'_, u32>| (packets.map(|packet| packet.value).sum::<u32>(),);
        let attributes = named("receive");
        dag.sporadic(ms(10));
        dag.using(wire.receiving(number))
            .source(sum)
            .writes(&["sum"])
            .register(attributes);
        dag.using(wire.sending())
            .subtask(|mut wire: Sender<'_>, (sum,): (u32,)| writeln!(wire, "{sum}").unwrap())
            .reads(&["sum"])
            .due(ms(10))
            .register(named("send"));
        dag
    };
    let wire = Wire::new("numbers");
    let machine = VirtualTime::new().connect(&wire);
    finish_create_dags(&[build(&wire)]).unwrap();
    machine.arrive_at(&wire, ms(3), b"1\n2\n");
    machine.arrive_at(&wire, ms(4), b"5\n");
    machine.run();
    assert_eq!(machine.sent(&wire), b"3\n5\n");
    let recording = machine.recording();

    let wire = Wire::new("numbers");
    let machine = VirtualTime::new()
        .connect(&wire)
        .replay(&recording)
        .unwrap();
    finish_create_dags(&[build(&wire)]).unwrap();
    machine.arrive_at(&wire, ms(1), b"77\n"); // raises nothing
    let report = machine.run();
    assert_eq!(machine.sent(&wire), b"3\n5\n");
    assert_eq!((report.jobs.len(), report.divergence), (2, None));
}

#[test]
fn each_end_of_a_wire_has_one_subtask_and_a_source_receives() {
    let options = WireOptions {
        framing: Framing::Chunks,
        ..WireOptions::default()
    };
    let wire = Wire::with("radio", options);
    let (_receiving, _sending) = (wire.receiving(number), wire.sending());
    let message = |claim: &dyn Fn()| {
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(claim)).unwrap_err();
        panic.downcast::<String>().unwrap()
    };
    assert_eq!(
        *message(&|| _ = wire.receiving(number)),
        "another subtask receives on wire `radio`; let that one do it, or make another wire"
    );
    assert!(message(&|| _ = wire.sending()).starts_with("another subtask sends on wire"));
    let dag = create_dag();
    dag.name("far");
    let receive = |_: Received<'_, u32>, _: (u32,)| ();
    let attributes = named("late");
    (dag.using(Wire::new("radio").receiving(number)))
        .subtask(receive)
        .reads(&["x"])
        .due(ms(10))
        .register(attributes);
    let _machine = VirtualTime::new();
    let refused = finish_create_dags(&[dag]).unwrap_err().to_string();
    assert!(
        refused.contains("subtask `late` of dag `far` is no source and receives on wire `radio`; ")
    );
}
