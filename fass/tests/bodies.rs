//! Bodies driven by hand: what a platform may do with them, and what it may not.

mod support;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;

use fass::{Dag, Plan, Unique, create_dag};
use support::{PERIOD, commit, named, panic_message, run_job};

/// A source that counts, a middle that doubles, a sink that sends what it sees.
fn chain(in_flight: u32) -> (Dag, mpsc::Receiver<(u64, u64)>) {
    let (seen, sees) = mpsc::channel();
    let dag = create_dag();
    dag.name("chain").in_flight(in_flight);
    let mut count = 0_u64;
    let source = move || {
        count += 1;
        (count - 1,)
    };
    dag.register_periodic_subtask(source, vec!["count"], PERIOD, named("source"));
    dag.register_subtask(
        |(count,): (u64,)| (count, 2 * count),
        vec!["count"],
        vec!["same", "double"],
        named("middle"),
    );
    dag.register_sink_subtask(
        move |pair: (u64, u64)| seen.send(pair).expect("the test listens"),
        vec!["same", "double"],
        PERIOD,
        named("sink"),
    );
    (dag, sees)
}

#[test]
fn one_run_is_one_instance() {
    let (dag, sees) = chain(1);
    let mut plan = commit(&[dag]);
    for job in 0..5 {
        run_job(&mut plan, job);
        assert_eq!(sees.try_iter().collect::<Vec<_>>(), [(job, 2 * job)]);
    }
}

#[test]
fn jobs_in_flight_keep_their_values_apart() {
    let (dag, sees) = chain(3);
    let mut plan = commit(&[dag]);
    let bodies = &mut plan.bodies[0];
    // A pipeline: the source is two jobs ahead of the sink.
    for job in 0..3 {
        bodies[0].run(job);
    }
    for job in 0..2 {
        bodies[1].run(job);
    }
    for job in 0..20 {
        bodies[2].run(job);
        bodies[1].run(job + 2);
        bodies[0].run(job + 3);
        assert_eq!(sees.try_iter().collect::<Vec<_>>(), [(job, 2 * job)]);
    }
}

#[test]
fn jobs_may_be_skipped() {
    let (dag, sees) = chain(2);
    let mut plan = commit(&[dag]);
    for job in [0, 3, 4, 9] {
        run_job(&mut plan, job);
    }
    assert_eq!(sees.try_iter().count(), 4);
    // Jobs in flight with a gap: release 12 was skipped.
    for body in &mut plan.bodies[0] {
        body.run(11);
        body.run(13);
    }
    assert_eq!(sees.try_iter().collect::<Vec<_>>(), [(4, 8), (5, 10)]);
}

#[test]
fn r3_nothing_is_visible_before_the_function_has_returned() {
    let (entered, enters) = mpsc::channel();
    let (leave, left) = mpsc::channel::<()>();
    let left = Mutex::new(left);
    let dag = create_dag();
    dag.register_periodic_subtask(
        move || {
            entered.send(()).expect("the test listens");
            left.lock()
                .expect("one user")
                .recv()
                .expect("the test lets go");
            (1, 2)
        },
        vec!["one", "two"],
        PERIOD,
        named("source"),
    );
    dag.register_sink_subtask(
        |_: (i32, i32)| (),
        vec!["one", "two"],
        PERIOD,
        named("sink"),
    );
    let mut plan = commit(&[dag]);
    let mut sink = plan.bodies[0].pop().expect("the sink");
    let mut source = plan.bodies[0].pop().expect("the source");
    thread::scope(|scope| {
        scope.spawn(move || source.run(0));
        enters.recv().expect("the source is inside its function");
        let message = panic_message(|| sink.run(0));
        assert!(
            message.contains("an input of job 0 is missing"),
            "{message}"
        );
        leave.send(()).expect("the source waits");
    });
}

#[test]
fn discarding_makes_room_for_a_later_job() {
    let (dag, sees) = chain(1);
    let mut plan = commit(&[dag]);
    let bodies = &mut plan.bodies[0];
    bodies[0].run(0);
    bodies[1].run(0);
    bodies[2].discard(0);
    bodies[2].discard(0); // harmless
    bodies[1].discard(0); // nothing there
    run_job(&mut plan, 1);
    assert_eq!(sees.try_iter().collect::<Vec<_>>(), [(1, 2)]);
}

