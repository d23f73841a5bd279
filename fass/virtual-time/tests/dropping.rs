//! A panic that is survived costs its job, and the DAG goes on with another function.

mod support;

use fass::{Dag, FaultLimit, Sample, Unique, create_dag};
use support::sharing::Seen;
use support::{execute, ms, named, pair, run};
use virtual_time::{DagStatistics, JobOutcome, VirtualTime};

/// At most one fault within three jobs.
const FAULT_LIMIT: FaultLimit = FaultLimit {
    faults: 1,
    window: 3,
    in_all: 8,
};

/// A DAG that drops jobs, with a source that counts them.
fn counting(jobs: u64) -> Dag {
    let dag = create_dag();
    dag.name("counting").jobs(jobs);
    dag.survive_faults(FAULT_LIMIT);
    let mut next = 0_u64..;
    let count = move || (next.next().expect("it has no end"),);
    dag.register_periodic_subtask(count, vec!["job"], ms(10), named("source"));
    dag
}

/// Registers a sink that keeps what it reads.
fn keeping<T: Clone + Send + 'static>(dag: &Dag, topic: &str) -> Seen<T> {
    let (kept, keep) = Seen::shared();
    let sink = move |(value,): (T,)| keep.add(value);
    dag.register_sink_subtask(sink, vec![topic], ms(10), named("sink"));
    kept
}

/// Returns the counts of faults, jobs lost by them, and complete jobs.
fn counts(statistics: &DagStatistics) -> [u64; 3] {
    let DagStatistics {
        faults,
        failed,
        completed,
        ..
    } = *statistics;
    [faults, failed, completed]
}

#[test]
fn each_fault_costs_one_job_and_makes_the_function_anew() {
    let machine = VirtualTime::new().cores(2).contain_panics();
    let dag = counting(12);
    let make = || {
        let mut calls = 0_u32;
        move |(job,): (u64,)| {
            calls += 1;
            execute(ms(2));
            assert!(calls != 5, "it is worn out");
            ((job, calls),)
        }
    };
    dag.restarting(make)
        .reads(&["job"])
        .writes(&["calls"])
        .register(named("middle"));
    let kept = keeping::<(u64, u32)>(&dag, "calls");
    let healthy = pair("healthy", ms(5), ms(5), [ms(1), ms(1)]);
    healthy.jobs(24);
    let report = run(&machine, &[dag, healthy]);
    let jobs: Vec<u64> = kept.all().iter().map(|(job, _)| *job).collect();
    assert_eq!(jobs, [0, 1, 2, 3, 5, 6, 7, 8, 10, 11]);
    assert_eq!(kept.all()[4], (5, 1), "it is another function");
    assert_eq!(counts(report.dag("counting").statistics()), [2, 2, 10]);
    assert_eq!(counts(report.dag("healthy").statistics()), [0, 0, 24]);
    assert_eq!(report.dag("healthy").statistics().misses, 0);
    let job = report
        .jobs
        .iter()
        .find(|job| (job.dag.0, job.job) == (0, 4));
    assert_eq!(
        job.expect("it is released").outcome,
        Some(JobOutcome::Failed)
    );
    let lines = report.event_lines();
    let ended = lines
        .iter()
        .position(|line| line.contains("ended middle[4]"));
    assert_eq!(
        lines[ended.expect("it fails")..][..4],
        [
            "42000000 ended middle[4] core 0",
            "42000000 restarted middle[4]",
            "42000000 cancelled sink[4]",
            "42000000 completed counting[4] failed",
        ]
    );
    assert!(report.dags().all(|dag| !dag.is_degraded()));
}

#[test]
fn a_fault_while_the_next_function_is_made_ends_the_dag() {
    let machine = VirtualTime::new().contain_panics();
    let dag = counting(12);
    dag.survive_faults(FaultLimit {
        window: 1,
        ..FAULT_LIMIT
    });
    let mut made = 0;
    let make = move || {
        made += 1;
        assert!(made < 3, "there is no third one");
        |(job,): (u64,)| assert!(job != 2 && job != 4, "job {job}")
    };
    dag.restarting(make)
        .reads(&["job"])
        .due(ms(10))
        .register(named("sink"));
    let report = run(&machine, &[dag]);
    // Jobs 2 and 4 are lost; the function for job 5 cannot be made.
    assert_eq!(counts(report.dag("counting").statistics()), [3, 2, 3]);
    assert_eq!(report.dag("counting").statistics().restarts, 2);
}

