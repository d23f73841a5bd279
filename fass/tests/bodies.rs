//! Bodies driven by hand: what a platform may do with them, and what it is told if it does
//! anything else. `hostile.rs` does it all at random.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use fass::{Plan, Unique, create_dag};
use support::{PERIOD, Shared, commit, inside, named, panic_message, run_job};

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

#[test]
fn r3_nothing_is_visible_before_the_function_has_returned() {
    let dag = create_dag();
    let source = || {
        inside();
        (1, 2)
    };
    dag.register_periodic_subtask(source, vec!["one", "two"], PERIOD, named("source"));
    let sink = |_: (i32, i32)| ();
    dag.register_sink_subtask(sink, vec!["one", "two"], PERIOD, named("sink"));
    let [source, sink] = Shared::all(commit(&[dag]));
    source.run_while(0, move || {
        let told = panic_message(|| sink.run(0));
        assert!(told.contains("an input of job 0 is missing"), "{told}");
    });
}

/// A value that counts how often it was cloned.
struct Counted(Arc<AtomicUsize>);

impl Clone for Counted {
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
        let source = move || (Counted(Arc::clone(&counter)),);
        dag.register_periodic_subtask(source, vec!["value"], PERIOD, named("source"));
        for reader in 0..readers {
            let name = named(&format!("reader {reader}"));
            dag.register_sink_subtask(|_: (Counted,)| (), vec!["value"], PERIOD, name);
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
