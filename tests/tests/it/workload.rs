//! The paper's workload against reference figures that were made with the original
//! policies: 20 seeds of 2000 jobs, execution times uniform from 1 to 50 ms, join
//! queue 1000. The seeds here are others and fewer, so figures agree as far as samples
//! do: over seeds, the sets per job have a standard deviation of at most 0.009.

use std::num::NonZeroUsize;

use harness::workload::{self, Stamping};
use join_latency::Samples;
use pub_sub::{ApproximateTime, ExactTime, Parameters, Synchronizer};
use random::Random;

const JOBS: usize = 2000;
const QUEUE_SIZE: usize = 1000;
const SEEDS: u64 = 3;

fn run(
    synchronizer: &mut dyn Synchronizer<u64>,
    stamping: Stamping,
    parallel: usize,
    seed: u64,
) -> Samples {
    let mut seeds = Random::new(seed);
    let times_ns = |mut random: Random| {
        let times_ns = (0..JOBS).map(|_| random.within(1_000_000..=50_000_000));
        times_ns.collect::<Vec<u64>>()
    };
    let topics = (0..parallel).map(|_| times_ns(Random::new(seeds.number())));
    workload::run(synchronizer, stamping, &topics.collect::<Vec<_>>())
}

fn exact(parallel: usize, queue_size: usize, seed: u64) -> Samples {
    let mut exact = ExactTime::new(parallel, queue_size);
    run(&mut exact, Stamping::Release, parallel, seed)
}

fn approximate(parallel: usize, max_interval_ms: u64, seed: u64) -> Samples {
    let queue_size = NonZeroUsize::new(QUEUE_SIZE).expect("not 0");
    let mut parameters = Parameters::new(parallel, queue_size);
    parameters.max_interval_ns = Some(max_interval_ms * 1_000_000);
    let mut approximate = ApproximateTime::new(parameters);
    run(&mut approximate, Stamping::Publication, parallel, seed)
}

/// Returns a value at a rank in percent.
fn rank(values_ns: &mut [u64], percent: usize) -> u64 {
    values_ns.sort_unstable();
    values_ns[(values_ns.len() - 1) * percent / 100]
}

/// For (N, longest interval in ms): sets per job in thousandths, and the median cover
/// delay in ms.
const REFERENCE: [(usize, u64, u64, u64); 9] = [
    (2, 10, 535, 36),
    (2, 30, 739, 26),
    (2, 50, 742, 25),
    (4, 10, 141, 126),
    (4, 30, 622, 36),
    (4, 50, 631, 35),
    (6, 10, 28, 619),
    (6, 30, 571, 42),
    (6, 50, 593, 40),
];

#[test]
fn approximate_sets_per_job_agree_with_the_reference() {
    for (parallel, max_interval_ms, thousandths, cover_ms) in REFERENCE {
        let mut sets = 0;
        let mut delays_ns = Vec::new();
        for seed in 1..=SEEDS {
            let samples = approximate(parallel, max_interval_ms, seed);
            // Also each run on its own.
            let difference =
                (samples.joins.len() as u64 * 1000).abs_diff(thousandths * JOBS as u64);
            assert!(
                difference <= 30 * JOBS as u64,
                "N = {parallel}, {max_interval_ms} ms, seed {seed}: {} sets of {JOBS}, \
                 not about {thousandths} of 1000",
                samples.joins.len()
            );
            sets += samples.joins.len();
            delays_ns.extend(samples.cover_delays_ns());
        }
        let jobs = JOBS as u64 * SEEDS;
        let difference = (sets as u64 * 1000).abs_diff(thousandths * jobs);
        assert!(
            difference <= 10 * jobs,
            "N = {parallel}, {max_interval_ms} ms: {sets} sets of {jobs}, \
             not about {thousandths} of 1000"
        );
        let median_ms = rank(&mut delays_ns, 50) / 1_000_000;
        assert!(
            median_ms.abs_diff(cover_ms) <= 1 + cover_ms / 5,
            "N = {parallel}, {max_interval_ms} ms: cover median {median_ms} ms, not {cover_ms}"
        );
    }
}

#[test]
fn exact_joins_every_job_without_delay() {
    for parallel in [2, 4, 6] {
        for seed in 1..=SEEDS {
            let samples = exact(parallel, QUEUE_SIZE, seed);
            assert_eq!(samples.counts(), [JOBS, JOBS, 0, 0]);
            assert_eq!(samples.cover_delays_ns(), [0; JOBS]);
            assert_eq!(samples.join_latencies_ns(), [0; JOBS]);
        }
    }
}

#[test]
fn exact_loses_joins_when_the_backlog_exceeds_its_queue() {
    // Of the joins of 2000 jobs, 55, 84 and 91 % go missing with a queue of 10; how
    // many varies much from seed to seed.
    for (parallel, percent) in [(2, 55), (4, 84), (6, 91)] {
        let missing = (1..=SEEDS).map(|seed| exact(parallel, 10, seed).counts()[3]);
        let missing: Vec<usize> = missing.collect();
        let missing_percent = missing.iter().sum::<usize>() * 100 / (missing.len() * JOBS);
        assert!(
            missing_percent.abs_diff(percent) <= 12,
            "{missing_percent} % missing, not about {percent}"
        );
    }
}

#[test]
fn the_papers_latency_grows_with_the_run() {
    let samples = approximate(2, 10, 1);
    let median_ns = |sets: usize| rank(&mut samples.join_latencies_ns()[..sets].to_vec(), 50);
    let (short_ns, long_ns) = (median_ns(100), median_ns(1000));
    assert!(long_ns > 4 * short_ns, "{short_ns} to {long_ns}");
}
