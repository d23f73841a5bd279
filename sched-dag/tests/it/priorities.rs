//! Priorities from the graph.

use sched_dag::{CommitOptions, DagFault, DagSpec, Policy, verify};

use crate::support::{Spec, dag};

/// 0 -> {1, 2, 3} -> 4 without priorities.
fn fork(deadline_ns: u64, wcets_ns: [Option<u64>; 5]) -> DagSpec {
    let edges = [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)];
    dag(100, deadline_ns, 1, &[0; 5], &edges).with(|spec| {
        for (subtask, wcet_ns) in spec.subtasks.iter_mut().zip(wcets_ns) {
            (subtask.priority, subtask.wcet_ns) = (None, wcet_ns);
        }
    })
}

/// Returns the priorities of each DAG's subtasks, or the codes of the faults.
fn priorities(specs: &[DagSpec]) -> Result<Vec<Vec<u32>>, Vec<&'static str>> {
    let options = CommitOptions::new(Policy::StaticPriority, 2);
    let verified = verify(specs, &options);
    let verified =
        verified.map_err(|it| it.faults().iter().map(DagFault::code).collect::<Vec<_>>())?;
    let dags = verified.task_set.dags().iter();
    let of_dag = dags.map(|dag| dag.subtasks().iter().map(|it| it.priority().0).collect());
    Ok(of_dag.collect())
}

#[test]
fn the_longest_remaining_path_comes_first_and_ties_by_registration() {
    let of = |wcets_ns| priorities(&[fork(90, wcets_ns)]);
    let known = [2, 3, 5, 3, 1].map(Some);
    assert_eq!(of(known), Ok(vec![vec![0, 2, 1, 3, 4]]));
    // Without all WCETs the number of subtasks on the path decides.
    let unknown = [Some(2), None, Some(5), Some(3), Some(1)];
    assert_eq!(of(unknown), Ok(vec![vec![0, 1, 2, 3, 4]]));
}

#[test]
fn derived_priorities_are_deadline_monotonic_and_come_after_given_ones() {
    let specs = [
        fork(90, [None; 5]),
        fork(30, [None; 5]),
        fork(90, [None; 5]),
    ];
    let from = |first| (first..first + 5).collect::<Vec<u32>>();
    assert_eq!(priorities(&specs), Ok(vec![from(5), from(0), from(10)]));
    let given = dag(100, 100, 1, &[3, 1], &[(0, 1)]);
    let specs = [fork(90, [None; 5]), given];
    assert_eq!(priorities(&specs), Ok(vec![from(4), vec![3, 1]]));
}

#[test]
fn derived_priorities_never_wrap() {
    let behind = |given| {
        let given = dag(100, 100, 1, &[given], &[]);
        priorities(&[fork(90, [None; 5]), given])
    };
    // 4 numbers are left, and 5.
    assert_eq!(behind(u32::MAX - 4), Err(vec!["priorities_exhausted"]));
    assert!(behind(u32::MAX - 5).is_ok());
}
