//! The ends of time, and sizes around words of bits.

mod support;

use sched_dag::Told as _;
use sched_dag::virtual_time::{End, ExecutionTimes, VirtualTime};
use sched_dag::{
    Activation, CoreId, DagId, DagSpec, Instance, JobOutcome, Observer, OverrunPolicy, Policy,
    Priority, Scheduler, SubtaskSpec,
};
use support::{PREEMPTIVE, dag, instance, overrunning, scheduler, under};

const DAG: DagId = DagId(0);

/// What was reported.
#[derive(Default)]
struct Log(Vec<String>);

impl Observer for Log {
    fn released(&mut self, _: DagId, job: u64, release_ns: u64) {
        self.0.push(format!("released {job} of {release_ns}"));
    }

    fn skipped(&mut self, _: DagId, job: u64, release_ns: u64) {
        self.0.push(format!("skipped {job} of {release_ns}"));
    }

    fn signalled(&mut self, _: DagId, job: u64, release_ns: Option<u64>) {
        self.0.push(format!("signalled {job} {release_ns:?}"));
    }

    fn deadline_missed(&mut self, _: DagId, job: u64, deadline_ns: u64) {
        self.0.push(format!("missed {job} of {deadline_ns}"));
    }

    fn job_completed(&mut self, _: DagId, job: u64, outcome: JobOutcome) {
        self.0.push(format!("{outcome:?} {job}"));
    }
}

fn step(scheduler: &mut Scheduler, now_ns: u64, completed: Option<Instance>, log: &mut Log) {
    let mut moment = scheduler.told(now_ns);
    if let Some(completed) = completed {
        moment.complete(completed, log);
    }
    let _ = moment.release_due(log).dispatch();
}

#[test]
fn releases_go_on_as_long_as_there_is_an_instant_after_the_deadline() {
    // Deadlines at 9, 6 and 3 before the last time; the next one would be at it.
    for policy in [Policy::StaticPriority, Policy::Edf] {
        let spec = DagSpec {
            offset_ns: u64::MAX - 11,
            jobs: None,
            ..dag(3, 2, 3, &[0, 0], &[(0, 1)])
        };
        let mut run = VirtualTime::new(scheduler(&[spec], under(policy)));
        assert_eq!(run.run(&mut ExecutionTimes(|_| 1)), End::Finished);
        assert_eq!(run.now_ns(), u64::MAX - 3);
        let statistics = run.scheduler_of(DAG).statistics(DAG);
        assert_eq!((statistics.completed, statistics.misses), (3, 0));
        assert_eq!(run.scheduler_of(DAG).next_event_ns(), None);
    }
}

#[test]
fn the_last_deadline_that_there_is_can_be_met_and_missed() {
    let spec = DagSpec {
        offset_ns: u64::MAX - 5,
        ..dag(u64::MAX, 4, 1, &[0], &[])
    };
    for (end_ns, reported) in [
        (u64::MAX - 1, &["Met 0"][..]),
        (u64::MAX, &["missed 0 of 18446744073709551614", "Missed 0"]),
    ] {
        let mut scheduler = scheduler(std::slice::from_ref(&spec), PREEMPTIVE);
        assert_eq!(scheduler.next_event_ns(), Some(u64::MAX - 5));
        step(&mut scheduler, u64::MAX - 5, None, &mut Log::default());
        assert_eq!(scheduler.next_event_ns(), Some(u64::MAX));
        let mut log = Log::default();
        step(&mut scheduler, end_ns, Some(instance(0, 0, 0)), &mut log);
        assert_eq!(log.0, reported);
        assert!(scheduler.is_finished());
        assert_eq!(scheduler.next_event_ns(), None);
    }
}

#[test]
fn an_instance_that_cannot_end_before_the_end_of_time_says_so() {
    let spec = DagSpec {
        offset_ns: u64::MAX - 5,
        ..dag(1, 4, 1, &[0], &[])
    };
    let mut run = VirtualTime::new(scheduler(&[spec], PREEMPTIVE));
    let end = run.run(&mut ExecutionTimes(|_| 6));
    assert_eq!(end, End::TimeOverflow(instance(0, 0, 0)));
}

#[test]
fn the_second_job_of_an_endless_period_is_never_due() {
    let spec = DagSpec {
        jobs: None,
        ..dag(u64::MAX, 1, 1, &[0], &[])
    };
    let mut run = VirtualTime::new(scheduler(&[spec], PREEMPTIVE));
    assert_eq!(run.run(&mut ExecutionTimes(|_| 1)), End::Finished);
    assert_eq!(run.scheduler_of(DAG).statistics(DAG).released, 1);
}

#[test]
fn a_signal_whose_deadline_is_no_time_is_dropped() {
    let spec = DagSpec {
        activation: Activation::Sporadic,
        jobs: None,
        ..dag(1 << 63, 5, 3, &[0], &[])
    };
    let mut scheduler = scheduler(&[spec], PREEMPTIVE);
    let mut log = Log::default();
    let signal = |now_ns: u64, scheduler: &mut Scheduler, log: &mut Log| {
        let mut moment = scheduler.told(now_ns);
        moment.signal(DAG, log);
        let _ = moment.release_due(log).dispatch();
    };
    // The next job could be due at 2^63 + 2^63 + 7, after the end of time.
    signal((1 << 63) + 7, &mut scheduler, &mut log);
    step(
        &mut scheduler,
        (1 << 63) + 8,
        Some(instance(0, 0, 0)),
        &mut log,
    );
    signal((1 << 63) + 9, &mut scheduler, &mut log);
    let expected = [
        "signalled 0 Some(9223372036854775815)",
        "released 0 of 9223372036854775815",
        "Met 0",
        "signalled 1 None",
    ];
    assert_eq!(log.0, expected);
    assert_eq!(scheduler.next_event_ns(), None);
    assert_eq!(scheduler.statistics(DAG).dropped_signals, 1);
    assert!(scheduler.is_over(DAG));
}

