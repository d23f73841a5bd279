//! The rules C1 to C5: a DAG that comes to its end.

mod support;

use sched_dag::{Activation, DagSpec, OverrunPolicy};
use support::bench::{Bench, DAG};
use support::{dag, overrunning};

/// A job every 100 ns without end, due within 250 ns, at most one in flight.
fn spec() -> DagSpec {
    let spec = DagSpec {
        jobs: None,
        ..dag(100, 250, 1, &[1], &[])
    };
    overrunning(spec, 1, OverrunPolicy::Queue)
}

fn sporadic() -> DagSpec {
    DagSpec {
        activation: Activation::Sporadic,
        ..spec()
    }
}

#[test]
fn c1_a_closed_dag_releases_nothing_at_the_instant_of_a_release_neither() {
    let mut bench = Bench::new(spec());
    assert_eq!(bench.time(0), "released 0");
    assert_eq!(bench.complete(10), "Met 0");
    assert_eq!(bench.close(100), "closed 0");
    assert_eq!(bench.scheduler.next_event_ns(), None);
    assert_eq!(bench.time(500), "");
    let statistics = bench.scheduler.statistics(DAG);
    assert_eq!((statistics.released, statistics.skips), (1, 0));
}

#[test]
fn c1_a_kept_signal_is_forgotten() {
    let mut bench = Bench::new(sporadic());
    assert_eq!(bench.signal(5), "released 0");
    assert_eq!(bench.complete(10), "Met 0");
    assert_eq!(bench.signal(20), "", "it is due at 105");
    assert_eq!(bench.close(30), "closed 0");
    assert_eq!(bench.time(200), "");
    assert!(bench.scheduler.is_finished());
}

#[test]
fn c2_what_waits_is_skipped_at_the_closing() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    bench.time(200);
    assert_eq!(bench.scheduler.waiting(DAG), 2);
    assert_eq!(bench.close(240), "closed 0, skipped 1, skipped 2");
    assert_eq!(bench.complete(250), "Met 0");
    assert!(bench.scheduler.is_finished());
}

#[test]
fn c3_what_is_in_flight_ends_and_may_be_late() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    assert_eq!(bench.close(50), "closed 0");
    assert!(!bench.scheduler.is_finished());
    assert_eq!(bench.scheduler.next_event_ns(), Some(251));
    assert_eq!(bench.time(251), "missed 0");
    assert_eq!(bench.complete(260), "Missed 0");
}

#[test]
fn c4_a_closed_dag_is_over_when_nothing_is_in_flight() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    bench.close(50);
    assert!(!bench.scheduler.is_over(DAG));
    bench.complete(60);
    assert!(bench.scheduler.is_over(DAG) && !bench.scheduler.is_ended(DAG));

    let mut bench = Bench::new(sporadic());
    bench.close(5);
    assert_eq!(bench.signal(7), "");
    let statistics = bench.scheduler.statistics(DAG);
    assert_eq!((statistics.signals, statistics.dropped_signals), (1, 1));
    assert!(bench.scheduler.is_over(DAG));
}

#[test]
fn c5_a_closed_dag_is_neither_paused_nor_resumed_and_faults_end_it() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    assert_eq!(bench.pause(20), "off 0");
    assert_eq!(bench.close(50), "closed 0");
    assert_eq!(bench.close(51), "", "once");
    assert_eq!(bench.pause(52), "");
    assert_eq!(bench.resume(53), "");
    let instance = bench.running.take().expect("job 0 runs");
    let failed = bench.at(60, |moment, log| moment.fail(instance, log));
    assert_eq!(failed, "ended 0, DagEnded 0");
    assert!(bench.scheduler.is_ended(DAG) && bench.scheduler.is_finished());
}
