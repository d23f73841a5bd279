//! Two machines and the link between them: when packets arrive, and which do not.

use crate::support::{Seen, every, ms, named, taking};
use fass::shared::{Framing, Packet, Received, Sender, Wire, WireOptions};
use fass::{create_dag, finish_create_dags};
use virtual_time::{Link, LinkOptions, Report, Silent, VirtualTime};

fn wire(name: &str) -> Wire {
    let options = WireOptions {
        framing: Framing::Chunks,
        ..WireOptions::default()
    };
    Wire::with(name, options)
}

/// The left machine, whose jobs send their number each 10 ms, when they have executed for 1 ms.
fn sender(wire: &Wire, jobs: u64) -> VirtualTime {
    let machine = VirtualTime::new().silent(Silent::Wcet);
    let dag = every(10, "sender");
    let mut job = 0;
    let send = move |mut wire: Sender<'_>| {
        wire.send(&[job]);
        job += 1;
    };
    (dag.jobs(jobs).using(wire.sending()).source(send)).register(taking("send", 1));
    finish_create_dags(&[dag]).expect("it is sound");
    machine
}

/// The packets of each job, with their times in us.
type Heard = Seen<Vec<(u8, u64)>>;

/// The right one, whose DAG packets release, 2 ms apart at least.
fn hearer(wire: &Wire) -> (VirtualTime, Heard) {
    let (machine, seen) = (VirtualTime::new(), Heard::default());
    let (dag, own) = (create_dag(), seen.clone());
    dag.name("hearer").relative_deadline(ms(2)).sporadic(ms(2));
    let hear = move |all: Received<'_, u8>| {
        let look = |packet: Packet<u8>| (packet.value, packet.received_ns / 1_000);
        own.add(all.map(look).collect());
    };
    (dag.using(wire.receiving(|bytes| bytes.first().copied()))
        .source(hear))
    .register(named("hear"));
    finish_create_dags(&[dag]).expect("it is sound");
    (machine, seen)
}

const PLAIN: LinkOptions = LinkOptions {
    delay: ms(2),
    jitter: ms(0),
    keeps_order: false,
    lost_of: 0,
    offset: ms(0),
    seed: 5,
};

const WORSE: LinkOptions = LinkOptions {
    jitter: ms(25),
    lost_of: 4,
    ..PLAIN
};

/// Runs `jobs` jobs over such a link.
fn run(jobs: u64, change: LinkOptions) -> (Vec<(u8, u64)>, [Report; 2], Vec<u8>) {
    let [out, to] = ["out", "in"].map(wire);
    let left = sender(&out, jobs);
    let (right, heard) = hearer(&to);
    let mut link = Link::new([&left, &right], change);
    link.carry(0, &out, &to);
    // In parts that do not fit the steps.
    link.run_for(ms(7));
    let reports = link.run_for(ms(10 * jobs));
    let heard = heard.all().concat();
    (heard, reports, right.recording())
}

#[test]
fn packets_arrive_at_their_nanosecond_and_release_the_other_machine() {
    let (heard, [left, right], _) = run(3, PLAIN);
    assert_eq!(heard, [(0, 3_000), (1, 13_000), (2, 23_000)]);
    let releases = right.jobs.iter().filter_map(|job| job.release_ns);
    assert!(releases.eq([3_000_000, 13_000_000, 23_000_000]));
    for report in [left, right] {
        assert_eq!(report.violations(), []);
    }
    // The right machine begins later: what comes before is lost.
    let (heard, ..) = run(
        3,
        LinkOptions {
            offset: ms(5),
            ..PLAIN
        },
    );
    assert_eq!(heard, [(1, 8_000), (2, 18_000)]);
}

#[test]
fn loss_and_order_follow_from_the_seed() {
    let (heard, _, recording) = run(200, WORSE);
    assert!((120..180).contains(&heard.len()), "{}", heard.len());
    assert!(heard.iter().all(|(job, at_us)| {
        let sent_us = u64::from(*job) * 10_000 + 1_000;
        (sent_us + 2_000..=sent_us + 27_000).contains(at_us)
    }));
    assert!(!heard.is_sorted(), "some are overtaken");
    assert_eq!(run(200, WORSE).2, recording, "two runs are the same");
    let (ordered, ..) = run(
        200,
        LinkOptions {
            keeps_order: true,
            ..WORSE
        },
    );
    assert!(ordered.is_sorted() && ordered.len() == heard.len());
}

#[test]
fn a_link_that_is_cut_loses_what_is_sent_and_says_so() {
    let [out, to] = ["out", "in"].map(wire);
    let left = sender(&out, 9);
    let (right, heard) = hearer(&to);
    let mut link = Link::new([&left, &right], PLAIN);
    link.carry(0, &out, &to);
    for is_up in [true, false, true] {
        link.set_up(is_up);
        assert_eq!([&out, &to].map(|wire| wire.link().value()), [is_up; 2]);
        // What is on its way arrives.
        link.run_for(ms(32));
    }
    let jobs = heard.all().concat().into_iter().map(|(job, _)| job);
    assert_eq!(jobs.collect::<Vec<_>>(), [0, 1, 2, 3, 7, 8]);
}
