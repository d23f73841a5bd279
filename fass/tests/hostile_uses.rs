//! A platform that keeps no rule, and what subtasks use besides their inputs: states,
//! latest values and signals. It runs users of a state at once, and a writer while its
//! value is looked at, and completes instances never, twice, or before they have run.

mod support;

use std::sync::{Arc, mpsc};

use fass::{Raiser, Request, Sample, create_dag};
use sched_dag::DagId;
use support::{PERIOD, Shared, commit, inside, named, panic_message};

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

#[test]
fn a_state_that_is_being_changed_is_refused_to_readers() {
    let [update, first, second, _] = with_state();
    update.run(0);
    let full = panic_message(|| {
        // The pair is (2, 1) now.
        let look = move || assert_eq!(panic_message(|| first.run(0)), IN_USE);
        update.run_while(1, look);
    });
    // Its readers have not run: they hold no value of job 1, and both slots.
    assert!(full.contains("finds no free slot"), "{full}");
    // The update has ended, if by a panic, and given the state back: it is (2, 2).
    let late = panic_message(|| second.run(0));
    assert!(
        late.contains("in mid-change"),
        "it is not job 0's any more: {late}"
    );
}

/// A job's number, in more words than a processor stores at once.
#[derive(Clone)]
struct Whole {
    copies: [u64; 8],
    _alive: Arc<()>,
}

/// Of which job a sample was, and when that was complete.
type Told = mpsc::Receiver<Option<(u64, u64)>>;

/// A writer of values, and a subtask of another DAG that samples them twice in each instance.
fn sampled(alive: &Arc<()>) -> ([Shared; 2], Told) {
    let (tells, told) = mpsc::channel();
    let (writer, reader) = (create_dag(), create_dag());
    let (mut next, of_writer) = (0, Arc::clone(alive));
    let count = move || {
        next += 1;
        let (copies, _alive) = ([next - 1; 8], Arc::clone(&of_writer));
        (Whole { copies, _alive },)
    };
    writer.register_periodic_subtask(count, vec!["count"], PERIOD, named("count"));
    let latest = writer.relative_deadline(PERIOD).latest::<Whole>("count");
    let sample = move |sample: Option<Sample<'_, Whole>>| {
        let look = || {
            let sample = sample?;
            assert_eq!(sample.value.copies, [sample.job; 8], "torn");
            Some((sample.job, sample.completed_ns))
        };
        let first = look();
        inside();
        assert_eq!(look(), first, "a sample does not change during an instance");
        tells.send(first).expect("the test listens");
    };
    reader.period(PERIOD).relative_deadline(PERIOD);
    let source = reader.using(latest.sample()).source(sample);
    source.register(named("sample"));
    (Shared::all(commit(&[writer, reader])), told)
}

#[test]
fn a_sample_stays_whole_while_its_writer_goes_on() {
    let (jobs, alive) = (if cfg!(miri) { 20 } else { 5_000 }, Arc::new(()));
    let ([writer, reader], told) = sampled(&alive);
    for (round, expected) in [(0, None), (1, Some((jobs - 1, jobs - 1)))] {
        let writer = writer.clone();
        reader.run_while(round, move || {
            for job in round * jobs..(round + 1) * jobs {
                writer.run(job);
                writer.complete(job);
            }
        });
        assert_eq!(told.try_recv(), Ok(expected));
    }
    drop((writer, reader));
    assert_eq!(Arc::strong_count(&alive), 1);
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
