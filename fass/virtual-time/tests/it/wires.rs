//! Bytes in and out: what arrives, what is sent, what is lost, and when.

use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use crate::support::{commit, every, job_numbers, ms, named, taking};
use fass::shared::{
    Framing, Packet, Received, Sender, TimedOut, Wire, WireOptions, WireReader, WireWriter,
};
use fass::{Dag, create_dag, finish_create_dags, sleep};
use virtual_time::{Report, Silent, VirtualTime};

fn number(packet: &[u8]) -> Option<u32> {
    str::from_utf8(packet).ok()?.parse().ok()
}

fn with_room(name: &str, room: usize) -> Wire {
    let options = WireOptions {
        longest_bytes: 4,
        room,
        ..WireOptions::default()
    };
    Wire::with(name, options)
}

/// Each job's packets, as numbers and the time of each in ms.
type Seen = crate::support::Seen<Vec<(u32, u64)>>;

fn look(seen: &Seen) -> impl FnMut(Received<'_, u32>) + Send + use<> {
    let seen = seen.clone();
    move |packets| {
        let look = |packet: Packet<u32>| (packet.value, packet.received_ns / 1_000_000);
        seen.add(packets.map(look).collect());
    }
}

/// A DAG of one subtask that receives every 10 ms, for `jobs` jobs.
fn periodic(
    wire: &Wire,
    jobs: u64,
    receive: impl FnMut(Received<'_, u32>) + Send + 'static,
) -> Dag {
    let dag = every(10, "periodic");
    let using = dag.jobs(jobs).using(wire.receiving(number));
    using.source(receive).register(taking("receive", 1));
    dag
}

/// Lets bytes arrive at these milliseconds.
fn arrive(machine: &VirtualTime, wire: &Wire, arrivals: &[(u64, &[u8])]) {
    for (time_ms, bytes) in arrivals {
        machine.arrive_at(wire, ms(*time_ms), bytes);
    }
}

#[test]
fn a_periodic_source_takes_all_that_came_since_its_last_job() {
    let (wire, seen) = (Wire::new("numbers"), Seen::default());
    let machine = VirtualTime::new();
    commit(&[periodic(&wire, 4, look(&seen))]);
    // The last one at a release: that job has it.
    let arrivals: [(u64, &[u8]); 3] = [(1, b"1\n2"), (4, b"3\nnone\n4\n"), (20, b"5\n")];
    arrive(&machine, &wire, &arrivals);
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
    dag.relative_deadline(ms(5)).sporadic(ms(10));
    let receiving = dag.using(wire.receiving(number)).source(look(&seen));
    receiving.register(taking("receive", 1));
    let machine = VirtualTime::new().silent(Silent::Wcet);
    commit(&[dag]);
    let arrivals: [(u64, &[u8]); 6] = [
        (3, b"7"),
        (5, b"\n"),      // whole now
        (6, b"8\n"),     // early: at 15 ms
        (9, b"9\n10\n"), // no signal is kept besides, no packet is lost
        (40, b"\n\n"),   // no packet
        (50, b"11\n"),
    ];
    arrive(&machine, &wire, &arrivals);
    let report = machine.run();
    let releases = (report.jobs.iter()).filter_map(|job| Some(job.release_ns? / 1_000_000));
    assert_eq!(releases.collect::<Vec<_>>(), [5, 15, 50]);
    let jobs = [vec![(7, 5)], vec![(8, 6), (9, 9), (10, 9)], vec![(11, 50)]];
    assert_eq!(seen.all(), jobs);
    assert_eq!(report.violations(), []);
}

#[test]
fn a_wire_without_room_loses_the_newest_packets_and_counts_them() {
    let (wire, seen) = (with_room("numbers", 4), Seen::default());
    let machine = VirtualTime::new();
    commit(&[periodic(&wire, 3, look(&seen))]);
    // There is room for four; and one is too long.
    let many = b"11\n12\n13\n14\n15\n16\n54321\n";
    arrive(&machine, &wire, &[(1, many), (11, b"17\n")]);
    machine.run();
    let four = (11..=14).map(|packet| (packet, 1)).collect();
    assert_eq!(seen.all(), [vec![], four, vec![(17, 11)]]);
    let counts = wire.counts();
    let lost = (counts.lost_packets, counts.lost_bytes, counts.malformed);
    assert_eq!((counts.packets, lost), (5, (2, 4, 1)));
}

#[test]
fn r3_bytes_go_when_their_instance_is_complete_and_not_if_it_fails_or_sends_too_much() {
    let wire = with_room("out", 1);
    let machine = VirtualTime::new().connect(&wire).contain_panics();
    let dag = every(10, "sending");
    let count = dag.jobs(4).source(job_numbers(0)).writes(&["job"]);
    count.register(named("count"));
    let send = |mut wire: Sender<'_>, (job,): (u64,)| {
        wire.send(format!("job {job}").as_bytes());
        assert!(job != 3, "before it is complete");
        wire.send(if job == 1 { &[b'x'; 2000] } else { b"\n" });
    };
    let sink = dag.using(wire.sending()).subtask(send).reads(&["job"]);
    sink.register(taking("send", 3));
    commit(&[dag]);
    machine.run_for(ms(2));
    assert_eq!(machine.sent(&wire), b"");
    machine.run_for(ms(1));
    assert_eq!(machine.sent(&wire), b"job 0\n");
    assert_eq!(machine.run().panics.len(), 1);
    assert_eq!(machine.sent(&wire), b"job 0\njob 2\n");
    let counts = wire.counts();
    assert_eq!((counts.sent_bytes, counts.unsent_bytes), (12, 2005));
}

