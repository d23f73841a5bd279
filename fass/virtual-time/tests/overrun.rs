//! Overruns through real functions: whatever the policy does to jobs, the
//! values that meet are of one job, and cancelled ones leave nothing behind.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use fass::{OverrunPolicy, create_dag};
use support::{diamond, execute, ms, named, run};
use virtual_time::{Report, VirtualTime, What};

/// A diamond that needs 34 ms every 10 ms, on enough cores.
fn overloaded(policy: OverrunPolicy, in_flight: u32) -> Report {
    let machine = VirtualTime::new().cores(4);
    let dag = diamond(ms(10), ms(15), [ms(2), ms(5), ms(20), ms(12)]);
    dag.jobs(40).in_flight(in_flight).overrun(policy);
    run(&machine, &[dag])
}

#[test]
fn queueing_loses_no_job() {
    for in_flight in 1..=4 {
        let report = overloaded(OverrunPolicy::Queue, in_flight);
        let statistics = report.statistics[0];
        assert_eq!((statistics.released, statistics.completed), (40, 40));
        assert!(statistics.queued > 0);
    }
}

#[test]
fn skipping_counts_what_it_skips() {
    for in_flight in 1..=4 {
        let report = overloaded(OverrunPolicy::Skip, in_flight);
        let statistics = report.statistics[0];
        assert_eq!(statistics.completed + statistics.skips, 40);
        assert_eq!(statistics.released, statistics.completed);
        assert!(statistics.skips > 0);
    }
}

#[test]
fn aborting_cancels_what_has_not_started() {
    for in_flight in 1..=4 {
        let report = overloaded(OverrunPolicy::Abort, in_flight);
        let statistics = report.statistics[0];
        assert!(statistics.aborts > 0);
        let mut events = report.events.iter();
        assert!(events.any(|event| event.what == What::Cancelled));
    }
}

/// A message that counts how many of its kind are alive.
struct Counted(Arc<AtomicI64>);

impl Counted {
    fn new(alive: &Arc<AtomicI64>) -> Self {
        alive.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(alive))
    }
}

impl Clone for Counted {
    fn clone(&self) -> Self {
        Self::new(&self.0)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

#[test]
fn aborted_jobs_leave_at_most_a_value_an_edge() {
    let alive = Arc::new(AtomicI64::new(0));
    let machine = VirtualTime::new().cores(2);
    let dag = create_dag();
    dag.jobs(50).in_flight(2).overrun(OverrunPolicy::Abort);
    let counter = Arc::clone(&alive);
    dag.register_periodic_subtask(
        move || (Counted::new(&counter),),
        vec!["value"],
        ms(10),
        named("source"),
    );
    let slow = |(value,): (Counted,)| {
        execute(ms(35));
        (value,)
    };
    dag.register_subtask(slow, vec!["value"], vec!["slow"], named("slow"));
    dag.register_sink_subtask(
        |_: (Counted, Counted)| execute(ms(5)),
        vec!["slow", "value"],
        ms(20),
        named("sink"),
    );
    let report = run(&machine, &[dag]);
    assert!(report.statistics[0].aborts > 5);
    // A value that is given up stays until its place is written again. Each of the three
    // edges has one place besides the near one, which is written first.
    let left = alive.load(Ordering::Relaxed);
    assert!((0..=3).contains(&left), "{left}");
}
