//! The rules E1 to E8: a DAG that is ended by a fault or a stop, as whole
//! sequences of events.

mod support;

use sched_dag::{CoreId, DagId, DagSpec, Decision, Instance, OverrunPolicy, Scheduler};
use support::{
    PREEMPTIVE, TWO_CORES, Timeline, dag, instance, overrunning, run, run_failing, scheduler,
    start, step,
};

/// 0 -> (1, 2) -> 3, every 10; the middle subtasks run in parallel.
fn diamond(jobs: u64) -> DagSpec {
    dag(
        10,
        10,
        jobs,
        &[1, 1, 1, 1],
        &[(0, 1), (0, 2), (1, 3), (2, 3)],
    )
}

/// Fails an instance, and returns the decisions.
fn fail(scheduler: &mut Scheduler, now_ns: u64, failed: Instance) -> Vec<Decision> {
    let mut moment = scheduler.at(now_ns);
    moment.fail(failed, &mut ());
    moment.release_due(&mut ()).dispatch().to_vec()
}

fn stop(scheduler: &mut Scheduler, now_ns: u64, dag: u32) -> Vec<Decision> {
    let mut moment = scheduler.at(now_ns);
    moment.stop(DagId(dag), &mut ());
    moment.release_due(&mut ()).dispatch().to_vec()
}

#[test]
fn e1_the_failing_instances_core_is_free_at_once() {
    let specs = [
        dag(100, 100, 1, &[0], &[]),
        dag(100, 100, 1, &[1, 1], &[(0, 1)]),
    ];
    let (events, statistics) = run_failing(&specs, PREEMPTIVE, &[instance(0, 0, 0)], |_| 5);
    events.must_be(
        "0 start 0.0.0 on 0
         5 fail 0.0.0, end 0, ended 0.0 DagEnded, start 1.0.0 on 0
         10 start 1.0.1 on 0
         15 ended 1.0 Met",
    );
    assert_eq!((statistics[0].faults, statistics[0].cut_short), (1, 1));
    assert_eq!(statistics[0].completed, 0);
    assert_eq!((statistics[1].faults, statistics[1].cut_short), (0, 0));
}

#[test]
fn e1_an_instance_may_fail_while_its_preemption_is_under_way() {
    let mut urgent = dag(100, 100, 1, &[0], &[]);
    urgent.offset_ns = 2;
    let mut scheduler = scheduler(&[dag(100, 100, 1, &[5, 5], &[(0, 1)]), urgent], PREEMPTIVE);
    let _ = step(&mut scheduler, 0, &[]);
    assert_eq!(step(&mut scheduler, 2, &[]).len(), 2);
    assert_eq!(fail(&mut scheduler, 3, instance(0, 0, 0)), []);
    assert_eq!(scheduler.running(CoreId(0)), Some(instance(1, 0, 0)));
    assert!(scheduler.is_over(DagId(0)) && !scheduler.is_finished());
    assert_eq!(step(&mut scheduler, 4, &[instance(1, 0, 0)]), []);
    assert!(scheduler.is_finished());
}

#[test]
fn e2_nothing_is_released_from_the_instant_of_the_end_on() {
    let (events, statistics) = run_failing(
        &[dag(10, 10, 3, &[0], &[])],
        PREEMPTIVE,
        &[instance(0, 1, 0)],
        |_| 10,
    );
    events.must_be(
        "0 released 0.0 of 0
         10 ended 0.0 Met, released 0.1 of 10
         20 fail 0.1.0, end 0, ended 0.1 DagEnded",
    );
    assert_eq!((statistics[0].released, statistics[0].dropped), (2, 0));
}

#[test]
fn e2_waiting_releases_are_dropped_and_counted() {
    let spec = overrunning(dag(10, 10, 9, &[0], &[]), 1, OverrunPolicy::Queue);
    let (events, statistics) = run_failing(&[spec], PREEMPTIVE, &[instance(0, 0, 0)], |_| 35);
    events.must_be(
        "0 released 0.0 of 0
         10 queued 0.1
         11 missed 0.0 of 10
         20 queued 0.2
         21 missed 0.1 of 20
         30 queued 0.3
         31 missed 0.2 of 30
         35 fail 0.0.0, end 0, ended 0.0 DagEnded",
    );
    let counted = statistics[0];
    assert_eq!((counted.queued, counted.dropped), (3, 3));
    assert_eq!((counted.released, counted.cut_short), (1, 1));
    assert_eq!((counted.misses, counted.consecutive_misses), (3, 3));
}

