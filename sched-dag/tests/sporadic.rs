//! The rules S1 to S4: sporadic DAGs, released by signals.

mod support;

use std::sync::Arc;

use sched_dag::analysis::{Overheads, Settings, answer};
use sched_dag::journal::Event;
use sched_dag::law::{Record, Terms, Violation, violations};
use sched_dag::{
    Activation, DagId, DagSpec, DagStatistics, Instance, Observer, OverrunPolicy, Policy, Recorder,
    Scheduler, SchedulerOptions, TaskSet,
};
use support::random::Random;
use support::written::Written;
use support::{PREEMPTIVE, TWO_CORES, commit, dag, overrunning, under};

/// Executes every instance for its WCET or 1 ns.
type Run = Written<Box<dyn Fn(Instance) -> u64>>;

fn new_run(task_set: &Arc<TaskSet>, signals: impl Iterator<Item = (u64, DagId)>) -> Run {
    let of_set = Arc::clone(task_set);
    let wcet_ns = move |instance: Instance| {
        let subtask = of_set.dag(instance.dag).subtask(instance.subtask);
        subtask.wcet_ns().unwrap_or(1)
    };
    let mut run: Run = Written::new(task_set, Box::new(wcet_ns));
    run.signals = signals.collect();
    run
}

fn record(run: &Run) -> Record {
    let events = run.journal.events.iter().copied();
    Record::of_events(&run.task_set, true, events).expect("it fits")
}

fn releases(run: &Run, dag: u32) -> Vec<u64> {
    let record = record(run);
    let jobs = record.jobs(DagId(dag)).iter();
    jobs.filter_map(|job| job.release_ns).collect()
}

fn breaches(run: &Run) -> Vec<Violation> {
    let events = run.journal.events.iter().copied();
    violations(&run.task_set, Terms::EXACT, events)
}

fn sporadic(spec: DagSpec) -> DagSpec {
    DagSpec {
        activation: Activation::Sporadic,
        ..spec
    }
}

/// Runs DAGs until nothing happens any more; `signals` are to the last DAG.
fn run(
    specs: &[DagSpec],
    options: SchedulerOptions,
    signals: &[u64],
    chained: Option<(DagId, DagId)>,
) -> (Run, Vec<DagStatistics>) {
    let task_set = commit(specs, options);
    let last = DagId(u32::try_from(specs.len() - 1).expect("few DAGs"));
    let mut run = new_run(&task_set, signals.iter().map(|&at_ns| (at_ns, last)));
    run.chained = chained;
    let driver = run.run(options);
    assert_eq!(breaches(&run), []);
    let ids = (0..=last.0).map(DagId);
    let statistics = ids
        .map(|dag| *driver.scheduler_of(dag).statistics(dag))
        .collect();
    (run, statistics)
}

#[test]
fn s1_an_early_signal_is_delayed_to_the_minimum_inter_arrival_time() {
    let spec = sporadic(dag(10, 10, 4, &[0], &[]));
    let (run, _) = run(&[spec], PREEMPTIVE, &[3, 5, 40, 50], None);
    assert_eq!(releases(&run, 0), [3, 13, 40, 50]);
    assert_eq!(run.arrivals[1], (5, Some(13)));
}

#[test]
fn s1_nothing_is_released_before_the_offset_or_without_a_signal() {
    let late = DagSpec {
        offset_ns: 100,
        ..sporadic(dag(10, 10, 4, &[0], &[]))
    };
    let (run, statistics) = run(&[late], PREEMPTIVE, &[7, 205], None);
    assert_eq!(releases(&run, 0), [100, 205]);
    assert_eq!(statistics[0].released, 2);
}

#[test]
fn s2_one_early_signal_is_kept_and_more_are_dropped_and_counted() {
    let spec = sporadic(dag(10, 10, 9, &[0], &[]));
    let (run, statistics) = run(&[spec], PREEMPTIVE, &[0, 1, 2, 3, 11], None);
    assert_eq!(releases(&run, 0), [0, 10, 20]);
    assert_eq!(statistics[0].signals, 5);
    assert_eq!(statistics[0].dropped_signals, 2);
}

