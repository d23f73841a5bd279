//! A platform that keeps no rule: it runs bodies too early, twice, with any job, at
//! once, and completes what it likes. It gets panics in plain words; values are never
//! torn, mixed between jobs, lost track of, or used by two at one time.

#[path = "../../sched-dag/tests/support/random.rs"]
mod random;
mod support;

use core::time::Duration;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Barrier, Mutex, PoisonError, mpsc};
use std::thread;

use fass::{Body, Dag, Plan, Raiser, Sample, SubtaskAttributes, create_dag};
use random::Random;
use support::commit;

const PERIOD: Duration = Duration::from_millis(10);

fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

fn panic_message(action: impl FnOnce()) -> String {
    let payload = catch_unwind(AssertUnwindSafe(action)).expect_err("it panics");
    let text = payload.downcast_ref::<String>().cloned();
    text.or_else(|| payload.downcast_ref::<&str>().map(ToString::to_string))
        .expect("a message")
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
            let number = if is_wrong { random.below(4) } else { number };
            let mut place = places[number]
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let (body, next) = &mut *place;
            let job = match random.below(6) {
                0 if is_wrong => u64::MAX,
                1 | 2 if is_wrong => random.between(0, 2 * *next),
                _ => *next,
            };
            let what = if is_wrong { random.below(4) } else { 0 };
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

#[test]
fn an_instance_that_is_run_twice_finds_no_second_input() {
    let alive = Arc::new(AtomicI64::new(0));
    let running = Arc::new([const { AtomicU64::new(0) }; 4]);
    let mut plan = commit(&[diamond(&alive, &running, &Arc::default())]);
    for body in &mut plan.bodies[0] {
        body.run(0);
    }
    for reader in 1..4 {
        let again = panic_message(|| plan.bodies[0][reader].run(0));
        assert!(again.contains("an input of job 0 is missing"), "{again}");
    }
    assert_eq!(alive.load(Ordering::Relaxed), 0);
}

#[test]
fn a_join_that_is_started_too_early_keeps_no_half_of_its_inputs() {
    let alive = Arc::new(AtomicI64::new(0));
    let running = Arc::new([const { AtomicU64::new(0) }; 4]);
    let mut plan = commit(&[diamond(&alive, &running, &Arc::default())]);
    plan.bodies[0][0].run(0);
    plan.bodies[0][1].run(0);
    let early = panic_message(|| plan.bodies[0][3].run(0));
    assert!(early.contains("an input of job 0 is missing"), "{early}");
    plan.bodies[0][2].run(0);
    drop(plan);
    assert_eq!(alive.load(Ordering::Relaxed), 0);
}

/// A state that one subtask updates and two others read; each holds it until the test
/// has met it at the barrier twice.
fn with_state(held: &[Arc<Barrier>; 3]) -> Plan {
    let dag = create_dag();
    let state = dag.state("pair", (0_u64, 0_u64));
    let [update, first, second] = held.clone();
    dag.using(state.update()).register_periodic_subtask(
        move |pair: &mut (u64, u64)| {
            pair.0 += 1;
            update.wait();
            update.wait();
            pair.1 += 1;
            (pair.0,)
        },
        vec!["count"],
        PERIOD,
        named("update"),
    );
    let read = |held: Arc<Barrier>| {
        move |pair: &(u64, u64), (count,): (u64,)| {
            assert_eq!((pair.0, pair.1), (count, count), "in mid-change");
            held.wait();
            held.wait();
            (count,)
        }
    };
    let counts = || vec!["count"];
    dag.using(state.read())
        .register_subtask(read(first), counts(), vec!["first"], named("first"));
    dag.using(state.read()).register_subtask(
        read(second),
        counts(),
        vec!["second"],
        named("second"),
    );
    let join = |(first, second): (u64, u64)| assert_eq!(first, second);
    dag.register_sink_subtask(join, vec!["first", "second"], PERIOD, named("join"));
    commit(&[dag])
}

const IN_USE: &str = "a state is in use by another subtask: the platform started the instance \
                      before all its predecessors were complete";

#[test]
fn readers_share_a_state_and_an_update_at_the_same_time_is_refused() {
    let held = [(); 3].map(|()| Arc::new(Barrier::new(2)));
    let mut plan = with_state(&held);
    let [update, first, second, join] = &mut plan.bodies[0][..] else {
        panic!("four subtasks");
    };
    let through = |barrier: &Barrier| {
        barrier.wait();
        barrier.wait();
    };
    thread::scope(|scope| {
        scope.spawn(|| update.run(0));
        through(&held[0]);
    });
    thread::scope(|scope| {
        scope.spawn(|| first.run(0));
        scope.spawn(|| second.run(0));
        held[1].wait();
        held[2].wait();
        // Both look at it now.
        assert_eq!(panic_message(|| update.run(1)), IN_USE);
        held[1].wait();
        held[2].wait();
    });
    join.run(0);
}

#[test]
fn a_state_that_is_being_changed_is_refused_to_readers() {
    let held = [(); 3].map(|()| Arc::new(Barrier::new(2)));
    let mut plan = with_state(&held);
    let [update, first, second, _] = &mut plan.bodies[0][..] else {
        panic!("four subtasks");
    };
    thread::scope(|scope| {
        scope.spawn(|| update.run(0));
        held[0].wait();
        held[0].wait();
    });
    thread::scope(|scope| {
        scope.spawn(|| {
            // Its readers have not run: they hold no value of job 1, and both slots.
            let full = panic_message(|| update.run(1));
            assert!(full.contains("finds no free slot"), "{full}");
        });
        held[0].wait();
        // The pair is (2, 1) now.
        assert_eq!(panic_message(|| first.run(0)), IN_USE);
        held[0].wait();
    });
    // The update has ended, if by a panic, and given the state back: it is (2, 2).
    let late = panic_message(|| second.run(0));
    assert!(
        late.contains("in mid-change"),
        "it is not job 0's any more: {late}"
    );
}

/// Of which job a sample was, and when that was complete.
type Told = mpsc::Receiver<Option<(u64, u64)>>;

/// A writer of [`Counted`] values, and a subtask of another DAG that samples them: it
/// tells that it has begun, and looks again once it may end.
fn sampled(alive: &Arc<AtomicI64>) -> (Plan, Told, Arc<Barrier>) {
    let (tells, told) = mpsc::channel();
    let held = Arc::new(Barrier::new(2));
    let writer = create_dag();
    writer.relative_deadline(PERIOD);
    let mut count = 0;
    let of_writer = Arc::clone(alive);
    let count = move || {
        count += 1;
        (Counted::new(count - 1, &of_writer),)
    };
    writer.register_periodic_subtask(count, vec!["count"], PERIOD, named("count"));
    let latest = writer.latest::<Counted>("count");
    let reader = create_dag();
    reader.relative_deadline(PERIOD);
    let of_reader = Arc::clone(&held);
    reader.using(latest.sample()).register_periodic_subtask(
        move |sample: Option<Sample<'_, Counted>>| {
            let look = || {
                let sample = sample?;
                assert_eq!(sample.value.copies, [sample.value.job; 8], "torn");
                Some((sample.value.job, sample.completed_ns))
            };
            let first = look();
            of_reader.wait();
            of_reader.wait();
            assert_eq!(look(), first, "a sample does not change during an instance");
            tells.send(first).expect("the test listens");
        },
        vec![],
        PERIOD,
        named("sample"),
    );
    (commit(&[writer, reader]), told, held)
}

