//! What was recorded in one run is computed again in others.

mod latest;
#[path = "../support/mod.rs"]
mod support;
mod until;
mod wrong;

use std::ops::AddAssign;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use fass::{
    Dag, FaultLimit, Occupation, OverrunPolicy, Policy, create_dag, execute_for, finish_create_dags,
};
use recording::{Recording, What};
use support::{ms, named};
use virtual_time::{Report, VirtualTime};

const FAULT_LIMIT: FaultLimit = FaultLimit {
    faults: 1,
    window: 1,
    in_all: 8,
};

/// A source that counts on.
fn counting<T: Copy + AddAssign + From<u8>>(from: T) -> impl FnMut() -> (T,) {
    let mut count = from;
    move || {
        count += T::from(1);
        (count,)
    }
}

/// A fork and a join, each branch with a memory, from a source that counts on from `from`.
fn forked(from: u64) -> Dag {
    let dag = create_dag();
    dag.name("forked").jobs(20).in_flight(3);
    (dag.record::<u64>("seed").record::<(u64, f64)>("left"))
        .record::<Vec<u64>>("right")
        .record::<String>("joined");
    let mut seed = from;
    let source = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed,)
    };
    dag.register_periodic_subtask(source, vec!["seed"], ms(10), named("source"));
    let mut sum = 0_u64;
    let left = move |(seed,): (u64,)| {
        execute_for(ms(seed % 7), Occupation::Hold);
        sum = sum.rotate_left(3) ^ seed;
        ((sum, 1.0 / 3.0),)
    };
    dag.register_subtask(left, vec!["seed"], vec!["left"], named("left"));
    let mut last = Vec::new();
    let right = move |(seed,): (u64,)| {
        execute_for(ms(seed % 5), Occupation::Hold);
        last.push(seed);
        (last[last.len().saturating_sub(3)..].to_vec(),)
    };
    dag.register_subtask(right, vec!["seed"], vec!["right"], named("right"));
    let join = |(left, right): ((u64, f64), Vec<u64>)| (format!("{} {}", left.0, right.len()),);
    dag.register_subtask(join, vec!["left", "right"], vec!["joined"], named("join"));
    dag.register_sink_subtask(|_: (String,)| (), vec!["joined"], ms(25), named("sink"));
    dag
}

fn record(machine: &VirtualTime, dags: &[Dag]) -> Vec<u8> {
    finish_create_dags(dags).expect("sound");
    machine.run();
    machine.recording()
}

fn replay(recording: &[u8], machine: VirtualTime, dags: &[Dag]) -> (Report, Vec<u8>) {
    let machine = machine.replay(recording).expect("whole");
    finish_create_dags(dags).expect("sound");
    let report = machine.run();
    assert_eq!(report.violations(), []);
    (report, machine.recording())
}

/// Returns the values of a recording, without their times.
fn values(bytes: &[u8]) -> Vec<(u16, u64, Vec<u8>)> {
    let recording = Recording::read(bytes).expect("whole");
    let entries = recording
        .entries()
        .filter(|entry| entry.what == What::Value);
    let mut values: Vec<_> = entries
        .map(|entry| (entry.place, entry.job, entry.value.to_vec()))
        .collect();
    values.sort();
    values
}

#[test]
fn a_replay_computes_the_same_bytes_on_any_number_of_cores() {
    let recording = record(&VirtualTime::new().cores(2), &[forked(7)]);
    assert_eq!(values(&recording).len(), 4 * 20);
    for cores in [1, 2, 4, 8] {
        for policy in [Policy::Edf, Policy::StaticPriority] {
            let machine = VirtualTime::new().cores(cores).policy(policy);
            let (report, again) = replay(&recording, machine, &[forked(1_000)]);
            assert_eq!((report.compared, report.uncompared), (60, 0));
            assert_eq!(report.divergence, None);
            assert_eq!(values(&again), values(&recording));
        }
    }
}

/// Two branches that count what both have done, which no edge carries.
fn cheating() -> Dag {
    let dag = create_dag();
    dag.name("cheating").jobs(3);
    dag.record::<u8>("start")
        .record::<u64>("left")
        .record::<u64>("right");
    dag.register_periodic_subtask(|| (0_u8,), vec!["start"], ms(10), named("source"));
    let behind = Arc::new(AtomicU64::new(0)); // behind the scheduler's back
    for (name, first, takes) in [("left", "slow", ms(3)), ("right", "quick", ms(1))] {
        let wait = move |(_,): (u8,)| {
            execute_for(takes, Occupation::Hold);
            (0_u8,)
        };
        dag.register_subtask(wait, vec!["start"], vec![first], named(first));
        let behind = Arc::clone(&behind);
        let count = move |(_,): (u8,)| (behind.fetch_add(1, Ordering::Relaxed),);
        dag.register_subtask(count, vec![first], vec![name], named(name));
    }
    dag.register_sink_subtask(
        |_: (u64, u64)| (),
        vec!["left", "right"],
        ms(10),
        named("join"),
    );
    dag
}

