//! No allocation from a job's release to its completion.
//!
//! The program's allocator counts this thread's allocations. The DAG has what
//! could tempt a body to allocate: several inputs and outputs, fan-out, shared
//! and unique messages, 16 arguments, more than one job in flight, discards.

#[path = "../../../sched-dag/tests/it/counting.rs"]
pub(crate) mod counting;

use core::time::Duration;
use std::sync::Arc;

use crate::support::{commit, run_job};
use counting::allocated;
use fass::platform::Request;
use fass::shared::{DeviceEnd, Raiser, Received, Sample, Sender, Wire};
use fass::{SubtaskAttributes, Unique, create_dag};
use sched_dag::DagId;

const TOPICS: [&str; 16] = [
    "0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13", "14", "15",
];

#[test]
fn a_job_allocates_nothing() {
    let period = Duration::from_millis(10);
    let named = SubtaskAttributes::named;
    let dag = create_dag();
    dag.in_flight(3);
    let image = Arc::new([7_u8; 4096]);
    dag.register_periodic_subtask(
        move || (Arc::clone(&image), Unique::new([1_u64; 32])),
        vec!["image", "frame"],
        period,
        named("source"),
    );
    let wide = |(_, _): (Arc<[u8; 4096]>, Unique<[u64; 32]>)| {
        (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
    };
    dag.register_subtask(wide, vec!["image", "frame"], TOPICS.to_vec(), named("wide"));
    let narrow = |(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p)| {
        let values: [i32; 16] = [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p];
        assert!(values.iter().copied().eq(0..16), "each is in its place");
        (7_u64, [0_u8; 100])
    };
    dag.register_subtask(
        narrow,
        TOPICS.to_vec(),
        vec!["sum", "rest"],
        named("narrow"),
    );
    dag.register_sink_subtask(
        |(sum, _, image): (u64, [u8; 100], Arc<[u8; 4096]>)| assert_eq!(sum, u64::from(image[1])),
        vec!["sum", "rest", "image"],
        period,
        named("sink"),
    );
    let mut plan = commit(&[dag]);

    let before = allocated().0;
    for job in 0..1_000 {
        if job % 10 == 9 {
            plan.bodies[0][0].run(job);
            plan.bodies[0][1].discard(job);
            plan.bodies[0][2].discard(job);
            plan.bodies[0][3].discard(job);
        } else {
            run_job(&mut plan, job);
        }
    }
    assert_eq!(allocated().0 - before, 0);
    drop(vec![1]);
    assert!(allocated().0 > before, "the allocator counts");
}

#[test]
fn states_latest_values_signals_and_wires_allocate_nothing() {
    let period = Duration::from_millis(10);
    let named = SubtaskAttributes::named;
    let (dag, reader, answers) = (create_dag(), create_dag(), create_dag());
    for dag in [&dag, &reader, &answers] {
        dag.relative_deadline(period);
    }
    let signal = answers.sporadic(period);
    answers.source(|| ()).register(named("answer"));
    let (state, wire) = (dag.state("count", 0_u64), Wire::new("numbers"));
    let receiving = wire.receiving(|line| line.first().copied());
    type Used<'a> = (&'a mut u64, Raiser<'a>, Received<'a, u8>, Sender<'a>);
    dag.period(period)
        .using((state.update(), signal.raising(), receiving, wire.sending()))
        .source(|(count, mut signal, packets, mut wire): Used<'_>| {
            *count += 1;
            signal.raise();
            signal.raise();
            packets.for_each(|packet| wire.send(&[packet.value]));
            (*count,)
        })
        .writes(&["count"])
        .register(named("count"));
    let latest = dag.latest::<u64>("count");
    let read =
        |count: Option<Sample<'_, u64>>| assert!(count.is_some_and(|c| *c.value == c.job + 1));
    let source = reader.period(period).using(latest.sample()).source(read);
    source.register(named("read"));
    let mut plan = commit(&[dag, reader, answers]);
    let wire = DeviceEnd::of(&wire).unwrap();

    let before = allocated().0;
    let (mut signals, mut gone) = (0, 0);
    for job in 0..1_000 {
        wire.arrive(b"a\nb\n", job);
        plan.bodies[0][0].run(job);
        // However often it is raised and completed, a signal is one.
        for _ in 0..2 {
            plan.bodies[0][0].complete(job, &mut |request| {
                signals += u32::from(request == Request::Signal(DagId(2)));
            });
        }
        gone += std::iter::from_fn(|| wire.depart()).count();
        plan.bodies[1][0].run(job);
    }
    assert_eq!(allocated().0 - before, 0);
    assert_eq!((signals, gone), (1_000, 2_000));
}
