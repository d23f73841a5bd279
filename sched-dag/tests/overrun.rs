//! The overrun policies, as whole sequences of events.
//!
//! Every DAG here has T = D = 10; most are one subtask that executes for 25.

mod support;

use sched_dag::OverrunPolicy::{self, Abort, Queue, Skip};
use sched_dag::{DagSpec, Instance};
use support::{PREEMPTIVE, TWO_CORES, Timeline, cores, dag, overrunning, run};

/// A chain of two subtasks.
const CHAIN: &[(usize, usize)] = &[(0, 1)];

fn one_subtask(jobs: u64, in_flight: u32, overrun: OverrunPolicy) -> [DagSpec; 1] {
    [overrunning(
        dag(10, 10, jobs, &[0], &[]),
        in_flight,
        overrun,
    )]
}

fn chain(jobs: u64, in_flight: u32, overrun: OverrunPolicy) -> [DagSpec; 1] {
    [overrunning(
        dag(10, 10, jobs, &[1, 0], CHAIN),
        in_flight,
        overrun,
    )]
}

/// Job 0 executes for long, all others for 2.
fn long_once(execution_ns: u64) -> impl FnMut(Instance) -> u64 {
    move |instance| if instance.job == 0 { execution_ns } else { 2 }
}

#[test]
fn queue_releases_late_and_keeps_the_nominal_times() {
    let (events, statistics) = run(&one_subtask(4, 1, Queue), PREEMPTIVE, long_once(25));
    events.must_be(
        "0 released 0.0 of 0, ready 0.0.0, start 0.0.0 on 0
         10 queued 0.1
         11 missed 0.0 of 10
         20 queued 0.2
         21 missed 0.1 of 20
         25 finish 0.0.0, ended 0.0 Missed, released 0.1 of 10, ready 0.1.0, start 0.1.0 on 0
         27 finish 0.1.0, ended 0.1 Missed, released 0.2 of 20, ready 0.2.0, start 0.2.0 on 0
         29 finish 0.2.0, ended 0.2 Met
         30 released 0.3 of 30, ready 0.3.0, start 0.3.0 on 0
         32 finish 0.3.0, ended 0.3 Met",
    );
    let counted = statistics[0];
    assert_eq!(
        (counted.released, counted.completed, counted.queued),
        (4, 4, 2)
    );
    assert_eq!((counted.misses, counted.consecutive_misses), (2, 0));
    assert_eq!(counted.most_consecutive_misses, 2);
    assert_eq!((counted.skips, counted.aborts), (0, 0));
}

#[test]
fn queue_lets_the_given_number_of_jobs_overlap() {
    let (events, _) = run(&chain(4, 2, Queue), cores(4), |instance| {
        [9, 18][instance.subtask.index()]
    });
    events.must_be(
        "0 released 0.0 of 0
         10 released 0.1 of 10
         20 queued 0.2
         27 released 0.2 of 20
         30 queued 0.3
         45 released 0.3 of 30",
    );
}

#[test]
fn a_release_at_the_instant_of_a_completion_finds_the_room() {
    for overrun in [Queue, Skip, Abort] {
        let (events, statistics) = run(&one_subtask(2, 1, overrun), PREEMPTIVE, |_| 10);
        events.must_be(
            "0 released 0.0 of 0
             10 ended 0.0 Met, released 0.1 of 10
             20 ended 0.1 Met",
        );
        assert_eq!((statistics[0].queued, statistics[0].skips), (0, 0));
    }
}

#[test]
fn skip_drops_releases_and_keeps_the_jobs_numbers() {
    let (events, statistics) = run(&one_subtask(4, 1, Skip), PREEMPTIVE, long_once(25));
    events.must_be(
        "0 released 0.0 of 0, ready 0.0.0, start 0.0.0 on 0
         10 skipped 0.1
         11 missed 0.0 of 10
         20 skipped 0.2
         25 finish 0.0.0, ended 0.0 Missed
         30 released 0.3 of 30, ready 0.3.0, start 0.3.0 on 0
         32 finish 0.3.0, ended 0.3 Met",
    );
    let counted = statistics[0];
    assert_eq!(
        (counted.released, counted.completed, counted.skips),
        (2, 2, 2)
    );
    assert_eq!((counted.misses, counted.queued, counted.aborts), (1, 0, 0));
}

#[test]
fn skip_is_over_when_the_last_release_is_skipped() {
    let (events, statistics) = run(&one_subtask(2, 1, Skip), PREEMPTIVE, |_| 15);
    events.must_be(
        "10 skipped 0.1
         15 ended 0.0 Missed",
    );
    assert_eq!(statistics[0].skips, 1);
}

#[test]
fn abort_lets_the_started_instance_end_and_cancels_the_rest() {
    let (events, statistics) = run(&chain(3, 1, Abort), PREEMPTIVE, |instance| {
        if instance.job == 0 { 14 } else { 2 }
    });
    events.must_be(
        "0 released 0.0 of 0, ready 0.0.0, start 0.0.0 on 0
         10 aborted 0.0, queued 0.1
         14 finish 0.0.0, cancelled 0.0.1, ended 0.0 Aborted, released 0.1 of 10, ready 0.1.0
         14 start 0.1.0 on 0
         16 finish 0.1.0, ready 0.1.1, start 0.1.1 on 0
         18 finish 0.1.1, ended 0.1 Met
         20 released 0.2 of 20, ready 0.2.0, start 0.2.0 on 0
         22 finish 0.2.0, ready 0.2.1, start 0.2.1 on 0
         24 finish 0.2.1, ended 0.2 Met",
    );
    let counted = statistics[0];
    assert_eq!(
        (counted.released, counted.completed, counted.aborts),
        (3, 2, 1)
    );
    assert_eq!((counted.misses, counted.queued), (0, 1));
}

