//! Bodies driven by hand: what a platform may do with them, and what it is told if it does
//! anything else.
//!
//! A platform that keeps no rule runs bodies too early, twice, with any job, users of a state at
//! once,
//! a writer while its value is looked at; and completes what it likes, never, twice, or before it
//! has
//! run. It gets panics in plain words; values are never torn, mixed between jobs, or lost track of.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicI64, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::support::{PERIOD, Shared, commit, inside, named, panic_message, run_job, under_a_lock};
use fass::platform::{Plan, SubtaskCode};
use fass::{Dag, Unique, create_dag};
use random::Random;

#[cfg(debug_assertions)]
#[test]
fn a_debug_build_calls_nothing_of_the_apps_under_a_lock() {
    let dag = create_dag();
    let plain = named("plain");
    dag.register_periodic_subtask(|| (), [], PERIOD, plain);
    dag.relative_deadline(PERIOD);
    let [body] = Shared::all(commit(&[dag]));
    let told = panic_message(|| under_a_lock(|| body.run(0)));
    let begins = "the app's code is called under a lock, or with interrupts disabled";
    assert!(told.starts_with(begins), "{told}");
}

#[test]
fn a_platform_that_keeps_no_order_is_told() {
    let dag = create_dag();
    dag.in_flight(1);
    dag.register_periodic_subtask(|| (1,), vec!["value"], PERIOD, named("source"));
    let middle = |(_,): (i32,)| -> (i32,) { panic!("broken sensor") };
    dag.register_subtask(middle, vec!["value"], vec!["more"], named("middle"));
    dag.register_sink_subtask(|_: (i32,)| (), vec!["more"], PERIOD, named("sink"));
    let [source, middle, sink] = Shared::all(commit(&[dag]));
    source.run(0);
    for (body, job, told) in [
        (
            &sink,
            0,
            "an input of job 0 is missing: the platform started the instance before all its \
             predecessors were complete",
        ),
        (
            &source,
            1,
            "an output of job 1 finds no free slot: the platform cancelled an instance without \
             discarding its inputs, or exceeded the jobs in flight",
        ),
        (&middle, 0, "broken sensor"),
        (
            &middle,
            1,
            "the subtask panicked in job 0 and cannot continue",
        ),
    ] {
        assert_eq!(panic_message(|| body.run(job)), told);
    }
}

/// A value that counts how often it was cloned.
struct Cloned(Arc<AtomicUsize>);

impl Clone for Cloned {
    fn clone(&self) -> Self {
        self.0.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(&self.0))
    }
}

#[test]
fn all_readers_but_the_last_get_a_clone() {
    for readers in 1..=3 {
        let (dag, clones) = (create_dag(), Arc::<AtomicUsize>::default());
        let counter = Arc::clone(&clones);
        let source = move || (Cloned(Arc::clone(&counter)),);
        dag.register_periodic_subtask(source, vec!["value"], PERIOD, named("source"));
        for reader in 0..readers {
            let name = named(&format!("reader {reader}"));
            dag.register_sink_subtask(|_: (Cloned,)| (), vec!["value"], PERIOD, name);
        }
        let mut plan = commit(&[dag]);
        (0..10).for_each(|job| run_job(&mut plan, job));
        assert_eq!(clones.load(Ordering::Relaxed), 10 * (readers - 1));
    }
}

