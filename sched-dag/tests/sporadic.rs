//! The rules S1 to S4: sporadic DAGs, released by signals.

mod support;

use std::sync::Arc;

use sched_dag::analysis::{Overheads, Settings, answer};
use sched_dag::journal::{Event, What};
use sched_dag::law::{Record, Terms, Violation, violations};
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::VirtualTime;
use sched_dag::{
    CoreId, DagId, DagSpec, Instance, OverrunPolicy, Policy, Scheduler, SchedulerOptions,
};
use support::hand::Hand;
use support::random::Random;
use support::{PREEMPTIVE, Run, Script, Spec, TWO_CORES, commit, dag, under};

/// Runs DAGs until nothing happens any more, each instance for its WCET or 1 ns.
fn run(
    specs: &[DagSpec],
    options: SchedulerOptions,
    signals: impl IntoIterator<Item = (u64, DagId)>,
    chained: Option<(u32, u32)>,
) -> Run {
    let task_set = commit(specs, options);
    let of_set = Arc::clone(&task_set);
    let wcet_ns = move |instance: Instance| {
        let subtask = of_set.dag(instance.dag).subtask(instance.subtask);
        subtask.wcet_ns().unwrap_or(1)
    };
    let signals = signals
        .into_iter()
        .map(|(at_ns, dag)| (at_ns, Request::Signal(dag)));
    let script = Script::new(wcet_ns).asking(signals).chained(chained);
    let run = script.run(VirtualTime::new(Scheduler::new(task_set, options)));
    let events = run.events.iter().copied();
    assert_eq!(violations(&run.task_set, Terms::EXACT, events), []);
    run
}

/// Runs one DAG.
fn one(spec: DagSpec, signals: &[u64]) -> Run {
    let signals = signals.iter().map(|&at_ns| (at_ns, DagId(0)));
    run(&[spec.sporadic()], PREEMPTIVE, signals, None)
}

#[test]
fn s1_an_early_signal_is_delayed_to_the_minimum_inter_arrival_time() {
    one(dag(10, 10, 4, &[0], &[]), &[3, 5, 40, 50]).must_be(
        "3 signalled 0.0, due 0.0, released 0.0
         5 signalled 0.1
         13 due 0.1, released 0.1
         40 signalled 0.2, due 0.2, released 0.2
         50 signalled 0.3, due 0.3, released 0.3",
    );
}

#[test]
fn s1_nothing_is_released_before_the_offset_or_without_a_signal() {
    one(dag(10, 10, 4, &[0], &[]).offset(100), &[7, 205])
        .must_be("100 released 0.0\n205 released 0.1\nreleased=2");
}

#[test]
fn s2_one_early_signal_is_kept_and_more_are_dropped_and_counted() {
    one(dag(10, 10, 9, &[0], &[]), &[0, 1, 2, 3, 11]).must_be(
        "0 released 0.0
         2 dropped 0.1
         3 dropped 0.1
         10 released 0.1
         20 released 0.2
         signals=5, dropped_signals=2",
    );
}

#[test]
fn s2_a_job_that_waits_for_room_counts_as_the_one_that_is_kept() {
    // Job 1 is due at 10 and waits till 25; its nominal release stays.
    let spec = dag(10, 30, 9, &[0], &[]).overrunning(1, OverrunPolicy::Queue);
    one(spec.wcets(&[25]), &[0, 10, 12, 20, 30]).must_be(
        "0 due 0.0, released 0.0
         10 queued 0.1, due 0.1
         25 released 0.1
         30 queued 0.2, due 0.2
         50 released 0.2
         dropped_signals=2, queued=2",
    );
}

#[test]
fn s3_skip_and_abort_act_on_sporadic_jobs() {
    for (overrun, counted) in [
        (OverrunPolicy::Skip, "10 skipped 0.1\nskips=1, aborts=0"),
        (OverrunPolicy::Abort, "10 aborted 0.0\nskips=0, aborts=1"),
    ] {
        let spec = dag(10, 30, 9, &[0, 0], &[(0, 1)]).overrunning(1, overrun);
        one(spec.wcets(&[15]), &[0, 10, 40]).must_be(counted);
    }
}

#[test]
fn s3_the_deadline_counts_from_the_nominal_release() {
    let spec = dag(10, 3, 4, &[0], &[]).wcets(&[3]).sporadic();
    let long = dag(100, 100, 1, &[0], &[]).wcets(&[50]);
    // Its deadlines are the earlier ones, so it preempts.
    let signals = [(1, DagId(1)), (2, DagId(1))];
    run(&[long, spec], under(Policy::Edf), signals, None)
        .must_be("1 due 1.0\n11 due 1.1\ncompleted@1=2, misses@1=0");
}