#[test]
fn a_sample_stays_whole_while_its_writer_goes_on() {
    let jobs = if cfg!(miri) { 20 } else { 5_000 };
    let alive = Arc::new(AtomicI64::new(0));
    let (mut plan, told, held) = sampled(&alive);
    let [writer, reader] = &mut plan.bodies[..] else {
        panic!("two dags");
    };
    for (round, expected) in [(0, None), (1, Some((jobs - 1, jobs - 1)))] {
        thread::scope(|scope| {
            scope.spawn(|| reader[0].run(round));
            held.wait();
            for job in round * jobs..(round + 1) * jobs {
                writer[0].run(job);
                writer[0].complete(job, &mut |_| ());
            }
            held.wait();
        });
        assert_eq!(told.try_recv(), Ok(expected));
    }
    drop(plan);
    assert_eq!(alive.load(Ordering::Relaxed), 0);
}

#[test]
fn completions_too_many_and_too_few_show_what_was_run_last() {
    let alive = Arc::new(AtomicI64::new(0));
    let (mut plan, told, held) = sampled(&alive);
    let [writer, reader] = &mut plan.bodies[..] else {
        panic!("two dags");
    };
    let mut sample = || {
        thread::scope(|scope| {
            scope.spawn(|| reader[0].run(0));
            held.wait();
            held.wait();
        });
        told.try_recv().expect("the subtask has told")
    };
    writer[0].complete(1, &mut |_| ());
    assert_eq!(sample(), None, "completed and never run");
    for job in 0..5 {
        writer[0].run(job);
    }
    assert_eq!(sample(), None, "run five times and not completed");
    writer[0].complete(7, &mut |_| ());
    writer[0].complete(8, &mut |_| ());
    assert_eq!(sample(), Some((4, 7)), "completed twice");
    assert_eq!(sample(), Some((4, 7)));
    drop(plan);
    assert_eq!(alive.load(Ordering::Relaxed), 0);
}

#[test]
fn a_signal_is_raised_once_however_often_it_is_completed() {
    let sporadic = create_dag();
    sporadic.relative_deadline(PERIOD);
    let signal = sporadic.register_sporadic_subtask(|| (), vec![], PERIOD, named("answer"));
    let dag = create_dag();
    dag.relative_deadline(PERIOD);
    let mut is_first = true;
    dag.using(signal.raising()).register_periodic_subtask(
        move |mut signal: Raiser<'_>| {
            if std::mem::take(&mut is_first) {
                signal.raise();
                signal.raise();
            }
        },
        vec![],
        PERIOD,
        named("ask"),
    );
    let mut plan = commit(&[dag, sporadic]);
    let ask = &mut plan.bodies[0][0];
    let mut raised = Vec::new();
    ask.complete(0, &mut |dag| raised.push(dag.0));
    assert_eq!(raised, [], "not run yet");
    ask.run(0);
    ask.run(0);
    for _ in 0..3 {
        ask.complete(0, &mut |dag| raised.push(dag.0));
    }
    assert_eq!(raised, [1]);
}
