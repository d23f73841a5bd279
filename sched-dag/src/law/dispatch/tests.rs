//! Small schedules, right and wrong, as stretches of time on cores.

use super::*;
use crate::ids::{ClusterId, DagId, SubtaskId};
use crate::{Clusters, CommitOptions, DagSpec, Priority, SubtaskSpec, verify};

/// DAGs of one subtask each, DAG 0 the most urgent; the last one's subtask
/// cannot be preempted if `keeps`.
fn dags(count: u32, keeps: bool) -> TaskSet {
    let spec = |dag: u32| DagSpec {
        period_ns: Some(100),
        relative_deadline_ns: Some(50 + u64::from(dag)),
        jobs: Some(1),
        subtasks: vec![SubtaskSpec {
            priority: Some(Priority(dag)),
            non_preemptive: keeps && dag + 1 == count,
            ..SubtaskSpec::default()
        }],
        ..DagSpec::default()
    };
    let specs: Vec<DagSpec> = (0..count).map(spec).collect();
    let options = CommitOptions::new(Policy::StaticPriority, 1);
    verify(&specs, &options).unwrap().task_set
}

/// Ready times by DAG, and stretches as (DAG, core, from, to).
fn events(ready_ns: &[u64], ran: &[(u32, u32, u64, u64)]) -> Vec<Event> {
    let event = |time_ns, what, dag, core| Event {
        time_ns,
        what,
        core: CoreId(core),
        dag: DagId(dag),
        job: 0,
        subtask: Some(SubtaskId(0)),
    };
    let ready = (0..).zip(ready_ns);
    let mut events: Vec<Event> = ready
        .map(|(dag, &ns)| event(ns, What::Ready, dag, 0))
        .collect();
    for (place, &(dag, core, from_ns, to_ns)) in ran.iter().enumerate() {
        let is_own = |stretch: &&(u32, u32, u64, u64)| stretch.0 == dag;
        let begins = match ran[..place].iter().any(|stretch| is_own(&stretch)) {
            true => What::Resume,
            false => What::Start,
        };
        let ends = match ran[place + 1..].iter().any(|stretch| is_own(&stretch)) {
            true => What::Suspend,
            false => What::Finish,
        };
        events.push(event(from_ns, begins, dag, core));
        events.push(event(to_ns, ends, dag, core));
    }
    events.sort_by_key(|event| event.time_ns);
    events
}