#[test]
fn an_app_that_shares_behind_the_schedulers_back_diverges() {
    let recording = record(&VirtualTime::new().cores(2), &[cheating()]);
    let (report, _) = replay(&recording, VirtualTime::new().cores(2), &[cheating()]);
    assert_eq!(report.divergence, None, "nothing else has happened");
    let (report, _) = replay(&recording, VirtualTime::new().cores(1), &[cheating()]);
    let divergence = report.divergence.expect("they come in another order");
    assert_eq!(
        divergence.to_string(),
        "topic `left` of dag `cheating` diverges in job 0: 1 is recorded, and 0 is computed; does \
         a function share something behind the scheduler's back?"
    );
}

/// A DAG that is too slow for its period, and gives up jobs.
fn overrun(policy: OverrunPolicy, from: u64) -> Dag {
    let dag = create_dag();
    dag.name("slow").jobs(12).in_flight(1).overrun(policy);
    dag.record::<u64>("input").record::<u64>("sum");
    let mut input = from;
    let source = move || {
        input += 1;
        execute_for(ms(input * 5 % 17), Occupation::Hold);
        (input,)
    };
    dag.register_periodic_subtask(source, vec!["input"], ms(10), named("source"));
    let mut sum = 0;
    let add = move |(input,): (u64,)| {
        sum += input;
        execute_for(ms(sum % 13), Occupation::Hold);
        (sum,)
    };
    dag.register_subtask(add, vec!["input"], vec!["sum"], named("add"));
    dag.register_sink_subtask(|_: (u64,)| (), vec!["sum"], ms(30), named("sink"));
    dag
}

#[test]
fn jobs_that_were_skipped_or_cut_are_passed_over() {
    for policy in [OverrunPolicy::Skip, OverrunPolicy::Abort] {
        let machine = VirtualTime::new().cores(1);
        let recording = record(&machine, &[overrun(policy, 0)]);
        let sums = values(&recording)
            .iter()
            .filter(|value| value.0 == 1)
            .count();
        assert!((2..12).contains(&sums), "{sums}");
        // Queued releases leave none out, whatever they take.
        let slow = overrun(OverrunPolicy::Queue, 500);
        let (report, again) = replay(&recording, VirtualTime::new().cores(1), &[slow]);
        assert_eq!((report.compared, report.uncompared), (sums as u64, 0));
        assert_eq!(report.divergence, None);
        assert_eq!(values(&again), values(&recording));
    }
}

#[test]
fn signals_come_when_they_came() {
    let build = |from: u64| {
        let dag = create_dag();
        dag.name("button")
            .record::<u64>("press")
            .record::<u64>("count");
        let mut press = from;
        let source = move || {
            press += 3;
            (press,)
        };
        let signal = dag.sporadic(ms(5));
        dag.source(source)
            .writes(&["press"])
            .register(named("press"));
        let mut count = 0;
        let add = move |(press,): (u64,)| {
            count += press;
            (count,)
        };
        dag.register_subtask(add, vec!["press"], vec!["count"], named("add"));
        dag.register_sink_subtask(|_: (u64,)| (), vec!["count"], ms(5), named("sink"));
        (dag, signal)
    };
    let machine = VirtualTime::new();
    let (dag, signal) = build(0);
    finish_create_dags(&[dag]).expect("sound");
    for time in [2, 3, 40] {
        machine.raise_at(&signal, ms(time));
    }
    let releases =
        |report: &Report| -> Vec<u64> { report.jobs.iter().map(|job| job.release_ns).collect() };
    let wanted = releases(&machine.run());
    assert_eq!(wanted, [2_000_000, 7_000_000, 40_000_000]);

    let again = VirtualTime::new()
        .replay(&machine.recording())
        .expect("whole");
    let (dag, signal) = build(90);
    finish_create_dags(&[dag]).expect("sound");
    again.raise_at(&signal, ms(100)); // not in the recording
    let report = again.run();
    assert_eq!(releases(&report), wanted);
    assert_eq!((report.compared, report.divergence), (3, None));
}