#[test]
fn e3_and_e4_what_is_ready_is_cancelled_and_what_has_started_ends() {
    // Job 0's subtask 1 fails at 4 while subtask 2 runs until 8.
    let (events, _) = run_failing(&[diamond(3)], TWO_CORES, &[instance(0, 0, 1)], |instance| {
        [1, 3, 7, 1][instance.subtask.index()]
    });
    events.must_be(
        "0 start 0.0.0 on 0
         1 finish 0.0.0, start 0.0.1 on 0, start 0.0.2 on 1
         4 fail 0.0.1, end 0
         8 finish 0.0.2, cancelled 0.0.3, ended 0.0 DagEnded",
    );
}

#[test]
fn e3_what_is_ready_is_cancelled_at_once() {
    // On one core subtask 2 is ready and waits while subtask 1 runs and fails.
    let (events, _) = run_failing(&[diamond(3)], PREEMPTIVE, &[instance(0, 0, 1)], |_| 2);
    events.must_be(
        "0 ready 0.0.0
         2 ready 0.0.1, ready 0.0.2
         4 fail 0.0.1, end 0, cancelled 0.0.2, cancelled 0.0.3, ended 0.0 DagEnded",
    );
}

#[test]
fn e3_instances_of_all_jobs_in_flight_are_cancelled_once() {
    // The second subtask takes 25, so at 27 the jobs 1 and 2 wait for it.
    let spec = dag(10, 100, 9, &[0, 1, 2], &[(0, 1), (1, 2)]);
    let (events, statistics) = run_failing(&[spec], TWO_CORES, &[instance(0, 0, 1)], |instance| {
        [2, 25, 1][instance.subtask.index()]
    });
    events.must_be(
        "0 ready 0.0.0
         2 ready 0.0.1
         10 ready 0.1.0
         20 ready 0.2.0
         27 fail 0.0.1, end 0, cancelled 0.0.2, cancelled 0.1.1, cancelled 0.2.1, cancelled 0.1.2
         27 ended 0.0 DagEnded, cancelled 0.2.2, ended 0.1 DagEnded, ended 0.2 DagEnded",
    );
    assert_eq!(statistics[0].cut_short, 3);
}

#[test]
fn e4_a_preempted_instance_goes_on_at_its_key() {
    // On two cores DAG 0's subtask 0 is preempted by DAG 1 at 2, and its
    // subtask 1 fails at 4.
    let mut urgent = dag(100, 100, 1, &[0], &[]);
    urgent.offset_ns = 2;
    let specs = [dag(100, 100, 1, &[9, 1, 9], &[(0, 2), (1, 2)]), urgent];
    let (events, statistics) = run_failing(&specs, TWO_CORES, &[instance(0, 0, 1)], |instance| {
        [[10, 4, 1], [20, 0, 0]][instance.dag.index()][instance.subtask.index()]
    });
    events.must_be(
        "0 start 0.0.1 on 0, start 0.0.0 on 1
         2 preempt 0.0.0 on 1, start 1.0.0 on 1
         4 fail 0.0.1, end 0, resume 0.0.0 on 0
         12 cancelled 0.0.2, ended 0.0 DagEnded
         22 ended 1.0 Met",
    );
    assert_eq!(statistics[0].faults, 1);
}

#[test]
fn e4_a_further_instance_may_fail() {
    let failing = [instance(0, 0, 1), instance(0, 0, 2)];
    let (events, statistics) = run_failing(&[diamond(3)], TWO_CORES, &failing, |instance| {
        [1, 3, 7, 1][instance.subtask.index()]
    });
    events.must_be(
        "4 fail 0.0.1, end 0
         8 fail 0.0.2, cancelled 0.0.3, ended 0.0 DagEnded",
    );
    assert_eq!((statistics[0].faults, statistics[0].cut_short), (2, 1));
}

#[test]
fn e5_a_job_that_was_aborted_before_ends_as_that() {
    let spec = overrunning(dag(10, 10, 3, &[1, 0], &[(0, 1)]), 1, OverrunPolicy::Abort);
    let (events, statistics) = run_failing(&[spec], PREEMPTIVE, &[instance(0, 0, 0)], |_| 14);
    events.must_be(
        "10 aborted 0.0
         14 fail 0.0.0, end 0, cancelled 0.0.1, ended 0.0 Aborted",
    );
    let counted = statistics[0];
    assert_eq!(
        (counted.aborts, counted.cut_short, counted.dropped),
        (1, 0, 1)
    );
}

