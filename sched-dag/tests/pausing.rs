//! The rules P1 to P5: a DAG that rests for a while.

mod support;

use sched_dag::{DagId, DagSpec, OverrunPolicy, Scheduler};
use support::bench::{Bench, DAG};
use support::{PREEMPTIVE, commit, dag, overrunning};

/// A job every 100 ns, due within 250 ns, at most one in flight.
fn spec(jobs: u64, overrun: OverrunPolicy) -> DagSpec {
    overrunning(dag(100, 250, jobs, &[1], &[]), 1, overrun)
}

#[test]
fn p1_a_paused_dag_skips_each_job_when_it_is_due() {
    for overrun in [
        OverrunPolicy::Queue,
        OverrunPolicy::Skip,
        OverrunPolicy::Abort,
    ] {
        let mut bench = Bench::new(spec(9, overrun));
        assert_eq!(bench.time(0), "released 0");
        assert_eq!(bench.complete(10), "Met 0");
        // At the very instant of a release, too.
        assert_eq!(bench.pause(100), "off 0, skipped 1");
        assert!(bench.scheduler.is_paused(DAG));
        assert_eq!(bench.scheduler.next_event_ns(), Some(200));
        assert_eq!(bench.time(200), "skipped 2");
        // A driver that comes late skips all that was due.
        assert_eq!(bench.time(420), "skipped 3, skipped 4");
        let statistics = bench.scheduler.statistics(DAG);
        let counts = (statistics.released, statistics.completed, statistics.skips);
        assert_eq!((counts, statistics.misses), ((1, 1, 4), 0));
    }
}

#[test]
fn p1_a_signal_to_a_paused_sporadic_dag_is_skipped() {
    let spec = DagSpec {
        activation: sched_dag::Activation::Sporadic,
        ..spec(9, OverrunPolicy::Queue)
    };
    let mut bench = Bench::new(spec);
    assert_eq!(bench.pause(5), "off 0");
    assert_eq!(bench.signal(7), "skipped 0");
    assert_eq!(bench.resume(200), "on 0");
    assert_eq!(bench.signal(210), "released 1");
}

#[test]
fn p2_what_waits_is_skipped_at_the_pause() {
    let mut bench = Bench::new(spec(9, OverrunPolicy::Queue));
    bench.time(0);
    assert_eq!(bench.time(100), "queued 1");
    assert_eq!(bench.time(200), "queued 2");
    assert_eq!(bench.pause(240), "off 0, skipped 1, skipped 2");
    assert_eq!(bench.scheduler.waiting(DAG), 0);
    assert_eq!(bench.complete(250), "Met 0");
    assert_eq!(bench.time(300), "skipped 3");
}

#[test]
fn p2_a_deadline_that_passed_before_the_pause_is_a_miss() {
    let mut bench = Bench::new(spec(9, OverrunPolicy::Queue));
    bench.time(0);
    bench.time(100);
    // Both deadlines, 250 and 350, have passed unnoticed.
    assert_eq!(
        bench.pause(360),
        "missed 0, missed 1, off 0, skipped 1, skipped 2, skipped 3"
    );
    assert_eq!(bench.complete(370), "Missed 0");
    assert_eq!(bench.scheduler.statistics(DAG).misses, 2);
}

#[test]
fn p3_what_is_in_flight_goes_on_and_may_be_late() {
    let mut bench = Bench::new(spec(9, OverrunPolicy::Queue));
    bench.time(0);
    assert_eq!(bench.pause(50), "off 0");
    assert_eq!(bench.scheduler.in_flight(DAG), 1);
    assert_eq!(bench.time(251), "missed 0, skipped 1, skipped 2");
    assert_eq!(bench.complete(260), "Missed 0");
    assert_eq!(bench.scheduler.in_flight(DAG), 0);
}

#[test]
fn p4_releases_go_on_upon_the_old_grid() {
    let mut bench = Bench::new(spec(9, OverrunPolicy::Queue));
    bench.time(0);
    bench.complete(10);
    bench.pause(50);
    assert_eq!(bench.time(100), "skipped 1");
    assert_eq!(bench.resume(150), "on 0");
    assert!(!bench.scheduler.is_paused(DAG));
    assert_eq!(bench.scheduler.next_event_ns(), Some(200));
    assert_eq!(bench.time(200), "released 2");
    bench.complete(210);
    bench.pause(220);
    // At the instant of a release the job is released.
    assert_eq!(bench.resume(300), "on 0, released 3");
    // Pausing twice and resuming twice is like once.
    bench.complete(310);
    bench.pause(320);
    bench.pause(330);
    bench.resume(340);
    bench.resume(350);
    assert_eq!(bench.time(400), "released 4");
}

#[test]
fn p4_a_driver_that_comes_late_releases_nothing_of_the_pause() {
    let mut bench = Bench::new(spec(5, OverrunPolicy::Queue));
    assert_eq!(bench.pause(0), "off 0, skipped 0");
    // Jobs 1 and 2 were due at 100 and 200, while it was paused.
    assert_eq!(bench.resume(250), "on 0, skipped 1, skipped 2");
    assert_eq!(bench.time(300), "released 3");
}

#[test]
fn p5_a_paused_dag_comes_to_its_limit() {
    let mut bench = Bench::new(spec(3, OverrunPolicy::Queue));
    bench.time(0);
    bench.pause(50);
    assert_eq!(bench.time(200), "skipped 1, skipped 2");
    assert!(!bench.scheduler.is_finished());
    assert_eq!(bench.complete(210), "Met 0");
    assert!(bench.scheduler.is_finished());
}

#[test]
fn p5_an_ended_dag_is_not_paused() {
    let mut bench = Bench::new(spec(3, OverrunPolicy::Queue));
    bench.time(0);
    bench.at(20, |moment, log| moment.stop(DAG, log));
    assert_eq!(bench.pause(30), "");
    assert!(!bench.scheduler.is_paused(DAG));
    assert_eq!(bench.resume(40), "");
    assert_eq!(bench.time(500), "");
}

#[test]
fn others_do_not_notice_a_pause() {
    let specs = [dag(100, 100, 4, &[2], &[]), dag(100, 100, 4, &[1], &[])];
    let mut scheduler = Scheduler::new(commit(&specs, PREEMPTIVE), PREEMPTIVE);
    let mut moment = scheduler.at(0);
    moment.pause(DAG, &mut ());
    let decisions = moment.release_due(&mut ()).dispatch().to_vec();
    let started = support::instance(1, 0, 0);
    assert_eq!(decisions.len(), 1);
    assert_eq!(decisions[0].instance(), started);
    assert_eq!(scheduler.statistics(DagId(1)).released, 1);
    assert_eq!(scheduler.statistics(DAG).skips, 1);
}