#[test]
fn jobs_of_a_sporadic_dag_that_were_skipped_keep_their_numbers() {
    let build = |from: u64, overrun| {
        let dag = create_dag();
        dag.name("burst").in_flight(1).overrun(overrun);
        dag.record::<u64>("press").record::<u64>("sum");
        let mut press = from;
        let source = move || {
            press += 1;
            execute_for(ms(if press == 1 { 8 } else { 1 }), Occupation::Hold);
            (press,)
        };
        let signal = dag.sporadic(ms(5));
        dag.source(source)
            .writes(&["press"])
            .register(named("press"));
        let mut sum = 0;
        let add = move |(press,): (u64,)| {
            sum += press;
            (sum,)
        };
        dag.register_subtask(add, vec!["press"], vec!["sum"], named("add"));
        dag.register_sink_subtask(|_: (u64,)| (), vec!["sum"], ms(20), named("sink"));
        (dag, signal)
    };
    let machine = VirtualTime::new();
    let (dag, signal) = build(0, OverrunPolicy::Skip);
    finish_create_dags(&[dag]).expect("sound");
    for time in [0, 5, 10, 20] {
        machine.raise_at(&signal, ms(time));
    }
    machine.run();
    let recording = machine.recording();
    let jobs: Vec<u64> = values(&recording).iter().map(|value| value.1).collect();
    assert_eq!(jobs, [0, 2, 3, 0, 2, 3], "job 1 is skipped");
    let (dag, _) = build(70, OverrunPolicy::Queue);
    let (report, again) = replay(&recording, VirtualTime::new(), &[dag]);
    assert_eq!((report.compared, report.uncompared), (3, 0));
    assert_eq!(report.divergence, None);
    assert_eq!(values(&again), values(&recording));
}

#[test]
fn a_fault_is_replayed() {
    let build = |from: u32| {
        let dag = create_dag();
        dag.name("frail").jobs(8);
        dag.survive_faults(FAULT_LIMIT);
        dag.record::<u32>("input").record::<u32>("output");
        let source = counting(from);
        dag.register_periodic_subtask(source, vec!["input"], ms(10), named("source"));
        dag.restarting(|| {
            let mut calls = 0;
            move |(input,): (u32,)| {
                calls += 1;
                assert!(input != 3, "three");
                (input * 10 + calls,)
            }
        })
        .reads(&["input"])
        .writes(&["output"])
        .register(named("work"));
        dag.register_sink_subtask(|_: (u32,)| (), vec!["output"], ms(10), named("sink"));
        dag
    };
    let recording = record(&VirtualTime::new().contain_panics(), &[build(0)]);
    let machine = VirtualTime::new().cores(4).contain_panics();
    let (report, again) = replay(&recording, machine, &[build(70)]);
    assert_eq!((report.panics.len(), report.panics[0].instance.job), (1, 2));
    assert_eq!((report.compared, report.divergence), (7, None));
    assert_eq!(values(&again), values(&recording));
}

#[test]
fn what_ran_next_to_a_fault_runs_in_its_replay() {
    let build = || {
        let dag = create_dag();
        dag.name("forked").jobs(4);
        dag.survive_faults(FAULT_LIMIT);
        let source = counting(0_u32);
        dag.register_periodic_subtask(source, vec!["in"], ms(10), named("source"));
        dag.restarting(|| {
            |(input,): (u32,)| {
                execute_for(ms(2), Occupation::Hold);
                assert!(input != 2, "two");
                (input,)
            }
        })
        .reads(&["in"])
        .writes(&["frail"])
        .register(named("frail"));
        let mut sum = 0;
        let add = move |(input,): (u32,)| {
            execute_for(ms(1), Occupation::Hold);
            sum += input;
            (sum,)
        };
        dag.register_subtask(add, vec!["in"], vec!["sum"], named("sum"));
        let join = |_: (u32, u32)| ();
        dag.register_sink_subtask(join, vec!["frail", "sum"], ms(10), named("join"));
        (dag.record::<u32>("in").record::<u32>("frail")).record::<u32>("sum");
        dag
    };
    // On two cores `sum` runs in job 1 as well, on one the fault would cut it.
    let recording = record(&VirtualTime::new().cores(2).contain_panics(), &[build()]);
    let machine = VirtualTime::new().contain_panics();
    let (report, again) = replay(&recording, machine, &[build()]);
    assert_eq!((report.compared, report.divergence), (3 + 4, None));
    assert_eq!(values(&again), values(&recording));
}
