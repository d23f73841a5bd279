//! The rules A1 to A6: DAGs that are added to those that are scheduled, and removed.

mod support;

use std::sync::Arc;

use sched_dag::virtual_time::{End, VirtualTime};
use sched_dag::{
    Activation, ClusterId, CommitOptions, ConstructionPolicy, DagId, DagSpec, Decision, Instance,
    Policy, Priority, Scheduler, SchedulerOptions, SubtaskSpec, TaskSet, verify,
};
use support::{Log, PREEMPTIVE, assert_events, commit, dag, instance, scheduler};

const LATER: DagId = DagId(1);

/// Runs the first DAG, adds the other right before a time, and runs both to the end.
fn add(specs: [DagSpec; 2], at_ns: u64, takes_ns: impl FnMut(Instance) -> u64) -> Vec<String> {
    let [first, later] = specs;
    let task_set = commit(&[first], PREEMPTIVE);
    let mut log = Log::new(takes_ns);
    let mut run = VirtualTime::new(Scheduler::new(Arc::clone(&task_set), PREEMPTIVE));
    assert_eq!(run.run_until(at_ns - 1, &mut log), End::TimeReached);
    run.extend(&Arc::new(
        task_set.with_added(&commit(&[later], PREEMPTIVE), at_ns),
    ));
    assert_eq!(run.run(&mut log), End::Finished);
    assert!(run.is_finished());
    log.lines
}

/// A scheduler of the DAGs that one schedules and one more, whose time begins at `at_ns`.
fn larger(scheduler: &Scheduler, more: DagSpec, at_ns: u64) -> Scheduler {
    let options = scheduler.options();
    let task_set = scheduler
        .task_set()
        .with_added(&commit(&[more], options), at_ns);
    Scheduler::new(Arc::new(task_set), options)
}

#[test]
#[should_panic(expected = "fewer DAGs")]
fn a1_no_dag_gets_lost() {
    let one = dag(10, 10, 1, &[0], &[]);
    let mut all = scheduler(&[one.clone(), one.clone()], PREEMPTIVE);
    all.extend(&mut scheduler(&[one], PREEMPTIVE));
}

#[test]
fn a2_the_time_of_an_added_dag_begins_at_the_switch() {
    let later = DagSpec {
        offset_ns: 3,
        ..dag(6, 6, 2, &[1], &[])
    };
    let events = add([dag(10, 10, 3, &[0], &[]), later], 12, |_| 1);
    assert_events(
        &events,
        "0 released 0.0 of 0
         10 released 0.1 of 10
         15 released 1.0 of 15
         20 released 0.2 of 20
         21 released 1.1 of 21",
    );
}

#[test]
fn a2_a_sporadic_dag_that_is_added_releases_nothing_before() {
    let later = DagSpec {
        activation: Activation::Sporadic,
        offset_ns: 5,
        ..dag(10, 10, 2, &[1], &[])
    };
    let mut one = scheduler(&[dag(100, 100, 9, &[0], &[])], PREEMPTIVE);
    assert_eq!(one.at(0).release_due(&mut ()).dispatch().len(), 1);
    let mut all = larger(&one, later, 7);
    one.extend(&mut all);
    let mut moment = one.at(8);
    moment.signal(LATER, &mut ());
    let _ = moment.release_due(&mut ()).dispatch();
    assert_eq!(one.next_event_ns(), Some(12));
}

#[test]
fn a3_what_runs_waits_or_was_preempted_goes_on() {
    // Two subtasks in a row of 4 each, released every 3, and one that preempts both.
    let first = dag(3, 9, 3, &[5, 6], &[(0, 1)]);
    let events = add([first, dag(20, 9, 1, &[0], &[])], 6, |_| 4);
    assert_events(
        &events,
        "0 start 0.0.0 on 0
         4 finish 0.0.0
         4 start 0.1.0 on 0
         6 preempt 0.1.0 on 0
         6 start 1.0.0 on 0
         10 finish 1.0.0
         10 resume 0.1.0 on 0
         12 finish 0.1.0
         12 start 0.2.0 on 0
         16 finish 0.2.0
         16 start 0.0.1 on 0
         20 finish 0.0.1
         20 start 0.1.1 on 0
         24 finish 0.1.1
         24 start 0.2.1 on 0
         28 finish 0.2.1",
    );
}

