//! Precedence that fixes an order of a DAG's subtasks, where that proves a shorter bound.
//!
//! Take a schedule of the WCETs on all cores: always the ready subtask with the longest
//! remaining path first, and none preempted. Add an edge from each subtask to the next one on
//! its core. Each core's subtasks are then a chain, so the DAG is no wider than the cores;
//! alone, no ready subtask ever waits, and the response time is at most the length of the
//! new graph: that of the schedule. Shorter execution times make no difference to that, as
//! they would to the schedule (R. L. Graham's anomalies, 1969).
//!
//! The edges are added if that length is below the bound of one job alone without them.
//! Among others the DAG is delayed by the work of others at most, as none of its own work is
//! besides its chains (`docs/multi-path-bound.md`, with j one less than the width).
//!
//! An edge goes from an earlier finish to a later start of the schedule, so none closes a cycle.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use super::graph::Graph;
use crate::analysis::{Task, multi_path};
use crate::ids::to_u32;
use crate::spec::DagSpec;

/// Returns the edges to add to a graph without cycle; none if a WCET is unknown.
pub(super) fn edges(spec: &DagSpec, graph: &Graph, cores: u32) -> Vec<(u32, u32)> {
    let wcets: Option<Vec<u64>> = spec.subtasks.iter().map(|one| one.wcet_ns).collect();
    let stated: Vec<(usize, usize)> = graph
        .subtasks()
        .flat_map(|from| {
            let successors = graph.successors.of(from).iter();
            successors.map(move |to| (from.index(), to.index()))
        })
        .collect();
    let Some(task) = wcets.and_then(|wcets| Task::new(1, 1, wcets, &stated).ok()) else {
        return Vec::new();
    };
    let (added, length_ns) = schedule(&task, graph, cores);
    match multi_path(&task, cores) {
        Some(bound_ns) if length_ns < bound_ns => added,
        _ => Vec::new(),
    }
}

/// Schedules the WCETs; returns an edge for each two neighbours on a core, and the length.
fn schedule(task: &Task, graph: &Graph, cores: u32) -> (Vec<(u32, u32)>, u64) {
    let (levels, wcets) = (task.bottom_levels(), task.wcets_ns());
    let predecessors = |subtask| graph.predecessors.of(subtask).len();
    let mut missing: Vec<usize> = graph.subtasks().map(predecessors).collect();
    let urgency = |subtask: usize| (levels[subtask], Reverse(subtask));
    let sources = (0..missing.len()).filter(|&subtask| missing[subtask] == 0);
    let mut ready: BinaryHeap<_> = sources.map(urgency).collect();
    let cores = usize::try_from(cores)
        .unwrap_or(usize::MAX)
        .min(missing.len());
    let mut last: Vec<Option<usize>> = vec![None; cores];
    let mut idle: Vec<usize> = (0..cores).rev().collect();
    // By their finish.
    let mut running: BinaryHeap<Reverse<(u64, usize, usize)>> = BinaryHeap::new();
    let mut edges = Vec::new();
    let mut now = 0;
    loop {
        while let Some(core) = idle.last().copied()
            && let Some((_, Reverse(subtask))) = ready.pop()
        {
            idle.pop();
            if let Some(before) = last[core].replace(subtask) {
                edges.push((to_u32(before), to_u32(subtask)));
            }
            running.push(Reverse((now + wcets[subtask], subtask, core)));
        }
        let Some(Reverse((finish, ..))) = running.peek().copied() else {
            return (edges, now);
        };
        now = finish;
        while let Some(Reverse((finish, subtask, core))) = running.peek().copied()
            && finish == now
        {
            running.pop();
            idle.push(core);
            for &next in task.successors(subtask) {
                missing[next] -= 1;
                if missing[next] == 0 {
                    ready.push(urgency(next));
                }
            }
        }
    }
}
