//! The rules R1 to R5 of the model, each by tests that bear its number.

mod support;

use sched_dag::Told as _;
use sched_dag::{DagStatistics, Policy, Preemption, SchedulerOptions};
use support::{PREEMPTIVE, Timeline, cores, dag, run, scheduler, under};

const DIAMOND: &[(usize, usize)] = &[(0, 1), (0, 2), (1, 3), (2, 3)];

fn non_preemptive() -> SchedulerOptions {
    SchedulerOptions {
        preemption: Preemption::Disabled,
        ..PREEMPTIVE
    }
}

#[test]
fn r1_nothing_of_a_job_runs_before_its_release() {
    let mut spec = dag(10, 10, 3, &[0], &[]);
    spec.offset_ns = 3;
    let (events, _) = run(&[spec], cores(2), |_| 1);
    events.must_be(
        "3 released 0.0 of 3, start 0.0.0 on 0
         13 released 0.1 of 13, start 0.1.0 on 0
         23 released 0.2 of 23, start 0.2.0 on 0",
    );
}

#[test]
fn r1_releases_follow_the_nominal_grid_and_not_the_drivers_delay() {
    let mut scheduler = scheduler(&[dag(10, 10, 3, &[0], &[])], PREEMPTIVE);
    assert_eq!(scheduler.next_event_ns(), Some(0));
    let decisions = scheduler.told(4).release_due(&mut ()).dispatch();
    assert_eq!(decisions.len(), 1);
    assert_eq!(scheduler.next_event_ns(), Some(10));
}

#[test]
fn r2_join_waits_for_all_predecessors() {
    let (events, _) = run(
        &[dag(100, 100, 1, &[0, 0, 0, 0], DIAMOND)],
        cores(2),
        |instance| [1, 2, 7, 1][instance.subtask.index()],
    );
    events.must_be(
        "0 ready 0.0.0
         1 finish 0.0.0, ready 0.0.1, ready 0.0.2
         3 finish 0.0.1
         8 finish 0.0.2, ready 0.0.3
         9 finish 0.0.3",
    );
}

#[test]
fn r2_a_subtask_is_sequential_over_its_own_jobs() {
    // Two cores are free, and still job 1 waits for job 0 at each subtask.
    let (events, _) = run(
        &[dag(1, 100, 2, &[0, 0], &[(0, 1)])],
        cores(4),
        |instance| [3, 5][instance.subtask.index()],
    );
    events.must_be(
        "0 ready 0.0.0
         3 ready 0.0.1, ready 0.1.0
         8 ready 0.1.1",
    );
}

#[test]
fn r2_jobs_of_one_dag_overlap() {
    let (events, _) = run(&[dag(4, 12, 3, &[0, 1], &[(0, 1)])], cores(2), |_| 4);
    events.must_be(
        "0 start 0.0.0 on 0
         4 start 0.1.0 on 0, start 0.0.1 on 1
         8 start 0.2.0 on 1, start 0.1.1 on 0
         12 start 0.2.1 on 1",
    );
}

#[test]
fn r3_all_edges_of_an_instance_are_released_at_its_completion() {
    let edges = &[(0, 1), (0, 2), (0, 3)];
    let (events, _) = run(&[dag(100, 100, 1, &[0; 4], edges)], cores(1), |_| 2);
    events.must_be(
        "0 ready 0.0.0
         2 finish 0.0.0, ready 0.0.1, ready 0.0.2, ready 0.0.3
         4 finish 0.0.1
         6 finish 0.0.2
         8 finish 0.0.3",
    );
}

#[test]
fn r4_a_job_ends_with_its_last_sink() {
    let (events, _) = run(
        &[dag(100, 9, 1, &[0, 0, 0], &[(0, 1), (0, 2)])],
        cores(2),
        |instance| [1, 3, 8][instance.subtask.index()],
    );
    events.must_be("9 ended 0.0 Met");
}

#[test]
fn r4_the_deadline_itself_is_in_time_and_the_next_instant_is_not() {
    let specs = [dag(100, 5, 1, &[0], &[]), dag(100, 5, 1, &[1], &[])];
    let (events, statistics) = run(&specs, cores(2), |instance| 5 + u64::from(instance.dag.0));
    events.must_be(
        "5 ended 0.0 Met
         6 missed 1.0 of 5, ended 1.0 Missed",
    );
    assert_eq!((statistics[0].misses, statistics[1].misses), (0, 1));
}