#[test]
fn s2_a_job_that_waits_for_room_counts_as_the_one_that_is_kept() {
    let mut spec = overrunning(dag(10, 10, 9, &[0], &[]), 1, OverrunPolicy::Queue);
    spec.subtasks[0].wcet_ns = Some(25);
    let spec = sporadic(DagSpec {
        relative_deadline_ns: Some(30),
        ..spec
    });
    let (run, statistics) = run(&[spec], PREEMPTIVE, &[0, 10, 12, 20, 30], None);
    // Job 1 is due at 10 and waits till 25; its nominal release stays.
    assert_eq!(releases(&run, 0), [0, 10, 30]);
    assert_eq!(record(&run).jobs(DagId(0))[1].released_ns, Some(25));
    assert_eq!(statistics[0].dropped_signals, 2);
    assert_eq!(statistics[0].queued, 2);
}

#[test]
fn s3_skip_and_abort_act_on_sporadic_jobs() {
    for (overrun, skips, aborts) in [(OverrunPolicy::Skip, 1, 0), (OverrunPolicy::Abort, 0, 1)] {
        let mut spec = overrunning(dag(10, 30, 9, &[0, 0], &[(0, 1)]), 1, overrun);
        spec.subtasks[0].wcet_ns = Some(15);
        let (_, statistics) = run(&[sporadic(spec)], PREEMPTIVE, &[0, 10, 40], None);
        assert_eq!((statistics[0].skips, statistics[0].aborts), (skips, aborts));
    }
}

#[test]
fn s3_a_completion_may_signal_at_its_own_instant() {
    let mut sender = dag(20, 20, 3, &[0], &[]);
    sender.subtasks[0].wcet_ns = Some(4);
    let receiver = sporadic(dag(5, 5, 3, &[1], &[]));
    let chained = Some((DagId(0), DagId(1)));
    let (run, _) = run(&[sender, receiver], PREEMPTIVE, &[], chained);
    assert_eq!(releases(&run, 1), [4, 24, 44]);
}

#[test]
fn s3_the_deadline_counts_from_the_nominal_release() {
    let mut spec = dag(10, 3, 4, &[0], &[]);
    spec.subtasks[0].wcet_ns = Some(3);
    let mut long = dag(100, 100, 1, &[0], &[]);
    long.subtasks[0].wcet_ns = Some(50);
    let (run, statistics) = run(&[long, sporadic(spec)], under(Policy::Edf), &[1, 2], None);
    // Its deadlines are the earlier ones, so it preempts.
    assert_eq!(releases(&run, 1), [1, 11]);
    assert_eq!((statistics[1].completed, statistics[1].misses), (2, 0));
}

#[test]
fn s4_signals_beyond_the_limit_are_dropped() {
    let spec = sporadic(dag(10, 10, 1, &[0], &[]));
    let (run, statistics) = run(&[spec], PREEMPTIVE, &[0, 30, 60], None);
    assert_eq!(releases(&run, 0), [0]);
    assert_eq!(statistics[0].dropped_signals, 2);
}

#[test]
fn s4_without_a_limit_it_keeps_no_run_going() {
    let endless = DagSpec {
        jobs: None,
        ..sporadic(dag(10, 10, 2, &[0], &[]))
    };
    let task_set = commit(&[endless], PREEMPTIVE);
    let mut scheduler = Scheduler::new(task_set, PREEMPTIVE);
    assert!(scheduler.is_finished());
    let mut moment = scheduler.at(7);
    moment.signal(DagId(0), &mut ());
    let started = moment.release_due(&mut ()).dispatch()[0].instance();
    assert!(!scheduler.is_finished());
    let mut moment = scheduler.at(9);
    moment.complete(started, &mut ());
    let _ = moment.release_due(&mut ()).dispatch();
    assert!(scheduler.is_finished());
}