#[test]
fn a4_priorities_that_are_not_stated_come_after_all_that_there_are() {
    let unstated = DagSpec {
        period_ns: Some(1),
        relative_deadline_ns: Some(1),
        subtasks: vec![SubtaskSpec::default(); 2],
        edges: vec![(0, 1)],
        ..DagSpec::default()
    };
    let there = commit(&[dag(9, 9, 1, &[3, 8], &[(0, 1)])], PREEMPTIVE);
    let options = CommitOptions::new(Policy::StaticPriority, 1)
        .with_construction(ConstructionPolicy::any_graph())
        .with_priorities_after(there.last_priority());
    let added = verify(&[unstated], &options).expect("it is right").task_set;
    let priorities = added.dags()[0].subtasks().iter().map(|of| of.priority());
    assert_eq!(priorities.collect::<Vec<_>>(), [Priority(9), Priority(10)]);
}

#[test]
fn a4_of_equal_priorities_the_dag_that_was_there_is_first() {
    let equal = || dag(20, 20, 1, &[4], &[]);
    let mut one = scheduler(&[equal()], PREEMPTIVE);
    let mut all = larger(&one, equal(), 0);
    one.extend(&mut all);
    let [
        Decision::Start {
            instance: started, ..
        },
    ] = one.at(0).release_due(&mut ()).dispatch()[..]
    else {
        panic!("one core is given one instance");
    };
    assert_eq!(started, instance(0, 0, 0));
}

#[test]
fn a5_a_closed_dag_is_over_and_its_number_is_not_given_again() {
    let mut one = scheduler(&[dag(10, 10, 9, &[0], &[])], PREEMPTIVE);
    let _ = one.at(0).release_due(&mut ()).dispatch();
    one.at(1).close(DagId(0), &mut ());
    let mut moment = one.at(2);
    moment.complete(instance(0, 0, 0), &mut ());
    let _ = moment.release_due(&mut ()).dispatch();
    assert!(one.is_over(DagId(0)) && one.is_closed(DagId(0)));
    let mut all = larger(&one, dag(10, 10, 9, &[0], &[]), 3);
    one.extend(&mut all);
    assert!(one.is_closed(DagId(0)) && !one.is_over(LATER));
    assert_eq!(one.next_event_ns(), Some(3));
}

#[test]
fn a6_a_cluster_is_idle_while_no_job_of_it_is_in_flight() {
    let mut one = scheduler(&[dag(10, 10, 9, &[0], &[])], PREEMPTIVE);
    assert!(one.is_idle(ClusterId(0)));
    let _ = one.at(0).release_due(&mut ()).dispatch();
    assert!(!one.is_idle(ClusterId(0)) && one.is_idle(ClusterId(1)));
    let mut moment = one.at(2);
    moment.complete(instance(0, 0, 0), &mut ());
    let _ = moment.release_due(&mut ()).dispatch();
    assert!(one.is_idle(ClusterId(0)));
}

#[test]
fn a6_what_is_left_can_be_asked_about() {
    let [one, other] = [5, 7].map(|period_ns| dag(period_ns, 9, 1, &[0], &[]));
    let task_set: TaskSet = commit(
        &[one, other],
        SchedulerOptions {
            cores: 2,
            ..PREEMPTIVE
        },
    )
    .only(|dag| dag == LATER);
    assert_eq!(task_set.dags().len(), 1);
    assert_eq!(task_set.dags()[0].period_ns(), 7);
}
