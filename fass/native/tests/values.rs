//! Typed values between functions on several threads: each join sees its own job.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use fass::{Policy, SubtaskAttributes, create_dag, finish_create_dags};
use native::Native;

const JOBS: u64 = 1_000;

fn commit(sums: &Arc<AtomicU64>) {
    let dag = create_dag();
    dag.name("sum").jobs(JOBS);
    let period = Duration::from_millis(1);
    let named = SubtaskAttributes::named;
    let mut job = 0u64;
    let source = move || {
        job += 1;
        (job,)
    };
    dag.register_periodic_subtask(source, vec!["job"], period, named("source"));
    for (name, factor) in [("a", 2), ("b", 3), ("c", 5)] {
        let times = move |(job,): (u64,)| (job * factor,);
        dag.register_subtask(times, vec!["job"], vec![name], named(name));
    }
    let sums = Arc::clone(sums);
    let sink = move |(a, b, c): (u64, u64, u64)| {
        assert_eq!((3 * a, 5 * b), (2 * b, 3 * c));
        sums.fetch_add(a + b + c, Relaxed);
    };
    dag.register_sink_subtask(sink, vec!["a", "b", "c"], period, named("sink"));
    finish_create_dags(&[dag]).expect("the DAG is right");
}

#[test]
fn joins_get_values_of_one_job() {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for workers in [1, 2, 3] {
            let sums = Arc::new(AtomicU64::new(0));
            let machine = Native::new().workers(workers).policy(policy);
            commit(&sums);
            let report = machine.run();
            assert_eq!(report.statistics[0].completed, JOBS);
            assert_eq!(sums.load(Relaxed), 10 * JOBS * (JOBS + 1) / 2);

            let machine = Native::new().workers(workers).policy(policy);
            commit(&sums);
            let recorded = machine.run_recorded();
            assert_eq!(recorded.violations, []);
            assert_eq!(recorded.instances, 5 * JOBS);
        }
    }
}
