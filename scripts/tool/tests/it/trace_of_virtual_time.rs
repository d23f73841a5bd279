//! The trace checker on traces of the real scheduler in virtual time.
//!
//! Random sets of DAGs run in virtual time, under all policies, and leave the
//! trace that a kernel without any latency would leave. Three properties:
//!
//! - such a trace has no breach, at a bound of 0;
//! - nor has it when the oldest events are lost;
//! - with one lie in it, it has a breach.
//!
//! More or other sets: `TRACES=100000 TRACE_SEED=7 cargo test -p tool --test it trace`.

use common::random::Random;
use sched_dag::TaskSet;
use sched_dag::virtual_time::{ExecutionTimes, VirtualTime};
use tool::record::Run;
use tool::trace::check;

use crate::lies;
use crate::sets::set::{self, Overruns, Set};
use crate::sets::{commit, number};

/// Draws a set from each seed, runs it, and passes its trace on.
fn for_each_trace(count: u64, mut with: impl FnMut(u64, &mut Random, Run)) {
    let count = number("TRACES", count);
    let first_seed = number("TRACE_SEED", 1);
    println!("{count} sets from seed {first_seed} on");
    for seed in (first_seed..).take(usize::try_from(count).expect("a count")) {
        let mut random = Random::new(seed);
        let overruns = random.one_of(&[Overruns::Often, Overruns::Never]);
        let mut set = set::draw(&mut random, overruns);
        // An instance of no length has all its events in one instant.
        set.has_instances_of_no_length = true;
        let run = record(&set);
        with(seed, &mut random, run);
    }
}

/// Runs a set to its end, and returns its trace.
fn record(set: &Set) -> Run {
    let task_set = commit(&set.specs(), set.options);
    let mut run = VirtualTime::new(&task_set, set.options).recording();
    let _ = run.run(&mut ExecutionTimes(|instance| set.execution_ns(instance)));
    Run {
        number: 0,
        options: set.options,
        usual_bound_ns: 0,
        task_set: TaskSet::clone(&task_set),
        samplings: Vec::new(),
        bounds_ns: Vec::new(),
        events: run.events(),
        lost: 0,
        complete: true,
    }
}

/// Loses the oldest events.
fn lose(run: &mut Run, random: &mut Random) {
    if !run.events.is_empty() {
        let lost = random.index(run.events.len());
        run.events.drain(..lost);
        run.lost = u64::try_from(lost).expect("few events");
        run.complete = lost == 0;
    }
}

/// Fails if a run has a breach.
fn assert_right(seed: u64, run: &Run) {
    let breaches = check(run, 0).breaches;
    let texts: Vec<String> = breaches.iter().map(ToString::to_string).collect();
    assert!(
        texts.is_empty(),
        "seed {seed}:\n{texts:#?}\n{:#?}",
        run.events
    );
}

#[test]
fn a_right_trace_has_no_breach_also_if_its_oldest_events_are_lost() {
    let (mut preemptions, mut instances) = (0, 0);
    for_each_trace(1000, |seed, random, mut run| {
        assert_right(seed, &run);
        let figures = check(&run, 0).figures;
        assert_eq!(figures.finish_to_ready_max_ns, 0);
        assert_eq!(figures.longest_inversion_ns, 0);
        preemptions += figures.preemptions;
        instances += figures.instances;
        lose(&mut run, random);
        if !run.events.is_empty() {
            assert_right(seed, &run);
        }
    });
    // The sets had events worth checking.
    println!("{instances} instances, {preemptions} preemptions");
    assert!(instances > 1000 && preemptions > 300);
}

#[test]
fn a_trace_with_a_lie_has_a_breach() {
    let mut told = lies::LIES.map(|_| 0);
    for_each_trace(500, |seed, random, truth| {
        for (count, lie) in told.iter_mut().zip(lies::LIES) {
            let mut run = truth.clone();
            if lies::tell(lie, &mut run, random) {
                *count += 1;
                let (name, breaches) = (lie.0, check(&run, 0).breaches);
                let events = &run.events;
                assert!(!breaches.is_empty(), "seed {seed}: `{name}` in {events:#?}");
            }
        }
    });
    for (count, (name, ..)) in told.iter().zip(lies::LIES) {
        println!("{name}: {count}");
        assert!(*count > 50, "`{name}` was told {count} times only");
    }
}
