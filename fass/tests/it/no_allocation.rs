//! No allocation from a job's release to its completion.
//!
//! The program's allocator counts this thread's allocations. The DAG has what
//! could tempt a body to allocate: several inputs and outputs, fan-out, shared
//! and unique messages, 16 arguments, more than one job in flight, discards. (The scenarios count
//! with states, samples and signals; `cruise` does with wires.)

#[path = "../../../sched-dag/tests/it/counting.rs"]
pub(crate) mod counting;

use core::time::Duration;
use std::sync::Arc;

use crate::support::{commit, run_job};
use counting::allocated;
use fass::{SubtaskAttributes, Unique, create_dag};

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
