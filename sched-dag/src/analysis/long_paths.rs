//! The long-paths bound: one DAG, dedicated cores, never worse than Graham's.
//!
//! Q. He, N. Guan, M. Lv, X. Jiang, W. Chang, "Bounding the Response Time of
//! DAG Tasks Using Long Paths", RTSS 2022 (arXiv:2211.08800). Path 0 is a
//! longest path; path `j` is a longest one when the subtasks of the earlier
//! paths weigh nothing. While the critical path waits, `j` other paths occupy
//! at most `j` of the `m` busy cores, so
//! `R = min over j < m of length + (volume - paths 0..=j) / (m - j)`.
//!
//! Assumes what Graham's bound assumes: work-conserving, one job alone. Any
//! prefix of the minimum is a valid bound, which is how the time is limited:
//! each path costs one walk of the graph, so [`long_paths`] takes
//! `O(min(m, subtasks) * (subtasks + edges))`.

use alloc::vec::Vec;

use super::task::Task;

/// Returns the long-paths bound on the response time of one job alone on
/// `cores` cores, or `None` without cores.
#[must_use]
pub fn long_paths(task: &Task, cores: u32) -> Option<u64> {
    long_paths_among(task, cores, usize::MAX)
}

/// Returns the bound from at most `paths` paths (the first is free of charge:
/// with one it is Graham's bound), or `None` without cores.
#[must_use]
pub fn long_paths_among(task: &Task, cores: u32, paths: usize) -> Option<u64> {
    let cores = u64::from(cores);
    let mut weights = Vec::from(task.wcets_ns());
    let mut rest = task.volume_ns() - task.length_ns();
    let mut best = rest.checked_div(cores)?;
    take_longest(task, &mut weights);
    for beside in (1..cores).take(paths.saturating_sub(1)) {
        if rest == 0 || best == 0 {
            break;
        }
        rest -= take_longest(task, &mut weights);
        best = best.min(rest / (cores - beside));
    }
    Some(task.length_ns() + best)
}

/// Returns the weights of the long paths, longest first, until none is left.
#[must_use]
pub fn path_list(task: &Task) -> Vec<u64> {
    let mut weights = Vec::from(task.wcets_ns());
    let mut list = Vec::new();
    loop {
        match take_longest(task, &mut weights) {
            0 => return list,
            weight => list.push(weight),
        }
    }
}

/// Sets the weights along a longest path to 0 and returns their sum.
fn take_longest(task: &Task, weights: &mut [u64]) -> u64 {
    let mut sum = 0;
    for subtask in task.longest_path(weights) {
        sum += core::mem::take(&mut weights[subtask]);
    }
    sum
}
