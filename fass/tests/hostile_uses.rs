//! A platform that keeps no rule, and what subtasks use besides their inputs: states,
//! latest values and signals. It runs users of a state at once, and completes
//! instances never, twice, or before they have run.

mod support;

use core::time::Duration;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Instant;

use fass::{Plan, Raiser, Request, Sample, create_dag};
use sched_dag::DagId;
use support::{PERIOD, commit, named, panic_message};

/// How long a test waits for what has to come, on however busy a host.
const PATIENCE: Duration = Duration::from_secs(300);

/// Where a subtask and the test wait for each other; to wait in vain is a panic.
#[derive(Default)]
struct Meeting(AtomicU64);

impl Meeting {
    fn wait(&self) {
        let before = self.0.fetch_add(1, Ordering::AcqRel);
        let both = before / 2 * 2 + 2;
        let begin = Instant::now();
        while self.0.load(Ordering::Acquire) < both {
            assert!(begin.elapsed() < PATIENCE, "nobody comes");
            thread::yield_now();
        }
    }
}

/// More than a processor stores at once.
#[derive(Clone)]
struct Whole {
    job: u64,
    copies: [u64; 8],
    _of: Arc<()>,
}

impl Whole {
    fn new(job: u64, of: &Arc<()>) -> Self {
        Self {
            job,
            copies: [job; 8],
            _of: Arc::clone(of),
        }
    }
}

/// A state that one subtask updates and two others read; each holds it until the test
/// has met it twice.
fn with_state(held: &[Arc<Meeting>; 3]) -> Plan {
    let dag = create_dag();
    let state = dag.state("pair", (0_u64, 0_u64));
    let [update, first, second] = held.clone();
    dag.period(PERIOD)
        .using(state.update())
        .source(move |pair: &mut (u64, u64)| {
            pair.0 += 1;
            update.wait();
            update.wait();
            pair.1 += 1;
            (pair.0,)
        })
        .writes(&["count"])
        .register(named("update"));
    let read = |held: Arc<Meeting>| {
        move |pair: &(u64, u64), (count,): (u64,)| {
            assert_eq!((pair.0, pair.1), (count, count), "in mid-change");
            held.wait();
            held.wait();
            (count,)
        }
    };
    let counts = || vec!["count"];
    dag.using(state.read())
        .subtask(read(first))
        .reads(&counts())
        .writes(&["first"])
        .register(named("first"));
    dag.using(state.read())
        .subtask(read(second))
        .reads(&counts())
        .writes(&["second"])
        .register(named("second"));
    let join = |(first, second): (u64, u64)| assert_eq!(first, second);
    dag.register_sink_subtask(join, vec!["first", "second"], PERIOD, named("join"));
    commit(&[dag])
}

const IN_USE: &str = "a state is in use by another subtask: the platform started the instance \
                      before all its predecessors were complete";

#[test]
fn readers_share_a_state_and_an_update_at_the_same_time_is_refused() {
    let held = [(); 3].map(|()| Arc::<Meeting>::default());
    let mut plan = with_state(&held);
    let [update, first, second, join] = &mut plan.bodies[0][..] else {
        panic!("four subtasks");
    };
    let through = |meeting: &Meeting| {
        meeting.wait();
        meeting.wait();
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
    let held = [(); 3].map(|()| Arc::<Meeting>::default());
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

/// A writer of values, and a subtask of another DAG that samples them: it
/// tells that it has begun, and looks again once it may end.
fn sampled(of: &Arc<()>) -> (Plan, Told, Arc<Meeting>) {
    let (tells, told) = mpsc::channel();
    let held = Arc::<Meeting>::default();
    let writer = create_dag();
    writer.relative_deadline(PERIOD);
    let mut count = 0;
    let of_writer = Arc::clone(of);
    let count = move || {
        count += 1;
        (Whole::new(count - 1, &of_writer),)
    };
    writer.register_periodic_subtask(count, vec!["count"], PERIOD, named("count"));
    let latest = writer.latest::<Whole>("count");
    let reader = create_dag();
    reader.relative_deadline(PERIOD);
    let of_reader = Arc::clone(&held);
    reader
        .period(PERIOD)
        .using(latest.sample())
        .source(move |sample: Option<Sample<'_, Whole>>| {
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
        })
        .register(named("sample"));
    (commit(&[writer, reader]), told, held)
}

#[test]
fn a_sample_stays_whole_while_its_writer_goes_on() {
    let jobs = if cfg!(miri) { 20 } else { 5_000 };
    let of = Arc::new(());
    let (mut plan, told, held) = sampled(&of);
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
    assert_eq!(Arc::strong_count(&of), 1);
}

#[test]
fn completions_too_many_and_too_few_show_what_was_run_last() {
    let of = Arc::new(());
    let (mut plan, told, held) = sampled(&of);
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
    assert_eq!(Arc::strong_count(&of), 1);
}

#[test]
fn a_signal_is_raised_once_however_often_it_is_completed() {
    let sporadic = create_dag();
    sporadic.relative_deadline(PERIOD);
    let signal = sporadic.sporadic(PERIOD);
    sporadic.source(|| ()).register(named("answer"));
    let dag = create_dag();
    dag.relative_deadline(PERIOD);
    let mut is_first = true;
    dag.period(PERIOD)
        .using(signal.raising())
        .source(move |mut signal: Raiser<'_>| {
            if std::mem::take(&mut is_first) {
                signal.raise();
                signal.raise();
            }
        })
        .register(named("ask"));
    let mut plan = commit(&[dag, sporadic]);
    let ask = &mut plan.bodies[0][0];
    let mut raised = Vec::new();
    ask.complete(0, &mut |request| raised.push(request));
    assert_eq!(raised, [], "not run yet");
    ask.run(0);
    ask.run(0);
    for _ in 0..3 {
        ask.complete(0, &mut |request| raised.push(request));
    }
    assert_eq!(raised, [Request::Signal(DagId(1))]);
}
