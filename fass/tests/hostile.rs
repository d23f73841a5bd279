//! A platform that keeps no rule: it runs bodies too early, twice, with any job, and
//! completes what it likes. It gets panics in plain words; values are never torn, mixed
//! between jobs, or lost track of.

mod support;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use common::random::Random;
use fass::{Body, Dag, create_dag};
use support::{PERIOD, commit, named};

/// A value that knows its job and is counted while it lives.
struct Counted {
    job: u64,
    /// More than a processor stores at once.
    copies: [u64; 8],
    alive: Arc<AtomicI64>,
}

impl Counted {
    fn new(job: u64, alive: &Arc<AtomicI64>) -> Self {
        alive.fetch_add(1, Ordering::Relaxed);
        Self {
            job,
            copies: [job; 8],
            alive: Arc::clone(alive),
        }
    }

    /// Holds the value against the job of which the body was run.
    fn check(&self, running: &AtomicU64) {
        assert_eq!(self.copies, [self.job; 8], "torn");
        let running = running.load(Ordering::Relaxed);
        assert_eq!(self.job, running, "a value of another job");
    }
}

impl Clone for Counted {
    fn clone(&self) -> Self {
        Self::new(self.job, &self.alive)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        assert_eq!(self.copies, [self.job; 8], "dropped once, and whole");
        self.alive.fetch_sub(1, Ordering::Relaxed);
    }
}

/// What a wrong order is told, and nothing else.
const COMPLAINTS: [&str; 3] = [
    "is missing: the platform started",
    "finds no free slot: the platform cancelled",
    "and cannot continue",
];

/// A source, two in the middle and a sink; each of them finds the job that it is run
/// with in `running`.
fn diamond(alive: &Arc<AtomicI64>, running: &Arc<[AtomicU64; 4]>, joined: &Arc<AtomicU64>) -> Dag {
    let dag = create_dag();
    dag.in_flight(3);
    let (source, for_source) = (Arc::clone(alive), Arc::clone(running));
    let source = move || {
        let value = Counted::new(for_source[0].load(Ordering::Relaxed), &source);
        (value,)
    };
    dag.register_periodic_subtask(source, vec!["value"], PERIOD, named("source"));
    for (number, name) in [(1, "left"), (2, "right")] {
        let running = Arc::clone(running);
        let pass = move |(value,): (Counted,)| {
            value.check(&running[number]);
            (value,)
        };
        dag.register_subtask(pass, vec!["value"], vec![name], named(name));
    }
    let (running, joined) = (Arc::clone(running), Arc::clone(joined));
    let sink = move |(left, right): (Counted, Counted)| {
        left.check(&running[3]);
        right.check(&running[3]);
        joined.fetch_add(1, Ordering::Relaxed);
    };
    dag.register_sink_subtask(sink, vec!["left", "right"], PERIOD, named("sink"));
    dag
}

/// A body, and the job that is its next one.
type Place = Mutex<(Body, u64)>;

/// Runs the bodies in turn, each with its next job: that is an order which a platform
/// may choose, even with as many threads as jobs may be in flight. But now and then it
/// takes another body, another job, or does something else.
fn misuse(places: &[Place], running: &[AtomicU64; 4], turns: u32, random: &mut Random) {
    for _ in 0..turns {
        for number in 0..places.len() {
            let is_wrong = random.chance(3);
            let number = if is_wrong { random.index(4) } else { number };
            let mut place = places[number]
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let (body, next) = &mut *place;
            let job = match random.index(6) {
                0 if is_wrong => u64::MAX,
                1 | 2 if is_wrong => random.within(0..=2 * *next),
                _ => *next,
            };
            let what = if is_wrong { random.index(4) } else { 0 };
            running[number].store(job, Ordering::Relaxed);
            let done = catch_unwind(AssertUnwindSafe(|| match what {
                0 | 1 => body.run(job),
                2 => body.discard(job),
                _ => body.complete(job, &mut |_| ()),
            }));
            *next += u64::from(job == *next && !random.chance(1));
            drop(place);
            if let Err(payload) = done {
                let message = payload.downcast_ref::<String>().expect("a message");
                let is_known = COMPLAINTS.iter().any(|known| message.contains(known));
                assert!(is_known, "{message}");
            }
        }
    }
}

#[test]
fn no_order_of_calls_tears_mixes_or_leaks_values() {
    let rounds = if cfg!(miri) { 3 } else { 400 };
    let joined = Arc::new(AtomicU64::new(0));
    for seed in 0..rounds {
        let alive = Arc::new(AtomicI64::new(0));
        let running = Arc::new([const { AtomicU64::new(0) }; 4]);
        let mut plan = commit(&[diamond(&alive, &running, &joined)]);
        let places = plan.bodies.remove(0).into_iter();
        let places: Vec<Place> = places.map(|body| Mutex::new((body, 0))).collect();
        if seed % 2 == 0 {
            misuse(&places, &running, 30, &mut Random::new(seed));
        } else {
            thread::scope(|scope| {
                for thread in 0..3 {
                    let (places, running) = (&places, &running);
                    let mut random = Random::new(seed * 3 + thread);
                    scope.spawn(move || misuse(places, running, 10, &mut random));
                }
            });
        }
        drop(places);
        assert_eq!(alive.load(Ordering::Relaxed), 0, "seed {seed}");
    }
    assert!(
        joined.load(Ordering::Relaxed) > rounds,
        "many a join succeeds"
    );
}