#[test]
fn a_discarded_value_is_dropped_by_who_needs_its_slot() {
    let (dag, value) = (create_dag(), Arc::new(()));
    dag.in_flight(1);
    let source = {
        let value = Arc::clone(&value);
        move || (Arc::clone(&value),)
    };
    dag.register_periodic_subtask(source, vec!["value"], PERIOD, named("source"));
    dag.register_sink_subtask(|_: (Arc<()>,)| (), vec!["value"], PERIOD, named("sink"));
    let mut plan = commit(&[dag]);
    plan.bodies[0][0].run(0);
    assert_eq!(Arc::strong_count(&value), 3);
    plan.bodies[0][1].discard(0);
    assert_eq!(Arc::strong_count(&value), 3, "not by the scheduler's step");
    plan.bodies[0][0].run(1);
    assert_eq!(Arc::strong_count(&value), 3, "one went, one came");
    plan.bodies[0][1].discard(1);
    drop(plan);
    assert_eq!(Arc::strong_count(&value), 1, "dropped with the plan");
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

#[test]
fn a_platform_that_starts_too_early_is_told() {
    let (dag, _sees) = chain(1);
    let mut plan = commit(&[dag]);
    plan.bodies[0][0].run(0);
    let message = panic_message(|| plan.bodies[0][2].run(0));
    assert_eq!(
        message,
        "an input of job 0 is missing: the platform started the instance before all its \
         predecessors were complete"
    );
}

#[test]
fn a_platform_that_forgets_to_discard_is_told() {
    let (dag, _sees) = chain(1);
    let mut plan = commit(&[dag]);
    plan.bodies[0][0].run(0);
    let message = panic_message(|| plan.bodies[0][0].run(1));
    assert_eq!(
        message,
        "an output of job 1 finds no free slot: the platform cancelled an instance without \
         discarding its inputs, or exceeded the jobs in flight"
    );
}

#[test]
fn a_body_that_panicked_cannot_run_again() {
    let dag = create_dag();
    let source = || -> (i32,) { panic!("broken sensor") };
    dag.register_periodic_subtask(source, vec!["value"], PERIOD, named("source"));
    dag.register_sink_subtask(|_: (i32,)| (), vec!["value"], PERIOD, named("sink"));
    let mut plan = commit(&[dag]);
    let source = &mut plan.bodies[0][0];
    assert_eq!(panic_message(|| source.run(7)), "broken sensor");
    let again = "the subtask panicked in job 7 and cannot continue";
    assert_eq!(panic_message(|| source.run(8)), again);
    source.discard(8); // runs nothing
}

#[test]
fn bodies_may_move_between_threads_from_job_to_job() {
    let (dag, sees) = chain(2);
    let mut plan = commit(&[dag]);
    let jobs = 2_000;
    for job in 0..jobs {
        let [source, middle, sink] = &mut plan.bodies[0][..] else {
            panic!("three subtasks");
        };
        if job % 100 == 0 {
            // Each body on its own fresh thread, one after the other.
            for body in [source, middle, sink] {
                thread::scope(|scope| {
                    scope.spawn(move || body.run(job));
                });
            }
        } else {
            [source, middle, sink]
                .into_iter()
                .for_each(|body| body.run(job));
        }
    }
    let seen: Vec<_> = sees.try_iter().collect();
    let expected: Vec<_> = (0..jobs).map(|job| (job, 2 * job)).collect();
    assert_eq!(seen, expected);
}

/// Three threads, one a subtask, as fast as they can; completion is announced
/// by counters, as a platform's scheduler would.
#[test]
fn a_pipeline_on_three_threads_keeps_every_job() {
    const JOBS: u64 = 20_000;
    const IN_FLIGHT: usize = 4;
    let (dag, sees) = chain(4);
    let mut plan = commit(&[dag]);
    let done = [const { AtomicUsize::new(0) }; 3];
    thread::scope(|scope| {
        for (number, mut body) in plan.bodies.remove(0).into_iter().enumerate() {
            let done = &done;
            scope.spawn(move || {
                for job in 0..JOBS {
                    let index = usize::try_from(job).expect("small");
                    let is_granted = || match number {
                        0 => index < done[2].load(Ordering::Acquire) + IN_FLIGHT,
                        _ => index < done[number - 1].load(Ordering::Acquire),
                    };
                    while !is_granted() {
                        thread::yield_now();
                    }
                    body.run(job);
                    done[number].store(index + 1, Ordering::Release);
                }
            });
        }
    });
    let seen: Vec<_> = sees.try_iter().collect();
    let expected: Vec<_> = (0..JOBS).map(|job| (job, 2 * job)).collect();
    assert_eq!(seen, expected);
}
