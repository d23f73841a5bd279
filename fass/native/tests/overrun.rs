//! Overruns with typed values: what was sent to cancelled instances makes room.
//!
//! A recorded run's clock goes on by 1 ns at each completion, so short periods are an
//! overload. A value that stays in its slot would end the run: a later job's finds none.

#[path = "../../../sched-dag/tests/support/random.rs"]
mod random;

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use fass::{
    ConstructionPolicy, Dag, OverrunPolicy, Policy, SubtaskAttributes, create_dag,
    finish_create_dags, finish_create_dags_with,
};
use native::Native;
use random::Random;

const JOBS: u64 = 200;

fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

const fn ns(count: u64) -> Duration {
    Duration::from_nanos(count)
}

/// A message that counts how many of its kind are alive.
struct Counted {
    number: u64,
    alive: Arc<AtomicI64>,
}

impl Counted {
    fn new(number: u64, alive: &Arc<AtomicI64>) -> Self {
        alive.fetch_add(1, Relaxed);
        let alive = Arc::clone(alive);
        Self { number, alive }
    }
}

impl Clone for Counted {
    fn clone(&self) -> Self {
        Self::new(self.number, &self.alive)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.alive.fetch_sub(1, Relaxed);
    }
}

/// A DAG of 5 subtasks every 2 ns, whose source sends to the sink by three ways. The
/// sink tells `at_sink` each number that it gets, which is the same by all ways.
fn overloaded(
    policy: OverrunPolicy,
    in_flight: u32,
    mut at_sink: impl FnMut(u64) + Send + 'static,
) -> Dag {
    let alive = Arc::new(AtomicI64::new(0));
    let dag = create_dag();
    dag.name("overloaded").jobs(JOBS);
    dag.in_flight(in_flight).overrun(policy);
    let mut number = 0;
    let counter = Arc::clone(&alive);
    let source = move || {
        number += 1;
        (Counted::new(number, &counter),)
    };
    dag.register_periodic_subtask(source, vec!["a"], ns(2), named("source"));
    let pass = |(value,): (Counted,)| (value,);
    dag.register_subtask(pass, vec!["a"], vec!["b"], named("first"));
    dag.register_subtask(pass, vec!["b"], vec!["c"], named("second"));
    dag.register_subtask(pass, vec!["a"], vec!["d"], named("beside"));
    // One on each edge for each job in flight, and one while it is being cloned.
    let most = 6 * i64::from(in_flight) + 1;
    let sink = move |(a, c, d): (Counted, Counted, Counted)| {
        assert_eq!((a.number, c.number), (c.number, d.number));
        assert!(alive.load(Relaxed) <= most);
        at_sink(a.number);
    };
    dag.register_sink_subtask(sink, vec!["a", "c", "d"], ns(4), named("sink"));
    dag
}

fn in_all_settings(mut judge: impl FnMut(u32, u32, Policy)) {
    for by in [Policy::StaticPriority, Policy::Edf] {
        for workers in 1..=3 {
            for in_flight in 1..=3 {
                judge(in_flight, workers, by);
            }
        }
    }
}

#[test]
fn aborted_jobs_leave_no_values_in_their_slots() {
    let mut aborts = 0;
    in_all_settings(|in_flight, workers, by| {
        let machine = Native::new().workers(workers).policy(by);
        let runs = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&runs);
        let dag = overloaded(OverrunPolicy::Abort, in_flight, move |_| {
            count.fetch_add(1, Relaxed);
        });
        finish_create_dags(&[dag]).expect("the DAG is right");
        let recorded = machine.run_recorded();
        assert_eq!(recorded.violations, [], "{by:?}, {workers} workers");
        let runs = runs.load(Relaxed);
        let statistics = recorded.report.statistics[0];
        let ended = statistics.completed + statistics.skips + statistics.aborts;
        assert_eq!(ended, JOBS);
        // An aborted job's sink has run if it had started.
        assert!((statistics.completed..=statistics.completed + statistics.aborts).contains(&runs));
        aborts += statistics.aborts;
    });
    assert!(aborts > 18 * JOBS / 4, "{aborts}");
}

#[test]
fn where_the_clock_stands_still_each_job_is_joined_and_none_is_late() {
    for policy in [OverrunPolicy::Abort, OverrunPolicy::Skip] {
        in_all_settings(|in_flight, workers, by| {
            let machine = Native::new().workers(workers).policy(by);
            let sum = Arc::new(AtomicU64::new(0));
            let to_sum = Arc::clone(&sum);
            let dag = overloaded(policy, in_flight, move |number| {
                to_sum.fetch_add(number, Relaxed);
            });
            finish_create_dags(&[dag]).expect("the DAG is right");
            let statistics = machine.run().statistics[0];
            assert_eq!((statistics.completed, statistics.misses), (JOBS, 0));
            assert_eq!((statistics.aborts, statistics.skips), (0, 0));
            assert_eq!(sum.load(Relaxed), JOBS * (JOBS + 1) / 2);
        });
    }
}

fn panics_amid_aborts(workers: u32) {
    let machine = Native::new().workers(workers);
    let dag = overloaded(OverrunPolicy::Abort, 2, |number| {
        assert!(number < 20, "the sink gives up");
    });
    finish_create_dags(&[dag]).expect("the DAG is right");
    machine.run_recorded();
}

#[test]
#[should_panic(expected = "the sink gives up")]
fn a_panic_amid_aborts_ends_the_run_of_one_worker() {
    panics_amid_aborts(1);
}

#[test]
#[should_panic(expected = "the sink gives up")]
fn a_panic_amid_aborts_ends_the_run_of_two_workers() {
    panics_amid_aborts(2);
}

/// A random DAG whose edges all are rings with slots.
fn draw(random: &mut Random) -> Dag {
    let dag = create_dag();
    dag.jobs(60).overrun(OverrunPolicy::Abort);
    dag.in_flight(random.between(1, 4).try_into().expect("few"));
    let subtasks = random.below(9) + 1;
    dag.period(ns(random.between(1, 2 * subtasks as u64)));
    dag.relative_deadline(ns(random.between(1, 40)));
    dag.offset(ns(random.between(0, 10)));
    let subtasks: Vec<_> = (0..subtasks)
        .map(|number| dag.register_untyped_subtask(|_| (), named(&number.to_string())))
        .collect();
    let density = random.between(10, 60);
    for (later, to) in subtasks.iter().enumerate() {
        for from in &subtasks[..later] {
            if random.chance(density) {
                dag.precede(from, to);
            }
        }
    }
    dag
}

#[test]
fn random_graphs_can_abort_their_jobs() {
    let mut aborts = 0;
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let machine = Native::new().workers(random.between(1, 4).try_into().expect("few"));
        let dags: Vec<Dag> = (0..=random.below(3)).map(|_| draw(&mut random)).collect();
        finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).expect("they are right");
        let recorded = machine.run_recorded();
        assert_eq!(recorded.violations, [], "seed {seed}");
        aborts += (recorded.report.statistics.iter())
            .map(|of_dag| of_dag.aborts)
            .sum::<u64>();
    }
    assert!(aborts > 1_000, "{aborts}");
}