#[test]
fn a_decoder_that_panics_is_contained_like_a_function() {
    let hostile = |packet: &[u8]| Some(10 / u32::from(packet[0] - b'0'));
    let (bad, good, seen) = (Wire::new("bad"), Wire::new("good"), Seen::default());
    let dag = every(10, "hostile");
    let count = |packets: Received<'_, u32>| assert_eq!(packets.count(), 0);
    let using = dag.jobs(3).using(bad.receiving(hostile));
    using.source(count).register(named("receive"));
    let machine = VirtualTime::new().contain_panics();
    commit(&[dag, periodic(&good, 3, look(&seen))]);
    arrive(&machine, &bad, &[(1, b"0\n")]);
    arrive(&machine, &good, &[(1, b"1\n")]);
    let report = machine.run();
    assert_eq!(report.panics.len(), 1);
    assert_eq!(report.panics[0].message, "attempt to divide by zero");
    let completed = ["hostile", "periodic"].map(|dag| report.statistics(dag).completed);
    assert_eq!(completed, [1, 3]);
    assert_eq!(seen.all(), [vec![], vec![(1, 1)], vec![]]);
}

#[test]
fn a_replay_takes_what_the_receiver_wrote_and_no_bytes() {
    let build = |wire: &Wire| {
        let dag = create_dag();
        dag.name("sum").relative_deadline(ms(10));
        dag.record::<u32>("sum").sporadic(ms(10));
        let sum = |packets: Received<'_, u32>| (packets.map(|packet| packet.value).sum::<u32>(),);
        let source = dag.using(wire.receiving(number)).source(sum);
        source.writes(&["sum"]).register(named("receive"));
        let send = |mut wire: Sender<'_>, (sum,): (u32,)| writeln!(wire, "{sum}").unwrap();
        let sink = dag.using(wire.sending()).subtask(send).reads(&["sum"]);
        sink.register(named("send"));
        commit(&[dag]);
    };
    let wire = Wire::new("numbers");
    let machine = VirtualTime::new().connect(&wire);
    build(&wire);
    arrive(&machine, &wire, &[(3, b"1\n2\n"), (4, b"5\n")]);
    machine.run();
    assert_eq!(machine.sent(&wire), b"3\n5\n");
    let recording = machine.recording();

    let wire = Wire::new("numbers");
    let machine = VirtualTime::new()
        .connect(&wire)
        .replay(&recording)
        .unwrap();
    build(&wire);
    arrive(&machine, &wire, &[(1, b"77\n")]); // raises nothing
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
        let panic = catch_unwind(AssertUnwindSafe(claim)).unwrap_err();
        panic.downcast::<String>().unwrap()
    };
    assert_eq!(
        *message(&|| _ = wire.receiving(number)),
        "another subtask receives on wire `radio`; let that one do it, or make another wire"
    );
    assert!(message(&|| _ = wire.reading(number)).starts_with("another subtask receives"));
    assert!(message(&|| _ = wire.sending()).starts_with("another subtask sends on wire"));
    assert!(message(&|| _ = wire.writing()).starts_with("another subtask sends"));
    let dag = create_dag();
    let receive = |_: Received<'_, u32>, _: (u32,)| ();
    let using = dag.name("far").using(Wire::new("radio").receiving(number));
    let subtask = using.subtask(receive).reads(&["x"]).due(ms(10));
    subtask.register(named("late"));
    let _machine = VirtualTime::new();
    let refused = finish_create_dags(&[dag]).unwrap_err().to_string();
    let said = "subtask `late` of dag `far` is no source and receives on wire `radio`; ";
    assert!(refused.contains(said), "{refused}");
}

