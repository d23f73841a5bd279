//! Between the first job and the last nothing is allocated.

#[path = "../../../sched-dag/tests/it/counting.rs"]
mod counting;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use counting::allocated;
use fass::{Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use linux::{Linux, Mechanism};

#[test]
fn jobs_allocate_nothing_preempted_or_not() {
    const JOBS: u64 = 40;
    let ms = Duration::from_millis;
    for mechanism in [Mechanism::Fifo, Mechanism::Normal, Mechanism::Poll] {
        let machine = Linux::new(1, mechanism).unwrap();
        machine.limit_real_time(Duration::from_secs(5)).unwrap();
        let seen = Arc::new([AtomicU64::new(0), AtomicU64::new(0)]);
        let stamps = Arc::clone(&seen);
        let dag = create_dag();
        dag.name("dag").jobs(JOBS);
        let mut job = 0;
        let source = move || {
            job += 1;
            match job {
                2 => stamps[0].store(allocated().2, Relaxed),
                JOBS => stamps[1].store(allocated().2, Relaxed),
                _ => {}
            }
            (job,)
        };
        let named = |name| SubtaskAttributes::named(name).priority(0);
        dag.register_periodic_subtask(source, vec!["job"], ms(2), named("source"));
        let sink = |(_,): (u64,)| execute_for(Duration::from_micros(50), Occupation::Spin);
        dag.register_sink_subtask(sink, vec!["job"], ms(2), named("sink"));
        let long = create_dag();
        long.name("long").jobs(8);
        long.period(ms(10)).relative_deadline(ms(10));
        let function = |_job| execute_for(Duration::from_millis(3), Occupation::Spin);
        long.register_untyped_subtask(function, named("long").priority(9));
        let naps = create_dag();
        naps.name("naps").jobs(JOBS);
        naps.period(ms(2)).relative_deadline(ms(2));
        let nap = || fass::sleep(Duration::from_micros(100));
        let stated = named("nap").wait(Duration::from_micros(100));
        naps.async_source(nap).register(stated);
        finish_create_dags(&[dag, long, naps]).unwrap();
        let run = machine.run().unwrap();
        assert_eq!(run.violations().count(), 0);
        assert_eq!(run.counts().preemptions > 0, machine.is_preemptive());
        let [first, last] = [&seen[0], &seen[1]].map(|count| count.load(Relaxed));
        assert!(first > 0);
        assert_eq!(last - first, 0, "allocations within {JOBS} jobs");
    }
}