#[test]
fn r4_a_miss_is_noticed_when_the_deadline_passes() {
    let (events, _) = run(&[dag(100, 5, 1, &[0], &[])], cores(1), |_| 50);
    events.must_be(
        "6 missed 0.0 of 5
         50 ended 0.0 Missed",
    );
}

/// Deadlines 9 of the DAG, 3 and 5 of sinks 1 and 2.
fn with_sinks(execution_ns: [u64; 4]) -> (Vec<String>, Vec<DagStatistics>) {
    let mut spec = dag(100, 9, 1, &[0, 1, 2, 3], &[(0, 1), (0, 2), (0, 3)]);
    spec.subtasks[1].relative_deadline_ns = Some(3);
    spec.subtasks[2].relative_deadline_ns = Some(5);
    run(&[spec], cores(4), |instance| {
        execution_ns[instance.subtask.index()]
    })
}

#[test]
fn r4_a_job_meets_its_deadlines_if_each_sink_meets_its_own() {
    for (execution_ns, events) in [
        ([1, 2, 4, 8], "9 ended 0.0 Met"),
        ([1, 3, 4, 8], "4 missed 0.0 of 3\n9 ended 0.0 Missed"),
        ([1, 2, 5, 8], "6 missed 0.0 of 5\n9 ended 0.0 Missed"),
        // The job is missed once, however many of its sinks are late.
        ([1, 7, 5, 9], "4 missed 0.0 of 3\n10 ended 0.0 Missed"),
    ] {
        let (happened, statistics) = with_sinks(execution_ns);
        let is_met = events.ends_with("Met");
        assert_eq!(
            happened.iter().any(|event| event.contains("missed")),
            !is_met
        );
        happened.must_be(events);
        assert_eq!(statistics[0].misses, u64::from(!is_met));
    }
}

#[test]
fn r5_between_jobs_of_one_dag_with_one_deadline_the_older_one_goes_first() {
    // Job 0's subtask 1 and job 1's subtask 0 are due at 14.
    let mut spec = dag(10, 14, 2, &[0, 0], &[]);
    spec.subtasks[0].relative_deadline_ns = Some(4);
    let (events, _) = run(&[spec], under(Policy::Edf), |instance| {
        [1, 12][instance.subtask.index()]
    });
    events.must_be(
        "0 start 0.0.0 on 0
         1 start 0.0.1 on 0
         13 start 0.1.0 on 0
         14 start 0.1.1 on 0",
    );
}

#[test]
fn r5_the_instances_with_the_smallest_keys_run() {
    // DAG 1 is released into the middle of DAG 0 and has the higher priority.
    let mut urgent = dag(100, 100, 1, &[0], &[]);
    urgent.offset_ns = 2;
    let (events, _) = run(&[dag(100, 100, 1, &[5], &[]), urgent], cores(1), |_| 4);
    events.must_be(
        "0 start 0.0.0 on 0
         2 preempt 0.0.0 on 0, start 1.0.0 on 0
         6 finish 1.0.0, resume 0.0.0 on 0
         8 finish 0.0.0",
    );
}

#[test]
fn r5_between_equal_priorities_the_rest_of_the_key_decides_preemption_too() {
    let mut first = dag(100, 100, 1, &[5], &[]);
    first.offset_ns = 2;
    let (events, _) = run(&[first, dag(100, 100, 1, &[5], &[])], cores(1), |_| 4);
    events.must_be(
        "0 start 1.0.0 on 0
         2 preempt 1.0.0 on 0, start 0.0.0 on 0
         6 resume 1.0.0 on 0",
    );
}

#[test]
fn r5_a_newer_job_never_goes_before_an_older_one_of_the_same_priority() {
    let (events, _) = run(&[dag(4, 4, 2, &[0, 0], &[(0, 1)])], cores(1), |instance| {
        [1, 4][instance.subtask.index()]
    });
    events.must_be(
        "0 start 0.0.0 on 0
         1 start 0.0.1 on 0
         5 start 0.1.0 on 0
         6 start 0.1.1 on 0",
    );
}

#[test]
fn r5_edf_orders_by_absolute_deadline() {
    // DAG 1 has the longer relative and, released earlier, the earlier absolute deadline.
    let mut late = dag(100, 10, 1, &[0], &[]);
    late.offset_ns = 3;
    let specs = [late, dag(100, 12, 1, &[9], &[])];
    let (events, _) = run(&specs, under(Policy::Edf), |_| 5);
    events.must_be(
        "0 start 1.0.0 on 0
         5 start 0.0.0 on 0",
    );
}