/// The response times of jobs in milliseconds.
fn responses_ms(report: &Report) -> Vec<u64> {
    let times_ns = report.jobs.iter().filter_map(|job| job.response_time_ns());
    times_ns.map(|ns| ns / 1_000_000).collect()
}

#[test]
fn a_read_ends_with_the_next_packet_or_at_its_limit() {
    let (seen, keep) = crate::support::Seen::shared();
    let (wire, dag) = (Wire::new("numbers"), every(20, "reading"));
    let read = move |wire: WireReader<Option<u32>>| {
        let keep = keep.clone();
        async move { keep.add(wire.read().await) }
    };
    let using = dag.jobs(8).using(wire.reading(number));
    let read = using.async_source(read);
    read.register(taking("read", 1).wait(ms(5)).wcet(ms(1)));
    let machine = VirtualTime::new().silent(Silent::Wcet);
    commit(&[dag]);
    let arrivals: [(u64, &[u8]); 8] = [
        (3, b"0\n"),
        (27, b"2"), // too late for job 1, so of job 2
        (28, b"\n"),
        (66, b"3\n"), // at the instant of the limit
        (83, b"x\n5\n\n"),
        (121, b"\n\n6\n"),
        (140, b"7\n"), // while the function has not begun to read
        (150, b"8\n9\n"),
    ];
    arrive(&machine, &wire, &arrivals);
    let report = machine.run();
    assert_eq!(report.violations(), []);
    assert_eq!(responses_ms(&report), [4, 7, 2, 7, 4, 2, 2, 2]);
    let read = [Some(0), None, Some(2), Some(3)];
    let mut read: Vec<_> = read.map(|read| read.map(Some).ok_or(TimedOut)).into();
    read.extend([Ok(None), Ok(Some(5)), Ok(Some(6)), Ok(Some(7))]);
    assert_eq!(seen.all(), read);
}

