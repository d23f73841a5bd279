//! Overruns through real functions: what cancelled jobs leave behind. (That values which meet are of
//! one job is told by `random`.)

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use fass::{OverrunPolicy, create_dag};
use support::{execute, ms, named, run};
use virtual_time::VirtualTime;

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
    let report = run(&machine, std::slice::from_ref(&dag));
    assert!(report.dag(&dag).statistics().aborts > 5);
    // A value that is given up stays until its place is written again. Each of the three
    // edges has one place besides the near one, which is written first.
    let left = alive.load(Ordering::Relaxed);
    assert!((0..=3).contains(&left), "{left}");
}