fn check(
    task_set: &TaskSet,
    cores: u32,
    ready_ns: &[u64],
    ran: &[(u32, u32, u64, u64)],
) -> Vec<String> {
    let events = events(ready_ns, ran);
    let found = |policy| {
        let options = SchedulerOptions {
            policy,
            preemption: Preemption::Enabled,
            cores,
        };
        let events = events.iter().copied();
        let found = dispatch_violations(task_set, &options, Terms::EXACT, events);
        found.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    // The deadlines are in the order of the priorities.
    let by_priority = found(Policy::StaticPriority);
    assert_eq!(by_priority, found(Policy::Edf));
    by_priority
}

fn nothing_wrong() -> [String; 0] {
    []
}

fn passed_over(at_ns: u64, waiting: u32, length_ns: u64, why: &str) -> [String; 1] {
    [format!(
        "at {at_ns} ns, R5 dispatch: subtask 0 of dag {waiting} job 0 should run and waits \
         {length_ns} ns while {why}"
    )]
}

#[test]
fn r5_accepts_preemption_and_a_full_machine() {
    let two = dags(2, false);
    let ran = [(1, 0, 0, 4), (0, 0, 4, 9), (1, 0, 9, 12)];
    assert_eq!(check(&two, 1, &[4, 0], &ran), nothing_wrong());
    let side_by_side = [(1, 0, 0, 4), (0, 1, 2, 9)];
    assert_eq!(check(&two, 2, &[2, 0], &side_by_side), nothing_wrong());
    let nothing = [(1, 0, 0, 0), (0, 0, 0, 3)];
    assert_eq!(check(&two, 1, &[0, 0], &nothing), nothing_wrong());
}

#[test]
fn r5_finds_an_idle_core_and_a_missing_preemption() {
    let two = dags(2, false);
    let idle = [(0, 0, 0, 4), (1, 0, 4, 9)];
    assert_eq!(
        check(&two, 2, &[0, 0], &idle),
        passed_over(0, 1, 4, "core 1 is idle"),
        "core 1 could run it"
    );
    let not_preempted = [(1, 0, 0, 9), (0, 0, 9, 12)];
    assert_eq!(
        check(&two, 1, &[4, 0], &not_preempted),
        passed_over(4, 0, 5, "core 0 runs subtask 0 of dag 1 job 0")
    );
    let three = dags(3, false);
    let wrong_one = [(1, 0, 0, 4), (2, 1, 0, 9), (0, 0, 4, 6), (1, 0, 6, 8)];
    assert_eq!(
        check(&three, 2, &[4, 0, 0], &wrong_one),
        passed_over(4, 1, 2, "core 1 runs subtask 0 of dag 2 job 0"),
        "of two, the one with the larger key is preempted"
    );
}

#[test]
fn r5_lets_a_started_instance_keep_its_core() {
    let two = dags(2, true);
    let kept = [(1, 0, 0, 9), (0, 0, 9, 12)];
    assert_eq!(check(&two, 1, &[4, 0], &kept), nothing_wrong());
    // Chosen at one instant, the smaller key comes first all the same.
    let chosen = "at 0 ns, R5 dispatch: subtask 0 of dag 1 job 0 starts on core 0 and keeps it, \
                  although subtask 0 of dag 0 job 0 waits since 0 ns and goes first";
    assert_eq!(check(&two, 1, &[0, 0], &kept), [chosen]);
    let lost = "at 6 ns, R5 dispatch: subtask 0 of dag 1 job 0 is resumed on core 0 although it \
                keeps its core until it finishes";
    let preempted = [(1, 0, 0, 4), (0, 0, 4, 6), (1, 0, 6, 9)];
    assert_eq!(check(&two, 1, &[4, 0], &preempted), [lost]);
}

#[test]
fn finds_a_core_or_an_instance_in_two_places() {
    let two = dags(2, false);
    let found = |ready_ns: &[u64], ran: &[(u32, u32, u64, u64)]| {
        let found = crate::law::violations(&two, Terms::EXACT, events(ready_ns, ran));
        found.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let one_core = found(&[0, 2], &[(0, 0, 0, 4), (1, 0, 2, 6)]);
    let not_free = "at 2 ns, one core: core 0 runs subtask 0 of dag 1 job 0 while it still runs \
                    subtask 0 of dag 0 job 0";
    assert!(one_core.iter().any(|text| text == not_free), "{one_core:?}");
}

#[test]
fn r5_holds_within_each_cluster() {
    let spec = |dag: u32| DagSpec {
        period_ns: Some(100),
        relative_deadline_ns: Some(50),
        jobs: Some(1),
        cluster: Some(ClusterId(dag / 2)),
        subtasks: vec![SubtaskSpec {
            priority: Some(Priority(dag)),
            ..SubtaskSpec::default()
        }],
        ..DagSpec::default()
    };
    let specs: Vec<DagSpec> = (0..3).map(spec).collect();
    let clusters = Clusters::Of(vec![1, 1]);
    let options = CommitOptions::new(Policy::StaticPriority, 2).with_clusters(clusters);
    let three = verify(&specs, &options).unwrap().task_set;
    // DAG 1 waits for core 0, though core 1 is idle and runs a less urgent one.
    let apart = [(0, 0, 0, 4), (1, 0, 4, 9), (2, 1, 2, 5)];
    assert_eq!(check(&three, 2, &[0, 0, 2], &apart), nothing_wrong());
    let idle = [(0, 0, 0, 4), (1, 0, 4, 9), (2, 1, 5, 7)];
    assert_eq!(
        check(&three, 2, &[0, 0, 2], &idle),
        passed_over(2, 2, 3, "core 1 is idle")
    );
    let elsewhere = [(0, 0, 0, 4), (1, 1, 0, 5), (2, 1, 5, 7)];
    let found = check(&three, 2, &[0, 0, 5], &elsewhere);
    let outside = "at 0 ns, R5 dispatch: subtask 0 of dag 1 job 0 starts on core 1, outside its \
                   cluster";
    assert!(found.iter().any(|text| text == outside), "{found:?}");
}
