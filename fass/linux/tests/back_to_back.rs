//! Jobs that follow one another as fast as they go, by threads that poll.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use linux::{Linux, Mechanism};
use sched_dag::DagId;
use support::{Alone, alone_on, breaches, ms};

fn machine(sizes: &[u32]) -> Alone {
    let share = || Linux::sharing(sizes.iter().sum(), Mechanism::Poll);
    let machine = || share().expect("there is a processor").clusters(sizes);
    alone_on(|| machine().skipping_idle_time())
}

#[test]
fn the_runs_time_skips_what_is_idle() {
    for sizes in [&[1][..], &[2], &[1, 1]] {
        let alone = machine(sizes);
        let dags: Vec<_> = (0..)
            .take(sizes.len())
            .map(|cluster| {
                let dag = create_dag();
                let hour = ms(3_600_000);
                dag.jobs(500).period(hour).relative_deadline(hour);
                dag.in_flight(1).cluster(cluster);
                let last = Arc::new(AtomicU64::new(0));
                let named = SubtaskAttributes::named;
                let [first, second, third] = [0, 1, 2].map(|number| {
                    let last = Arc::clone(&last);
                    let name = format!("s{number}");
                    let act = move |job| assert!(last.fetch_max(job, Relaxed) <= job);
                    dag.register_untyped_subtask(act, named(&name))
                });
                dag.precede(&first, &second).precede(&second, &third);
                dag
            })
            .collect();
        finish_create_dags(&dags).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!(breaches(&run), []);
        for dag in (0..).map(DagId).take(dags.len()) {
            let of = run.statistics(dag);
            assert_eq!((of.completed, of.misses, of.faults), (500, 0, 0));
        }
    }
}
