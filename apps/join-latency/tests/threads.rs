//! The experiment on threads, a hundred times as fast: the joins are what the policy
//! makes of the publications that really happened.

mod support;

use std::num::NonZeroUsize;
use std::thread;

use join_latency::{Experiment, Matching, Samples};

const JOBS: usize = 100;
const PARALLEL: usize = 3;

fn run(matching: Matching, depth: usize) -> Samples {
    let thousand = NonZeroUsize::new(1000).expect("not 0");
    let experiment = Experiment {
        parallel: PARALLEL,
        jobs: JOBS,
        seed: 1,
        matching,
        queue: thousand,
        depth: NonZeroUsize::new(depth).expect("not 0"),
        period_ns: 250_000,
        execute: |time| thread::sleep(time / 100),
    };
    Samples::of(support::run(experiment.graph(), PARALLEL + 2))
}

#[test]
fn equal_stamps_join_every_job() {
    let samples = run(Matching::Exact, 1000);
    let record = samples.record();
    assert_eq!((samples.source.len(), samples.lost_inputs), (JOBS, 0));
    assert_eq!(
        (record.same_index_sets(), record.missing_joins()),
        (JOBS, 0)
    );
    for (job, joined) in samples.joins.iter().enumerate() {
        assert_eq!(samples.indices_of(job), [job as u64; PARALLEL]);
        let last_ns = samples
            .parallel
            .iter()
            .map(|spans| spans[job].finish_ns)
            .max();
        assert!(last_ns <= Some(joined.ready_ns));
        assert!(joined.ready_ns <= joined.span.start_ns);
    }
}

#[test]
fn close_stamps_join_only_what_is_close() {
    let max_interval_ns = 100_000;
    let samples = run(Matching::Approximate { max_interval_ns }, 1000);
    assert!(samples.parallel.iter().all(|spans| spans.len() == JOBS));
    let record = samples.record();
    assert!(
        record.missing_joins() > 0,
        "the workload is not that regular"
    );
    for set in record.sets.windows(2) {
        let mut pairs = set[0].indices.iter().zip(&set[1].indices);
        assert!(pairs.all(|(earlier, later)| earlier < later));
    }
}

#[test]
fn a_run_that_has_lost_messages_ends_and_says_so() {
    let samples = run(Matching::Exact, 1);
    assert!(samples.lost_inputs > 0);
}