#[test]
fn states_that_it_used_are_reset_and_others_are_not() {
    let machine = VirtualTime::new().contain_panics();
    let dag = counting(7);
    let (sum, count) = (dag.state("sum", 100_u64), dag.state("count", 0_u64));
    sum.reset_to(|| 200);
    let add = || {
        |sum: &mut u64, (job,): (u64,)| {
            *sum += 1000;
            assert!(job != 2 && job != 5, "in the middle of a change");
            *sum -= 1000 - job;
            (*sum,)
        }
    };
    dag.using(sum.update())
        .restarting(add)
        .reads(&["job"])
        .writes(&["sum"])
        .register(named("add"));
    let (kept, keep) = Seen::shared();
    let sink = move |(sum, count): (&u64, &mut u64), (sent,): (u64,)| {
        *count += 1;
        assert_eq!(*sum, sent);
        keep.add((sent, *count));
    };
    dag.using((sum.read(), count.update()))
        .subtask(sink)
        .reads(&["sum"])
        .due(ms(10))
        .register(named("sink"));
    let report = run(&machine, &[dag]);
    assert_eq!(
        kept.all(),
        [(100, 1), (101, 2), (203, 3), (207, 4), (206, 5)]
    );
    assert_eq!(counts(report.dag("counting").statistics()), [2, 2, 5]);
}

#[test]
fn what_waits_for_the_lost_function_is_for_the_next_one() {
    // The source runs ahead of the sink, which fails in job 1 while jobs 2 to 4 wait.
    let machine = VirtualTime::new().cores(2).contain_panics();
    let dag = create_dag();
    dag.name("ahead").jobs(6).in_flight(6);
    dag.survive_faults(FAULT_LIMIT);
    let mut next = 0_u64..;
    let source = move || (Unique::new(next.next().expect("it has no end")),);
    dag.register_periodic_subtask(source, vec!["job"], ms(10), named("source"));
    let (kept, keep) = Seen::shared();
    let make = move || {
        let keep = keep.clone();
        move |(job,): (Unique<u64>,)| {
            execute(ms(25));
            assert!(*job != 1, "slow and wrong");
            keep.add(*job);
        }
    };
    dag.restarting(make)
        .reads(&["job"])
        .due(ms(10))
        .register(named("sink"));
    let report = run(&machine, &[dag]);
    assert_eq!(kept.all(), [0, 2, 3, 4, 5]);
    assert_eq!(counts(report.dag("ahead").statistics()), [1, 1, 5]);
}

#[test]
fn a_source_restarts_and_its_latest_value_shows_again() {
    let machine = VirtualTime::new().contain_panics();
    let dag = create_dag();
    dag.name("pose").jobs(4).relative_deadline(ms(10));
    dag.survive_faults(FAULT_LIMIT);
    let make = || {
        let mut calls = 0_u32;
        move |()| {
            calls += 1;
            assert!(calls != 3, "the third one is broken");
            (calls,)
        }
    };
    dag.period(ms(10))
        .restarting(make)
        .writes(&["pose"])
        .register(named("localize"));
    let pose = dag.latest::<u32>("pose");
    let reader = create_dag();
    reader
        .name("reader")
        .jobs(4)
        .offset(ms(5))
        .relative_deadline(ms(10));
    let (kept, keep) = Seen::shared();
    let read = move |pose: Option<Sample<'_, u32>>| {
        let seen = pose.map(|pose| (pose.job, *pose.value));
        keep.add(seen);
    };
    reader
        .period(ms(10))
        .using(pose.sample())
        .source(read)
        .register(named("read"));
    run(&machine, &[dag, reader]);
    assert_eq!(
        kept.all(),
        [Some((0, 1)), Some((1, 2)), Some((1, 2)), Some((3, 1))]
    );
}