#[test]
fn signals_to_an_ended_dag_are_dropped() {
    let task_set = commit(&[sporadic(dag(10, 10, 9, &[0], &[]))], PREEMPTIVE);
    let mut scheduler = Scheduler::new(task_set, PREEMPTIVE);
    let mut moment = scheduler.at(0);
    moment.stop(DagId(0), &mut ());
    moment.signal(DagId(0), &mut ());
    assert_eq!(moment.release_due(&mut ()).dispatch(), []);
    assert_eq!(scheduler.statistics(DagId(0)).dropped_signals, 1);
}

#[test]
fn the_check_finds_releases_that_are_too_close() {
    let task_set = commit(&[sporadic(dag(10, 10, 2, &[0], &[]))], PREEMPTIVE);
    let mut journal = Recorder::new(Arc::clone(&task_set));
    for (job, release_ns) in [(0, 5), (1, 14)] {
        journal.now_ns = release_ns;
        journal.released(DagId(0), job, release_ns);
    }
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
    assert_eq!(found(&journal.events), [expected]);
    let undue = found(&journal.events[1..]);
    assert!(matches!(undue[..], [Violation::NotDue { .. }, ..]));
}

/// The analysis takes a sporadic DAG for a periodic one: its bounds hold for any
/// pattern of signals.
#[test]
fn bounds_hold_for_random_signals() {
    let mut bounded = 0;
    for seed in 0..400 {
        let mut random = Random::new(seed);
        let mut specs = Vec::new();
        for level in 0..3_u32 {
            let period_ns = random.between(20, 80);
            let mut spec = dag(
                period_ns,
                period_ns,
                20,
                &[level; 4],
                &[(0, 1), (0, 2), (1, 3), (2, 3)],
            );
            for subtask in &mut spec.subtasks {
                subtask.wcet_ns = Some(random.between(1, 5));
            }
            spec.in_flight = Some(2);
            specs.push(spec);
        }
        let last = specs.pop().map(sporadic).expect("three");
        specs.insert(0, last); // the sporadic one may outrank or be outranked
        if seed % 2 == 0 {
            specs.rotate_left(1);
        }
        let sporadic_at = usize::from(seed % 2 == 0) * 2;
        let options = TWO_CORES;
        let task_set = commit(&specs, options);
        let mut at_ns = 0;
        let signals = (0..60).map(|_| {
            at_ns += random.between(0, 40);
            (at_ns, DagId(u32::try_from(sporadic_at).expect("small")))
        });
        let mut run = new_run(&task_set, signals);
        println!("seed {seed}");
        let _ = run.run(options);
        assert_eq!(breaches(&run), [], "seed {seed}");
        let record = record(&run);
        let period_ns = task_set.dags()[sporadic_at].period_ns();
        let mut earliest_ns = 0;
        for &(at_ns, release_ns) in &run.arrivals {
            if let Some(release_ns) = release_ns {
                assert_eq!(release_ns, at_ns.max(earliest_ns), "seed {seed}");
                earliest_ns = release_ns + period_ns;
            }
        }
        let settings = Settings {
            policy: options.policy,
            preemption: options.preemption,
            cores: options.cores,
            overheads: Overheads::default(),
        };
        let answer = answer(&task_set, &settings);
        for (dag, bound) in (0..).map(DagId).zip(answer.bounds) {
            let Some(bound_ns) = bound.map(|bound| bound.bound_ns) else {
                continue;
            };
            bounded += 1;
            for job in record.jobs(dag) {
                if let (Some(release_ns), Some(ended_ns)) = (job.release_ns, job.ended_ns) {
                    assert!(ended_ns - release_ns <= bound_ns, "seed {seed}");
                }
            }
        }
    }
    assert!(bounded > 400, "{bounded} bounds were compared");
}