#[test]
fn of_a_sporadic_job_the_instant_after_the_deadline_has_to_be_a_time() {
    let spec = DagSpec {
        activation: Activation::Sporadic,
        ..dag(5, 5, 3, &[0], &[])
    };
    for (at_ns, job) in [(u64::MAX - 6, Some(u64::MAX - 6)), (u64::MAX - 5, None)] {
        let mut scheduler = scheduler(std::slice::from_ref(&spec), PREEMPTIVE);
        let mut log = Log::default();
        scheduler.told(at_ns).signal(DAG, &mut log);
        assert_eq!(log.0, [format!("signalled 0 {job:?}")]);
    }
}

#[test]
fn a_signal_at_the_instant_of_the_kept_ones_release_is_dropped() {
    // Signals come before releases: the job that is due now is still kept.
    let spec = DagSpec {
        activation: Activation::Sporadic,
        ..dag(10, 10, 5, &[0], &[])
    };
    let mut scheduler = scheduler(&[spec], PREEMPTIVE);
    let mut log = Log::default();
    for (now_ns, completed) in [(0, None), (3, Some(0)), (10, None), (10, Some(1))] {
        let mut moment = scheduler.told(now_ns);
        if let Some(job) = completed {
            moment.complete(instance(0, job, 0), &mut log);
        }
        moment.signal(DAG, &mut log);
        let _ = moment.release_due(&mut log).dispatch();
    }
    let expected = [
        "signalled 0 Some(0)",
        "released 0 of 0",
        "Met 0",
        "signalled 1 Some(10)",
        "signalled 1 None",
        "released 1 of 10",
        "Met 1",
        "signalled 2 Some(20)",
    ];
    assert_eq!(log.0, expected);
}

#[test]
fn a_signal_after_the_kept_ones_release_counts_even_if_the_driver_comes_late() {
    let spec = DagSpec {
        activation: Activation::Sporadic,
        offset_ns: 5,
        ..dag(10, 10, 5, &[0], &[])
    };
    let mut scheduler = scheduler(&[spec], PREEMPTIVE);
    let mut log = Log::default();
    scheduler.told(0).signal(DAG, &mut log);
    // Job 0 was due at 5.
    scheduler.told(9).signal(DAG, &mut log);
    let expected = [
        "signalled 0 Some(5)",
        "released 0 of 5",
        "signalled 1 Some(15)",
    ];
    assert_eq!(log.0, expected);
}

#[test]
fn numbers_go_on_over_many_skipped_jobs() {
    // One job runs while thousands are skipped; slots are counted by sequence.
    let spec = overrunning(
        DagSpec {
            jobs: Some(100_000),
            ..dag(1, 1_000_000, 3, &[0, 0], &[(0, 1)])
        },
        3,
        OverrunPolicy::Skip,
    );
    let mut scheduler = scheduler(&[spec], PREEMPTIVE);
    let mut log = Log::default();
    step(&mut scheduler, 50_000, None, &mut log);
    assert_eq!(scheduler.in_flight(DAG), 3);
    assert_eq!(scheduler.statistics(DAG).skips, 49_998);
    log.0.clear();
    for (job, at_ns) in [(0, 50_001), (1, 50_002), (2, 50_003)] {
        for subtask in [0, 1] {
            let running = instance(0, job, subtask);
            assert_eq!(scheduler.running(CoreId(0)), Some(running), "oldest first");
            step(&mut scheduler, at_ns, Some(running), &mut log);
        }
    }
    step(&mut scheduler, 50_004, None, &mut log);
    // Blocked as long as any job is in flight whose number is less by 3 or more.
    let expected = [
        "skipped 50001 of 50001",
        "Met 0",
        "skipped 50002 of 50002",
        "Met 1",
        "skipped 50003 of 50003",
        "Met 2",
        "released 50004 of 50004",
    ];
    assert_eq!(log.0, expected);
}

#[test]
fn as_many_ready_subtasks_as_there_are_bits_in_words_start_in_order() {
    for count in [63, 64, 65, 4_095, 4_096, 4_097] {
        for policy in [Policy::StaticPriority, Policy::Edf] {
            // The last subtask has the highest priority.
            let subtask = |index: u32| SubtaskSpec {
                priority: Some(Priority(count - index)),
                ..SubtaskSpec::default()
            };
            let spec = DagSpec {
                subtasks: (0..count).map(subtask).collect(),
                ..dag(1_000_000, 1_000_000, 1, &[0], &[])
            };
            let mut started = Vec::new();
            let mut run = VirtualTime::new(scheduler(&[spec], under(policy)));
            let end = run.run(&mut ExecutionTimes(|instance: Instance| {
                started.push(instance.subtask.0);
                1
            }));
            assert_eq!(end, End::Finished);
            let expected: Vec<u32> = match policy {
                Policy::StaticPriority => (0..count).rev().collect(),
                Policy::Edf => (0..count).collect(),
            };
            assert!(started == expected, "{count} under {policy:?}");
        }
    }
}

#[test]
fn a_dag_without_limit_of_jobs_is_never_finished() {
    let mut spec = dag(10, 10, 1, &[0], &[]);
    spec.jobs = None;
    let mut scheduler = scheduler(&[spec], PREEMPTIVE);
    for job in 0..1000 {
        let mut moment = scheduler.told(10 * job);
        if job > 0 {
            moment.complete(instance(0, job - 1, 0), &mut ());
        }
        assert_eq!(moment.release_due(&mut ()).dispatch().len(), 1);
        assert!(!scheduler.is_finished());
    }
}