#[test]
fn e5_a_job_that_is_complete_at_the_instant_of_the_end_counts() {
    // Job 0's sink and job 1's source end at 15.
    let spec = dag(10, 20, 2, &[0, 1], &[(0, 1)]);
    let (events, _) = run_failing(&[spec], TWO_CORES, &[instance(0, 1, 0)], |instance| {
        [5, 10][instance.subtask.index()]
    });
    events.must_be(
        "5 finish 0.0.0
         15 finish 0.0.1, ended 0.0 Met, fail 0.1.0, end 0, cancelled 0.1.1, ended 0.1 DagEnded",
    );
}

#[test]
fn e6_deadlines_count_up_to_the_end_and_no_further() {
    // The driver is not called between 0 and the failure.
    for (now_ns, misses) in [(10, 0), (11, 1), (25, 1)] {
        let mut scheduler = scheduler(&[diamond(9)], TWO_CORES);
        let _ = step(&mut scheduler, 0, &[]);
        let _ = fail(&mut scheduler, now_ns, instance(0, 0, 0));
        let counted = *scheduler.statistics(DagId(0));
        assert_eq!((counted.misses, counted.released), (misses, 1), "{now_ns}");
        assert_eq!(scheduler.next_event_ns(), None);
        assert!(scheduler.is_finished());
        let _ = step(&mut scheduler, 1_000, &[]);
        assert_eq!(*scheduler.statistics(DagId(0)), counted);
    }
}

#[test]
fn e7_the_others_are_scheduled_as_if_the_ended_dag_had_no_more_jobs() {
    let execution_ns = |instance: Instance| [3, 2][instance.dag.index()];
    let other = dag(7, 7, 20, &[1, 2, 3], &[(0, 1), (0, 2)]);
    let failing = dag(10, 10, 20, &[0], &[]);
    let shorter = dag(10, 10, 4, &[0], &[]);
    let of_the_other = |events: &[String]| -> Vec<String> {
        let is_of = |line: &&String| {
            line.split(' ')
                .nth(2)
                .is_some_and(|name| name.starts_with("1."))
        };
        events.iter().filter(is_of).cloned().collect()
    };
    let specs = [failing, other.clone()];
    let (with_fault, _) = run_failing(&specs, TWO_CORES, &[instance(0, 3, 0)], execution_ns);
    let (without, statistics) = run(&[shorter, other], TWO_CORES, execution_ns);
    assert_eq!(of_the_other(&with_fault), of_the_other(&without));
    assert_eq!(statistics[1].completed, 20);
}

#[test]
fn e8_an_ended_dag_stays_ended() {
    let mut endless = diamond(1);
    endless.jobs = None;
    let mut scheduler = scheduler(&[endless, dag(30, 30, 2, &[5], &[])], PREEMPTIVE);
    assert_eq!(step(&mut scheduler, 0, &[]), [start(0, instance(0, 0, 0))]);
    assert!(!scheduler.is_ended(DagId(0)));
    // The instance that has started keeps its core to its end.
    assert_eq!(stop(&mut scheduler, 3, 0), []);
    assert!(scheduler.is_ended(DagId(0)) && !scheduler.is_over(DagId(0)));
    assert_eq!(scheduler.running(CoreId(0)), Some(instance(0, 0, 0)));
    assert_eq!(stop(&mut scheduler, 4, 0), []);
    assert_eq!(
        step(&mut scheduler, 5, &[instance(0, 0, 0)]),
        [start(0, instance(1, 0, 0))]
    );
    assert!(scheduler.is_over(DagId(0)) && !scheduler.is_finished());
    let _ = step(&mut scheduler, 6, &[instance(1, 0, 0)]);
    assert_eq!(scheduler.next_event_ns(), Some(30));
    assert_eq!(step(&mut scheduler, 30, &[]), [start(0, instance(1, 1, 0))]);
    let _ = step(&mut scheduler, 31, &[instance(1, 1, 0)]);
    assert!(scheduler.is_finished());
    let counted = scheduler.statistics(DagId(0));
    assert_eq!(
        (counted.faults, counted.cut_short, counted.released),
        (0, 1, 1)
    );
}

#[test]
fn a_stop_before_the_first_release_leaves_nothing_to_do() {
    let mut scheduler = scheduler(&[diamond(3)], PREEMPTIVE);
    assert_eq!(stop(&mut scheduler, 0, 0), []);
    assert!(scheduler.is_finished());
    assert_eq!(scheduler.next_event_ns(), None);
    assert_eq!(scheduler.statistics(DagId(0)).released, 0);
}

#[test]
#[should_panic(expected = "dag 0 job 0 subtask 1 fails and has not started")]
fn failing_what_has_not_started_is_refused() {
    let mut scheduler = scheduler(&[diamond(1)], PREEMPTIVE);
    let _ = step(&mut scheduler, 0, &[]);
    let _ = fail(&mut scheduler, 1, instance(0, 0, 1));
}