#[test]
fn r5_without_preemption_a_started_instance_keeps_its_core() {
    let mut urgent = dag(100, 100, 1, &[0], &[]);
    urgent.offset_ns = 2;
    let mut middle = dag(100, 100, 1, &[1], &[]);
    middle.offset_ns = 1;
    let specs = [dag(100, 100, 1, &[5], &[]), middle, urgent];
    let (events, _) = run(&specs, non_preemptive(), |_| 4);
    events.must_be(
        "0 start 0.0.0 on 0
         4 start 2.0.0 on 0
         8 start 1.0.0 on 0",
    );
}

#[test]
fn r5_a_non_preemptive_subtask_keeps_its_core_among_preemptive_ones() {
    let mut urgent = dag(100, 100, 1, &[0, 1], &[]);
    urgent.offset_ns = 2;
    let mut specs = [
        dag(100, 100, 1, &[5], &[]),
        dag(100, 100, 1, &[4], &[]),
        urgent,
    ];
    specs[0].subtasks[0].non_preemptive = true;
    // Both cores are busy: of the two, only DAG 1's subtask gives way.
    let (events, _) = run(&specs, cores(2), |_| 4);
    events.must_be(
        "0 start 1.0.0 on 0, start 0.0.0 on 1
         2 preempt 1.0.0 on 0, start 2.0.0 on 0
         4 start 2.0.1 on 1
         6 resume 1.0.0 on 0",
    );
}

#[test]
fn r5_a_non_preemptive_subtask_still_waits_for_smaller_keys_to_start() {
    let mut specs = [dag(100, 100, 1, &[5], &[]), dag(100, 100, 1, &[4], &[])];
    specs[0].subtasks[0].non_preemptive = true;
    let (events, _) = run(&specs, cores(1), |_| 4);
    events.must_be(
        "0 start 1.0.0 on 0
         4 start 0.0.0 on 0",
    );
}

#[test]
fn r5_completions_come_before_releases_and_both_before_the_dispatch() {
    // At 4 the running instance finishes and a more urgent one is released: no
    // preemption, no detour over DAG 0's second subtask, which became ready.
    let mut urgent = dag(100, 100, 1, &[0], &[]);
    urgent.offset_ns = 4;
    let specs = [dag(100, 100, 1, &[5, 5], &[(0, 1)]), urgent];
    let (events, _) = run(&specs, cores(1), |_| 4);
    events.must_be(
        "0 released 0.0 of 0, ready 0.0.0, start 0.0.0 on 0
         4 finish 0.0.0, ready 0.0.1, released 1.0 of 4, ready 1.0.0, start 1.0.0 on 0
         8 finish 1.0.0, start 0.0.1 on 0
         12 finish 0.0.1",
    );
}

#[test]
fn r5_no_instance_is_preempted_while_a_core_is_idle() {
    let mut urgent = dag(100, 100, 1, &[0], &[]);
    urgent.offset_ns = 2;
    let (events, _) = run(&[dag(100, 100, 1, &[5], &[]), urgent], cores(2), |_| 4);
    events.must_be(
        "0 start 0.0.0 on 0
         2 start 1.0.0 on 1",
    );
    assert!(!events.iter().any(|event| event.contains("preempt")));
}

#[test]
fn r5_is_work_conserving() {
    let (events, _) = run(
        &[dag(100, 100, 1, &[3, 2, 1, 0], &[])],
        cores(3),
        |instance| 5 - u64::from(instance.subtask.0),
    );
    events.must_be(
        "0 start 0.0.3 on 0, start 0.0.2 on 1, start 0.0.1 on 2
         2 start 0.0.0 on 0",
    );
}

#[test]
fn r5_the_core_that_completed_last_is_taken_first() {
    let edges = &[(0, 3), (1, 3), (2, 3)];
    let (events, _) = run(
        &[dag(100, 100, 1, &[0, 1, 2, 3], edges)],
        cores(3),
        |instance| [2, 5, 3, 1][instance.subtask.index()],
    );
    events.must_be(
        "0 start 0.0.0 on 0, start 0.0.1 on 1, start 0.0.2 on 2
         5 start 0.0.3 on 1",
    );
}

#[test]
fn an_instance_may_execute_for_no_time() {
    let (events, _) = run(&[dag(10, 1, 2, &[0, 0], &[(0, 1)])], cores(1), |_| 0);
    events.must_be(
        "0 start 0.0.0 on 0, finish 0.0.0, start 0.0.1 on 0, finish 0.0.1, ended 0.0 Met
         10 start 0.1.0 on 0, finish 0.1.0, start 0.1.1 on 0, finish 0.1.1, ended 0.1 Met",
    );
}