#[test]
fn a_write_ends_when_all_has_gone_and_what_finds_no_room_never_goes() {
    for is_connected in [true, false] {
        let (seen, keep) = crate::support::Seen::shared();
        let (wire, dag) = (with_room("out", 2), every(20, "writing"));
        let mut bytes = [7, 9, 2000].into_iter();
        let write = move |wire: WireWriter| {
            let (keep, count) = (keep.clone(), bytes.next().unwrap_or(1));
            async move {
                keep.add(wire.write(&vec![b'x'; count]).await);
                assert_ne!(count, 1, "after the wait, and no other byte goes");
                let _ = wire.write(b"").await;
            }
        };
        let write = dag.jobs(4).using(wire.writing()).async_source(write);
        write.register(named("write").wait(ms(5)).wait(ms(2)));
        let machine = VirtualTime::new().contain_panics();
        let machine = match is_connected {
            true => machine.connect(&wire),
            false => machine,
        };
        commit(&[dag]);
        let report = machine.run();
        assert_eq!(report.violations(), []);
        assert_eq!(report.panics.len(), 1);
        let counts = wire.counts();
        match is_connected {
            true => {
                assert_eq!(responses_ms(&report), [0, 0, 5, 0]);
                assert_eq!(seen.all(), [Ok(()), Ok(()), Err(TimedOut), Ok(())]);
                assert_eq!(machine.sent(&wire), [b'x'; 17], "not those of the third");
                assert_eq!((counts.sent_bytes, counts.unsent_bytes), (17, 2000));
            }
            false => {
                assert_eq!(responses_ms(&report), [7, 7, 7, 5]);
                assert_eq!(seen.all(), [Err(TimedOut); 4]);
                assert_eq!((counts.sent_bytes, counts.unsent_bytes), (16, 2001));
            }
        }
    }
}

#[test]
fn a_replay_reads_and_writes_what_the_record_has_without_the_device() {
    // A modem that answers late, or not at all.
    let build = |wire: &Wire| {
        let dag = every(20, "modem");
        dag.jobs(20).record::<u64>("job").record::<u64>("sum");
        let source = dag.source(job_numbers(1)).writes(&["job"]);
        source.register(taking("count", 1));
        let ask = |(input, output): (WireReader<Option<u32>>, WireWriter), (job,): (u64,)| async move {
            let written = output.write(format!("{job}?").as_bytes()).await;
            sleep(Duration::from_micros(job)).await;
            let first = input.read().within(ms(2)).await;
            let second = input.read().await;
            let of = |read: Result<Option<u32>, _>| read.map_or(77, Option::unwrap_or_default);
            let time = fass::now_ns();
            (u64::from(of(first) + 1_000 * of(second)) + time + u64::from(written.is_ok()),)
        };
        let uses = (wire.reading(number).record(), wire.writing().record());
        let ask = dag.using(uses).async_subtask(ask);
        let stated = named("ask").wait(ms(1)).wait(ms(1)).wait(ms(5));
        let ask = ask.reads(&["job"]).writes(&["sum"]);
        ask.register(stated.wait(ms(5)));
        let sink = dag.subtask(|_: (u64,)| ()).reads(&["sum"]);
        sink.register(named("sink"));
        commit(&[dag]);
    };
    let wire = Wire::new("modem");
    let machine = VirtualTime::new().connect(&wire);
    build(&wire);
    for number in 0..33_u64 {
        let time = Duration::from_micros(number * 11_003 % 400_000);
        machine.arrive_at(&wire, time, format!("{number}\n").as_bytes());
    }
    let recorded = machine.run();
    assert_eq!(recorded.violations(), []);
    let sent = machine.sent(&wire);
    let recording = machine.recording();

    let wire = Wire::new("modem");
    let machine = VirtualTime::new().connect(&wire);
    let machine = machine.replay(&recording).expect("it is whole");
    build(&wire);
    let report = machine.run();
    assert_eq!(report.violations(), []);
    assert_eq!((report.divergence.as_ref(), report.uncompared), (None, 0));
    assert_eq!(report.compared, 20);
    assert_eq!((machine.sent(&wire), wire.counts().packets), (sent, 0));
    let of_ask = |report: &Report| {
        let all = report.dag("modem").subtask("ask").into_iter();
        let finishes = all.map(|instance| instance.finish_ns);
        finishes.collect::<Vec<_>>()
    };
    assert_eq!(of_ask(&recorded), of_ask(&report));
}
