//! Ranks: the order in which subtasks wait, as far as it is known at commit.

use alloc::vec::Vec;

use crate::ids::{DagId, SubtaskId, to_u32};
use crate::order::{sorted, sorted_by_key};
use crate::scheduler::key::Order;
use crate::scheduler::vertices::Vertices;
use crate::task_set::{Dag, TaskSet};

/// Reports whether the subtasks of a DAG, as far as they wait together, are in
/// the same order whatever jobs they do.
pub(super) fn has_ranks(dag: &Dag) -> bool {
    let priorities: Vec<_> = dag.subtasks().iter().map(|s| s.priority().0).collect();
    let priorities = sorted(&priorities);
    dag.in_flight() == 1 || priorities.windows(2).all(|pair| pair[0] != pair[1])
}

/// Replaces each vertex's priority by its place in the order of (priority, DAG,
/// subtask), or of (priority, DAG) if the job comes next; returns the vertices in
/// that order.
pub(super) fn rank(vertices: &mut Vertices, kind: Order) -> Vec<u32> {
    // Vertices count DAG by DAG, within a DAG by subtask, and the sort is stable.
    let urgency = |vertex| vertices.get(to_u32(vertex)).rank;
    let order = sorted_by_key(vertices.len(), urgency);
    let order: Vec<u32> = order.into_iter().map(to_u32).collect();
    let mut rank = 0;
    let mut last = None;
    for &number in &order {
        let vertex = vertices.get_mut(number);
        let group = (vertex.rank, vertex.dag);
        if last.is_some_and(|last| kind == Order::Rank || last != group) {
            rank += 1;
        }
        last = Some(group);
        vertex.rank = rank;
    }
    order
}

/// Replaces each vertex's priority by its place in the order of (DAG, relative deadline,
/// the longest first), and returns the relative deadline of each place.
pub(super) fn rank_by_deadline(task_set: &TaskSet, vertices: &mut Vertices) -> Vec<u64> {
    let mut of_ranks = Vec::new();
    for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
        let first = task_set.first_vertex(id);
        let of_dag = deadlines_ns(dag);
        for (subtask, attributes) in (0..).map(SubtaskId).zip(dag.subtasks()) {
            let own_ns = attributes.relative_deadline_ns();
            let longer = of_dag.partition_point(|&longer_ns| longer_ns > own_ns);
            vertices.get_mut(first + subtask.0).rank = to_u32(of_ranks.len() + longer);
        }
        of_ranks.extend(of_dag);
    }
    of_ranks
}

/// Returns the relative deadlines of a DAG's subtasks, each once, the longest first.
pub(super) fn deadlines_ns(dag: &Dag) -> Vec<u64> {
    let of_subtasks = dag.subtasks().iter().map(|of| of.relative_deadline_ns());
    let mut deadlines_ns = sorted(&of_subtasks.collect::<Vec<_>>());
    deadlines_ns.dedup();
    deadlines_ns.reverse();
    deadlines_ns
}
