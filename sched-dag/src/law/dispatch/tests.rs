//! Small schedules, right and wrong, as stretches of time on cores.

use super::*;
use crate::ids::{DagId, SubtaskId};
use crate::law::Precision;
use crate::{CommitOptions, DagSpec, Priority, SubtaskSpec, verify};

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

fn of(dag: u32) -> Instance {
    Instance {
        dag: DagId(dag),
        job: 0,
        subtask: SubtaskId(0),
    }
}

/// Ready times by DAG, and stretches as (DAG, core, from, to).
fn check(
    task_set: &TaskSet,
    cores: u32,
    ready_ns: &[u64],
    ran: &[(u32, u32, u64, u64)],
) -> Vec<Violation> {
    let record = Record::with_jobs(task_set, Precision::Exact, |_| 0..1).unwrap();
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
    let found = |policy| {
        let options = SchedulerOptions {
            policy,
            preemption: Preemption::Enabled,
            cores,
        };
        let events = events.iter().copied();
        dispatch_violations(task_set, &options, &record, events, 0)
    };
    // The deadlines are in the order of the priorities.
    let by_priority = found(Policy::StaticPriority);
    assert_eq!(by_priority, found(Policy::Edf));
    by_priority
}

#[test]
fn r5_accepts_preemption_and_a_full_machine() {
    let two = dags(2, false);
    let ran = [(1, 0, 0, 4), (0, 0, 4, 9), (1, 0, 9, 12)];
    assert_eq!(check(&two, 1, &[4, 0], &ran), []);
    let side_by_side = [(1, 0, 0, 4), (0, 1, 2, 9)];
    assert_eq!(check(&two, 2, &[2, 0], &side_by_side), []);
    let nothing = [(1, 0, 0, 0), (0, 0, 0, 3)];
    assert_eq!(check(&two, 1, &[0, 0], &nothing), []);
}

#[test]
fn r5_finds_an_idle_core_and_a_missing_preemption() {
    let two = dags(2, false);
    let passed_over = |at_ns, waiting, running: Option<u32>| Violation::PassedOver {
        at_ns,
        waiting: of(waiting),
        running: running.map(of),
    };
    let idle = [(0, 0, 0, 4), (1, 0, 4, 9)];
    assert_eq!(
        check(&two, 2, &[0, 0], &idle),
        [passed_over(0, 1, None)],
        "core 1 could run it"
    );
    let not_preempted = [(1, 0, 0, 9), (0, 0, 9, 12)];
    assert_eq!(
        check(&two, 1, &[4, 0], &not_preempted),
        [passed_over(4, 0, Some(1))]
    );
    let three = dags(3, false);
    let wrong_one = [(1, 0, 0, 4), (2, 1, 0, 9), (0, 0, 4, 6), (1, 0, 6, 8)];
    assert_eq!(
        check(&three, 2, &[4, 0, 0], &wrong_one),
        [passed_over(4, 1, Some(2))],
        "of two, the one with the larger key is preempted"
    );
}

#[test]
fn r5_lets_a_started_instance_keep_its_core() {
    let two = dags(2, true);
    let kept = [(1, 0, 0, 9), (0, 0, 9, 12)];
    assert_eq!(check(&two, 1, &[4, 0], &kept), []);
    // Chosen at one instant, the smaller key comes first all the same.
    let chosen = Violation::PassedOver {
        at_ns: 0,
        waiting: of(0),
        running: Some(of(1)),
    };
    assert_eq!(check(&two, 1, &[0, 0], &kept), [chosen]);
    let lost = Violation::LostItsCore {
        instance: of(1),
        at_ns: 6,
    };
    let preempted = [(1, 0, 0, 4), (0, 0, 4, 6), (1, 0, 6, 9)];
    assert_eq!(check(&two, 1, &[4, 0], &preempted), [lost]);
}

#[test]
fn r5_finds_a_core_or_an_instance_in_two_places() {
    let two = dags(2, false);
    let not_free = |core, instance, at_ns| Violation::CoreNotFree {
        core: CoreId(core),
        instance: of(instance),
        at_ns,
    };
    let one_core = [(0, 0, 0, 4), (1, 0, 2, 6)];
    assert!(check(&two, 2, &[0, 2], &one_core).contains(&not_free(0, 1, 2)));
    let two_cores = [(0, 0, 0, 4), (0, 1, 2, 6), (1, 1, 6, 7)];
    assert!(check(&two, 2, &[0, 6], &two_cores).contains(&not_free(1, 0, 2)));
}
