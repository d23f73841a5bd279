//! The rules R1 to R5 of the model, each by tests that bear its number.

mod support;

use sched_dag::{DagSpec, Policy, Preemption, SchedulerOptions};
use support::hand::Hand;
use support::{ByDag, PREEMPTIVE, Spec, TWO_CORES, cores, dag, run, under};

const DIAMOND: &[(usize, usize)] = &[(0, 1), (0, 2), (1, 3), (2, 3)];

/// One job of one subtask, released at an offset.
fn one(priority: u32, offset_ns: u64) -> DagSpec {
    dag(100, 100, 1, &[priority], &[]).offset(offset_ns)
}

#[test]
fn r1_nothing_of_a_job_runs_before_its_release() {
    run(&[dag(10, 10, 3, &[0], &[]).offset(3)], TWO_CORES, 1).must_be(
        "3 released 0.0, start 0.0.0 on 0
         13 released 0.1, start 0.1.0 on 0
         23 released 0.2, start 0.2.0 on 0",
    );
}

#[test]
fn r1_releases_follow_the_nominal_grid_and_not_the_drivers_delay() {
    Hand::new(&[dag(10, 10, 3, &[0], &[])], PREEMPTIVE)
        .must("4: released 0.0, start 0.0.0 on 0, next=10");
}