/// A value whose `drop` panics does so in its writer, once, and not where it is
/// discarded.
#[test]
fn what_drops_a_discarded_value_is_the_writers_fault() {
    struct Sharp(bool, Arc<AtomicUsize>);
    impl Drop for Sharp {
        fn drop(&mut self) {
            self.1.fetch_add(1, Ordering::Relaxed);
            assert!(!self.0, "it cannot be dropped");
        }
    }
    let (dag, drops) = (create_dag(), Arc::new(AtomicUsize::new(0)));
    dag.in_flight(1);
    let mut is_first = true;
    let source = {
        let drops = Arc::clone(&drops);
        move || {
            let sharp = Sharp(is_first, Arc::clone(&drops));
            is_first = false;
            (Unique::new(sharp),)
        }
    };
    dag.register_periodic_subtask(source, vec!["value"], PERIOD, named("source"));
    dag.register_sink_subtask(
        |_: (Unique<Sharp>,)| (),
        vec!["value"],
        PERIOD,
        named("sink"),
    );
    let mut plan = commit(&[dag]);
    let [source, sink] = &mut plan.bodies[0][..] else {
        panic!("two subtasks");
    };
    source.run(0);
    sink.discard(0);
    sink.discard(0); // harmless
    assert_eq!(drops.load(Ordering::Relaxed), 0);
    assert_eq!(panic_message(|| source.run(1)), "it cannot be dropped");
    assert_eq!(drops.load(Ordering::Relaxed), 2, "and the one of job 1");
    drop(plan);
    assert_eq!(drops.load(Ordering::Relaxed), 2, "each once");
}

/// The caller of `discard` may have a small stack, as an interrupt's handler has.
#[test]
fn discarding_a_large_value_takes_little_stack() {
    const BYTES: usize = 1 << 20;
    const STACK: usize = 128 << 10; // what a thread of a test's needs at least, and room
    const LARGE: usize = 64 << 20;
    let on_stack = |bytes, f: Box<dyn FnOnce() -> Plan + Send>| {
        let thread = thread::Builder::new().stack_size(bytes).spawn(f);
        (thread.expect("a thread").join()).expect("its stack is enough")
    };
    let make = || {
        let dag = create_dag();
        let source = || ([1_u8; BYTES],);
        dag.register_periodic_subtask(source, vec!["value"], PERIOD, named("source"));
        let sink = |_: ([u8; BYTES],)| ();
        dag.register_sink_subtask(sink, vec!["value"], PERIOD, named("sink"));
        let mut plan = commit(&[dag]);
        plan.bodies[0][0].run(0);
        plan
    };
    let mut plan = on_stack(LARGE, Box::new(make));
    let discard = move || {
        plan.bodies[0][1].discard(0);
        plan
    };
    let mut plan = on_stack(STACK, Box::new(discard));
    let look = move || {
        let early = panic_message(|| plan.bodies[0][1].run(0));
        assert!(early.contains("an input of job 0 is missing"), "{early}");
        plan
    };
    on_stack(LARGE, Box::new(look));
}

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

/// The complaints about a wrong order.
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
type Place = Mutex<(SubtaskCode, u64)>;

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
                _ => _ = body.complete(job, &mut |_| ()),
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
    // Many a join succeeds.
    assert!(joined.load(Ordering::Relaxed) > rounds);
}

/// The bodies of a DAG with a state that its source updates and two others read.
fn with_state() -> [Shared; 4] {
    let dag = create_dag();
    let state = dag.state("pair", (0_u64, 0_u64));
    let update = |pair: &mut (u64, u64)| {
        pair.0 += 1;
        inside();
        pair.1 += 1;
        (pair.0,)
    };
    let source = dag.period(PERIOD).using(state.update()).source(update);
    source.writes(&["count"]).register(named("update"));
    for name in ["first", "second"] {
        let read = |pair: &(u64, u64), (count,): (u64,)| {
            assert_eq!((pair.0, pair.1), (count, count), "in mid-change");
            inside();
            (count,)
        };
        let reader = dag.using(state.read()).subtask(read).reads(&["count"]);
        reader.writes(&[name]).register(named(name));
    }
    let join = |(first, second): (u64, u64)| assert_eq!(first, second);
    dag.register_sink_subtask(join, vec!["first", "second"], PERIOD, named("join"));
    Shared::all(commit(&[dag]))
}

const IN_USE: &str = "a state is in use by another subtask: the platform started the instance \
                      before all its predecessors were complete";

#[test]
fn readers_share_a_state_and_an_update_at_the_same_time_is_refused() {
    let [update, first, second, join] = with_state();
    update.run(0);
    first.run_while(0, move || {
        second.run_while(0, move || {
            // Both look at it now.
            assert_eq!(panic_message(|| update.run(1)), IN_USE);
        });
    });
    join.run(0);
}