#[test]
fn s4_signals_beyond_the_limit_are_dropped() {
    one(dag(10, 10, 1, &[0], &[]), &[0, 30, 60])
        .must_be("0 released 0.0\n30 dropped 0.1\n60 dropped 0.1\ndropped_signals=2");
}

#[test]
fn s4_without_a_limit_it_keeps_no_run_going() {
    let mut hand = Hand::new(
        &[dag(10, 10, 2, &[0], &[]).sporadic().endless()],
        PREEMPTIVE,
    );
    assert!(hand.scheduler.is_finished());
    hand.must(
        "7 signal: released 0.0, finished=false
         9 finish: completed 0.0 Met, finished=true",
    );
}

#[test]
fn signals_to_an_ended_dag_are_dropped() {
    Hand::new(&[dag(10, 10, 9, &[0], &[]).sporadic()], PREEMPTIVE)
        .must("0 stop, signal: stopped 0, dropped_signals=1");
}

#[test]
fn the_check_finds_releases_that_are_too_close() {
    let task_set = commit(&[dag(10, 10, 2, &[0], &[]).sporadic()], PREEMPTIVE);
    let event = |what, time_ns, job| Event {
        time_ns,
        what,
        core: CoreId(0),
        dag: DagId(0),
        job,
        subtask: None,
    };
    let release = |(job, at_ns)| [What::Due, What::Released].map(|what| event(what, at_ns, job));
    let events = [(0, 5), (1, 14)].map(release).concat();
    let found = |events: &[Event]| {
        let terms = Terms::whole(u64::MAX);
        violations(&task_set, terms, events.iter().copied())
    };
    let expected = Violation::TooSoon {
        dag: DagId(0),
        job: 1,
        release_ns: 14,
        earliest_ns: 15,
    };
    assert_eq!(found(&events), [expected]);
    assert!(matches!(
        found(&events[1..])[..],
        [Violation::NotDue { .. }, ..]
    ));
}

/// The analysis takes a sporadic DAG for a periodic one: its bounds hold for any
/// pattern of signals.
#[test]
fn bounds_hold_for_random_signals() {
    let mut bounded = 0;
    for seed in 0..400 {
        println!("seed {seed}");
        let mut random = Random::new(seed);
        let edges = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let mut specs = [0, 1, 2].map(|level| {
            let period_ns = random.between(20, 80);
            let wcets_ns = [(); 4].map(|()| random.between(1, 5));
            let spec = dag(period_ns, period_ns, 20, &[level; 4], &edges).wcets(&wcets_ns);
            spec.with(|spec| spec.in_flight = Some(2))
        });
        // The sporadic one has the least priority and is the first or the last DAG.
        specs.rotate_right(1 + usize::from(seed % 2 == 0) * 2);
        let at = usize::from(seed % 2 == 0) * 2;
        specs[at].activation = sched_dag::Activation::Sporadic;
        let dag = DagId(u32::try_from(at).expect("small"));
        let mut at_ns = 0;
        let signals = [(); 60].map(|()| {
            at_ns += random.between(0, 40);
            (at_ns, dag)
        });
        let run = run(&specs, TWO_CORES, signals, None);
        let period_ns = run.task_set.dag(dag).period_ns();
        let mut earliest_ns = 0;
        let of = |what| {
            let events = run.events.iter().filter(move |event| event.what == what);
            events.map(|event| event.time_ns)
        };
        for (at_ns, due_ns) in of(What::Signalled).zip(of(What::Due)) {
            assert_eq!(due_ns, at_ns.max(earliest_ns));
            earliest_ns = due_ns + period_ns;
        }
        let events = run.events.iter().copied();
        let record = Record::of_events(&run.task_set, true, events).expect("it fits");
        let settings = Settings {
            policy: TWO_CORES.policy,
            preemption: TWO_CORES.preemption,
            cores: TWO_CORES.cores,
            overheads: Overheads::default(),
        };
        let bounds = answer(&run.task_set, &settings).bounds;
        for (dag, bound) in (0..).map(DagId).zip(bounds) {
            let Some(bound) = bound else { continue };
            bounded += 1;
            for job in record.jobs(dag) {
                if let (Some(release_ns), Some(ended_ns)) = (job.release_ns, job.ended_ns) {
                    assert!(ended_ns - release_ns <= bound.bound_ns);
                }
            }
        }
    }
    assert!(bounded > 400, "{bounded} bounds were compared");
}
