//! Priorities from the graph.

mod support;

use sched_dag::{CommitOptions, DagSpec, Fault, Policy, SubtaskSpec, TaskSet, verify};

/// 0 -> {1, 2, 3} -> 4 without priorities.
fn fork(deadline_ns: u64, wcets_ns: [Option<u64>; 5]) -> DagSpec {
    DagSpec {
        period_ns: Some(100),
        relative_deadline_ns: Some(deadline_ns),
        subtasks: wcets_ns
            .map(|wcet_ns| SubtaskSpec {
                wcet_ns,
                ..SubtaskSpec::default()
            })
            .to_vec(),
        edges: vec![(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)],
        ..DagSpec::default()
    }
}

fn commit(specs: &[DagSpec]) -> TaskSet {
    let options = CommitOptions::new(Policy::StaticPriority, 2);
    verify(specs, &options).expect("right DAGs").task_set
}

fn priorities(task_set: &TaskSet, dag: usize) -> Vec<u32> {
    task_set.dags()[dag]
        .subtasks()
        .iter()
        .map(|subtask| subtask.priority().0)
        .collect()
}

#[test]
fn the_longest_remaining_path_comes_first_and_ties_by_registration() {
    let task_set = commit(&[fork(90, [2, 3, 5, 3, 1].map(Some))]);
    assert_eq!(priorities(&task_set, 0), [0, 2, 1, 3, 4]);
}

#[test]
fn without_all_wcets_the_number_of_subtasks_on_the_path_decides() {
    let task_set = commit(&[fork(90, [Some(2), None, Some(5), Some(3), Some(1)])]);
    assert_eq!(priorities(&task_set, 0), [0, 1, 2, 3, 4]);
}

#[test]
fn between_dags_derived_priorities_are_deadline_monotonic() {
    let equal = [None; 5];
    let task_set = commit(&[fork(90, equal), fork(30, equal), fork(90, equal)]);
    assert_eq!(priorities(&task_set, 1), [0, 1, 2, 3, 4]);
    assert_eq!(priorities(&task_set, 0), [5, 6, 7, 8, 9]);
    assert_eq!(priorities(&task_set, 2), [10, 11, 12, 13, 14]);
}

#[test]
fn derived_priorities_come_after_given_ones() {
    let given = support::dag(100, 100, 1, &[3, 1], &[(0, 1)]);
    let task_set = commit(&[fork(90, [None; 5]), given]);
    assert_eq!(priorities(&task_set, 1), [3, 1]);
    assert_eq!(priorities(&task_set, 0), [4, 5, 6, 7, 8]);
}

#[test]
fn derived_priorities_never_wrap() {
    let given = support::dag(100, 100, 1, &[u32::MAX - 4], &[]);
    let options = CommitOptions::new(Policy::StaticPriority, 2);
    let rejected = verify(&[fork(90, [None; 5]), given], &options).expect_err("4 numbers are left");
    assert_eq!(rejected.faults().len(), 1);
    assert!(matches!(
        rejected.faults()[0],
        Fault::PrioritiesExhausted { .. }
    ));
    let given = support::dag(100, 100, 1, &[u32::MAX - 5], &[]);
    assert!(verify(&[fork(90, [None; 5]), given], &options).is_ok());
}