#[test]
fn abort_frees_the_slot_at_once_if_nothing_has_started() {
    // DAG 1 keeps the only core, so DAG 0's jobs never start before 25.
    let mut specs = [
        overrunning(dag(10, 10, 3, &[5, 5], CHAIN), 1, Abort),
        dag(100, 100, 1, &[0], &[]),
    ];
    specs[0].name = "behind".to_owned();
    let (events, statistics) = run(
        &specs,
        PREEMPTIVE,
        |instance| if instance.dag.0 == 1 { 25 } else { 2 },
    );
    events.must_be(
        "0 released 0.0 of 0, released 1.0 of 0, start 1.0.0 on 0
         10 aborted 0.0, cancelled 0.0.0, cancelled 0.0.1, ended 0.0 Aborted, released 0.1 of 10
         20 aborted 0.1, cancelled 0.1.0, cancelled 0.1.1, ended 0.1 Aborted, released 0.2 of 20
         25 ended 1.0 Met, start 0.2.0 on 0
         27 start 0.2.1 on 0
         29 ended 0.2 Met",
    );
    assert_eq!((statistics[0].aborts, statistics[0].queued), (2, 0));
}

#[test]
fn abort_lets_a_preempted_instance_end_at_its_key() {
    // DAG 0 starts, is preempted by DAG 1 from 5 to 25, and aborted at 10.
    let mut specs = [
        overrunning(dag(10, 10, 2, &[5, 5], CHAIN), 1, Abort),
        dag(100, 100, 1, &[0], &[]),
    ];
    specs[1].offset_ns = 5;
    let (events, _) = run(
        &specs,
        PREEMPTIVE,
        |instance| if instance.dag.0 == 1 { 20 } else { 8 },
    );
    events.must_be(
        "0 start 0.0.0 on 0
         5 preempt 0.0.0 on 0, start 1.0.0 on 0
         10 aborted 0.0, queued 0.1
         25 ended 1.0 Met, resume 0.0.0 on 0
         28 cancelled 0.0.1, ended 0.0 Aborted, start 0.1.0 on 0
         36 start 0.1.1 on 0
         44 ended 0.1 Missed",
    );
}

#[test]
fn abort_with_several_in_flight_takes_the_oldest_first() {
    // Two in flight; the first subtask is quick, the second takes 35.
    let (events, _) = run(&chain(5, 2, Abort), TWO_CORES, |instance| {
        [1, 35][instance.subtask.index()]
    });
    events.must_be(
        "0 released 0.0 of 0
         10 released 0.1 of 10
         20 aborted 0.0, queued 0.2
         30 aborted 0.1, queued 0.3
         36 cancelled 0.1.1, ended 0.0 Aborted, ended 0.1 Aborted, released 0.2 of 20
         36 released 0.3 of 30
         40 aborted 0.2, queued 0.4
         72 ended 0.2 Aborted, released 0.4 of 40
         107 ended 0.3 Missed
         142 ended 0.4 Missed",
    );
}

#[test]
fn abort_skips_the_oldest_waiting_if_all_in_flight_are_aborted() {
    let (events, statistics) = run(&one_subtask(4, 1, Abort), PREEMPTIVE, long_once(35));
    events.must_be(
        "0 released 0.0 of 0
         10 aborted 0.0, queued 0.1
         20 skipped 0.1, queued 0.2
         30 skipped 0.2, queued 0.3
         35 ended 0.0 Aborted, released 0.3 of 30
         37 ended 0.3 Met",
    );
    let counted = statistics[0];
    assert_eq!((counted.aborts, counted.skips, counted.misses), (1, 2, 0));
}

#[test]
fn a_driver_that_comes_late_finds_every_release_and_every_miss() {
    for (overrun, released, skipped, misses) in
        [(Queue, 1, 0, 4), (Skip, 1, 4, 1), (Abort, 5, 0, 4)]
    {
        let specs = one_subtask(5, 1, overrun);
        let mut scheduler = support::scheduler(&specs, PREEMPTIVE);
        let decisions = scheduler.at(45).release_due(&mut ()).dispatch();
        assert_eq!(decisions.len(), 1, "{overrun:?}");
        let counted = scheduler.statistics(sched_dag::DagId(0));
        assert_eq!(
            (counted.released, counted.skips, counted.misses),
            (released, skipped, misses),
            "{overrun:?}"
        );
    }
}

#[test]
fn a_job_is_announced_before_it_is_late_however_late_the_driver_comes() {
    for (overrun, expected) in [
        (
            Queue,
            "0 released 0.0 of 0, missed 0.0 of 10, queued 0.1, missed 0.1 of 20, queued 0.2",
        ),
        (
            Skip,
            "0 released 0.0 of 0, missed 0.0 of 10, skipped 0.1, skipped 0.2",
        ),
        (
            Abort,
            "0 released 0.0 of 0, missed 0.0 of 10, aborted 0.0, ended 0.0 Aborted
             0 released 0.1 of 10, missed 0.1 of 20, aborted 0.1, ended 0.1 Aborted
             0 released 0.2 of 20",
        ),
    ] {
        let mut scheduler = support::scheduler(&one_subtask(3, 1, overrun), PREEMPTIVE);
        let mut log = support::Log::new(|_| 0);
        let decisions = scheduler.at(25).release_due(&mut log).dispatch();
        assert_eq!(decisions.len(), 1, "{overrun:?}");
        log.lines.must_be(expected);
    }
}