#[test]
fn r2_join_waits_for_all_predecessors() {
    let diamond = dag(100, 100, 1, &[0, 0, 0, 0], DIAMOND);
    run(&[diamond], TWO_CORES, [1, 2, 7, 1]).must_be(
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
    run(&[dag(1, 100, 2, &[0, 0], &[(0, 1)])], cores(4), [3, 5]).must_be(
        "0 ready 0.0.0
         3 ready 0.0.1, ready 0.1.0
         8 ready 0.1.1",
    );
}

#[test]
fn r2_jobs_of_one_dag_overlap() {
    run(&[dag(4, 12, 3, &[0, 1], &[(0, 1)])], TWO_CORES, 4).must_be(
        "0 start 0.0.0 on 0
         4 start 0.1.0 on 0, start 0.0.1 on 1
         8 start 0.2.0 on 1, start 0.1.1 on 0
         12 start 0.2.1 on 1",
    );
}

#[test]
fn r3_all_edges_of_an_instance_are_released_at_its_completion() {
    let edges = &[(0, 1), (0, 2), (0, 3)];
    run(&[dag(100, 100, 1, &[0; 4], edges)], PREEMPTIVE, 2).must_be(
        "0 ready 0.0.0
         2 finish 0.0.0, ready 0.0.1, ready 0.0.2, ready 0.0.3
         4 finish 0.0.1
         6 finish 0.0.2
         8 finish 0.0.3",
    );
}

#[test]
fn r4_a_job_ends_with_its_last_sink() {
    let fork = dag(100, 9, 1, &[0, 0, 0], &[(0, 1), (0, 2)]);
    run(&[fork], TWO_CORES, [1, 3, 8]).must_be("9 completed 0.0 Met");
}

#[test]
fn r4_the_deadline_itself_is_in_time_and_the_next_instant_is_not() {
    let spec = || dag(100, 5, 1, &[0], &[]);
    run(&[spec(), spec(), spec()], cores(3), ByDag([5, 6, 50])).must_be(
        "5 completed 0.0 Met
         6 missed 1.0, completed 1.0 Missed, missed 2.0
         50 completed 2.0 Missed
         misses=0, misses@1=1, misses@2=1",
    );
}

#[test]
fn r4_a_job_meets_its_deadlines_if_each_sink_meets_its_own() {
    let spec = dag(100, 9, 1, &[0, 1, 2, 3], &[(0, 1), (0, 2), (0, 3)])
        .due(1, 3)
        .due(2, 5);
    for (execution_ns, events) in [
        ([1, 2, 4, 8], "9 completed 0.0 Met\nmisses=0"),
        (
            [1, 3, 4, 8],
            "4 missed 0.0\n9 completed 0.0 Missed\nmisses=1",
        ),
        (
            [1, 2, 5, 8],
            "6 missed 0.0\n9 completed 0.0 Missed\nmisses=1",
        ),
        // The job is missed once, however many of its sinks are late.
        (
            [1, 7, 5, 9],
            "4 missed 0.0\n10 completed 0.0 Missed\nmisses=1",
        ),
    ] {
        run(std::slice::from_ref(&spec), cores(4), execution_ns).must_be(events);
    }
}

#[test]
fn r5_between_jobs_of_one_dag_with_one_deadline_the_older_one_goes_first() {
    // Job 0's subtask 1 and job 1's subtask 0 are due at 14.
    let spec = dag(10, 14, 2, &[0, 0], &[]).due(0, 4);
    run(&[spec], under(Policy::Edf), [1, 12]).must_be(
        "0 start 0.0.0 on 0
         1 start 0.0.1 on 0
         13 start 0.1.0 on 0
         14 start 0.1.1 on 0",
    );
}

#[test]
fn r5_the_instances_with_the_smallest_keys_run() {
    // DAG 1 is released into the middle of DAG 0 and has the higher priority.
    run(&[one(5, 0), one(0, 2)], PREEMPTIVE, 4).must_be(
        "0 start 0.0.0 on 0
         2 suspend 0.0.0 on 0, start 1.0.0 on 0
         6 finish 1.0.0, resume 0.0.0 on 0
         8 finish 0.0.0",
    );
}

#[test]
fn r5_between_equal_priorities_the_rest_of_the_key_decides_preemption_too() {
    run(&[one(5, 2), one(5, 0)], PREEMPTIVE, 4).must_be(
        "0 start 1.0.0 on 0
         2 suspend 1.0.0 on 0, start 0.0.0 on 0
         6 resume 1.0.0 on 0",
    );
}

#[test]
fn r5_a_newer_job_never_goes_before_an_older_one_of_the_same_priority() {
    run(&[dag(4, 4, 2, &[0, 0], &[(0, 1)])], PREEMPTIVE, [1, 4]).must_be(
        "0 start 0.0.0 on 0
         1 start 0.0.1 on 0
         5 start 0.1.0 on 0
         6 start 0.1.1 on 0",
    );
}

#[test]
fn r5_edf_orders_by_absolute_deadline() {
    // DAG 1 has the longer relative and, released earlier, the earlier absolute deadline.
    let late = dag(100, 10, 1, &[0], &[]).offset(3);
    let specs = [late, dag(100, 12, 1, &[9], &[])];
    run(&specs, under(Policy::Edf), 5).must_be("0 start 1.0.0 on 0\n5 start 0.0.0 on 0");
}

#[test]
fn r5_without_preemption_a_started_instance_keeps_its_core() {
    let non_preemptive = SchedulerOptions {
        preemption: Preemption::Disabled,
        ..PREEMPTIVE
    };
    run(&[one(5, 0), one(1, 1), one(0, 2)], non_preemptive, 4).must_be(
        "0 start 0.0.0 on 0
         4 start 2.0.0 on 0
         8 start 1.0.0 on 0",
    );
}

#[test]
fn r5_a_non_preemptive_subtask_keeps_its_core_among_preemptive_ones() {
    let urgent = dag(100, 100, 1, &[0, 1], &[]).offset(2);
    let specs = [one(5, 0).non_preemptive(0), one(4, 0), urgent];
    // Both cores are busy: of the two, only DAG 1's subtask gives way.
    run(&specs, TWO_CORES, 4).must_be(
        "0 start 1.0.0 on 0, start 0.0.0 on 1
         2 suspend 1.0.0 on 0, start 2.0.0 on 0
         4 start 2.0.1 on 1
         6 resume 1.0.0 on 0",
    );
}

#[test]
fn r5_a_non_preemptive_subtask_still_waits_for_smaller_keys_to_start() {
    run(&[one(5, 0).non_preemptive(0), one(4, 0)], PREEMPTIVE, 4)
        .must_be("0 start 1.0.0 on 0\n4 start 0.0.0 on 0");
}

#[test]
fn r5_completions_come_before_releases_and_both_before_the_dispatch() {
    // At 4 the running instance finishes and a more urgent one is released: no
    // preemption, no detour over DAG 0's second subtask, which became ready.
    let specs = [dag(100, 100, 1, &[5, 5], &[(0, 1)]), one(0, 4)];
    run(&specs, PREEMPTIVE, 4).must_be(
        "0 released 0.0, ready 0.0.0, start 0.0.0 on 0
         4 finish 0.0.0, ready 0.0.1, released 1.0, ready 1.0.0, start 1.0.0 on 0
         8 finish 1.0.0, start 0.0.1 on 0
         12 finish 0.0.1",
    );
}

#[test]
fn r5_no_instance_is_preempted_while_a_core_is_idle() {
    let run = run(&[one(5, 0), one(0, 2)], TWO_CORES, 4);
    run.must_be("0 start 0.0.0 on 0\n2 start 1.0.0 on 1");
    assert!(!run.lines().iter().any(|event| event.contains("suspend")));
}

#[test]
fn r5_is_work_conserving() {
    run(
        &[dag(100, 100, 1, &[3, 2, 1, 0], &[])],
        cores(3),
        [5, 4, 3, 2],
    )
    .must_be(
        "0 start 0.0.3 on 0, start 0.0.2 on 1, start 0.0.1 on 2
         2 start 0.0.0 on 0",
    );
}

#[test]
fn r5_the_core_that_completed_last_is_taken_first() {
    let join = dag(100, 100, 1, &[0, 1, 2, 3], &[(0, 3), (1, 3), (2, 3)]);
    run(&[join], cores(3), [2, 5, 3, 1]).must_be(
        "0 start 0.0.0 on 0, start 0.0.1 on 1, start 0.0.2 on 2
         5 start 0.0.3 on 1",
    );
}

#[test]
fn an_instance_may_execute_for_no_time() {
    run(&[dag(10, 1, 2, &[0, 0], &[(0, 1)])], PREEMPTIVE, 0).must_be(
        "0 start 0.0.0 on 0, finish 0.0.0, start 0.0.1 on 0, finish 0.0.1, completed 0.0 Met
         10 start 0.1.0 on 0, finish 0.1.0, start 0.1.1 on 0, finish 0.1.1, completed 0.1 Met",
    );
}
