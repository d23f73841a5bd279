//! One DAG alone, with priorities for its subtasks.
//!
//! Q. He, X. Jiang, N. Guan, Z. Guo, "Intra-Task Priority Assignment in
//! Real-Time Scheduling of DAG Tasks on Multi-Cores", IEEE TPDS 30(10), 2019.
//! Let `I(v)` be the subtasks parallel to `v` of higher priority. Then
//! `R = max over complete paths p of len(p) + c(union of I(v) over p, less p) / m`.
//!
//! Assumes: preemptive, one job alone on `m` cores, and priorities that respect precedence (a
//! predecessor has the higher priority).
//!
//! Trap: published code carries a single "best" path per subtask through the graph. This is unsafe,
//! because the union is not additive: in example E5 the result is 63, while a schedule of 64
//! exists. So paths are enumerated, up to [`PATH_LIMIT`]; beyond, callers use the multi-path bound.
//!
//! Two subtasks are *parallel* if neither reaches the other. The transitive closure answers such
//! questions, with one bit row a subtask. The closure takes `n * n / 8` bytes and `edges * n / 64`
//! word operations, so it is only built up to [`SUBTASK_LIMIT`] subtasks (128 KiB).

use alloc::vec;
use alloc::vec::Vec;

use super::task::Task;

/// The most complete paths enumerated by [`intra_task`]: 4,096.
pub const PATH_LIMIT: u32 = 4096;

/// Bounds the response time of one job alone, with its subtasks ordered by descending priority.
///
/// Returns `None` if the test does not apply (no cores, waits, or an `order` that does not name
/// each subtask once or contradicts precedence) or takes too long (more than [`PATH_LIMIT`] paths
/// or [`SUBTASK_LIMIT`] subtasks).
pub fn intra_task(task: &Task, order: &[usize], cores: u32) -> Option<u64> {
    let count = task.subtask_count();
    let ranks = ranks(task, order)?;
    if cores == 0 || task.has_waits() || paths(task) > PATH_LIMIT {
        return None;
    }
    let words = count.div_ceil(64);
    let successors = successors(task, words)?;
    let precedes = |u: usize, v: usize| contains(&successors[u * words..], v);
    let interferes = |v: usize, u: usize| ranks[u] < ranks[v] && !precedes(u, v) && !precedes(v, u);
    let mut interfering = vec![0_u64; words * count];
    for v in 0..count {
        for u in (0..count).filter(|&u| interferes(v, u)) {
            insert(&mut interfering[v * words..], u);
        }
    }
    let wcets = task.wcets_ns();
    let mut bound = 0;
    each_path(task, |path| {
        let mut union = vec![0_u64; words];
        for v in path {
            let row = &interfering[v * words..(v + 1) * words];
            union.iter_mut().zip(row).for_each(|(all, row)| *all |= row);
        }
        // A path's own subtasks are already in its length.
        path.iter().for_each(|&v| remove(&mut union, v));
        let beside = (0..count).filter(|&v| contains(&union, v));
        let beside: u64 = beside.map(|v| wcets[v]).sum();
        let length: u64 = path.iter().map(|&v| wcets[v]).sum();
        bound = bound.max(length + beside.div_ceil(u64::from(cores)));
    });
    Some(bound)
}

/// Visits each path from a source to a sink, in the order of the subtasks' positions.
pub(super) fn each_path(task: &Task, mut visit: impl FnMut(&[usize])) {
    for source in task.sources() {
        // The path so far, and for each of its subtasks the untried successors.
        let (mut path, mut untried) = (vec![source], vec![task.successors(source)]);
        while let (Some(&last), Some(successors)) = (path.last(), untried.last_mut()) {
            if let Some(next) = successors.next() {
                path.push(next);
                untried.push(task.successors(next));
                continue;
            }
            if task.successors(last).len() == 0 {
                visit(&path);
            }
            path.pop();
            untried.pop();
        }
    }
}

/// Returns the number of complete paths, at most `u32::MAX`.
fn paths(task: &Task) -> u32 {
    let count = task.subtask_count();
    let mut onward = vec![0_u32; count];
    for v in task.topological_order().rev() {
        let successors = task.successors(v);
        let sum = successors.fold(0_u32, |sum, next| sum.saturating_add(onward[next]));
        onward[v] = sum.max(1);
    }
    task.sources()
        .fold(0, |sum, v| sum.saturating_add(onward[v]))
}

/// Returns each subtask's place in `order`, if `order` is a permutation and respects precedence.
fn ranks(task: &Task, order: &[usize]) -> Option<Vec<usize>> {
    let count = task.subtask_count();
    let mut ranks = vec![usize::MAX; count];
    for (rank, &v) in order.iter().enumerate() {
        *ranks.get_mut(v)? = rank;
    }
    let complete = order.len() == count && !ranks.contains(&usize::MAX);
    let respects = |v: usize| task.successors(v).all(|next| ranks[v] < ranks[next]);
    (complete && (0..count).all(respects)).then_some(ranks)
}

/// The most subtasks of a DAG for which the closure is built: 1,024.
///
/// Beyond, intra-task priorities are not used. The limit keeps a commit's time near linear and its
/// temporary memory small.
pub const SUBTASK_LIMIT: usize = 1024;

/// Returns for each subtask the set of all later subtasks, reached directly or not, in `words`
/// words; `None` beyond [`SUBTASK_LIMIT`].
fn successors(task: &Task, words: usize) -> Option<Vec<u64>> {
    let count = task.subtask_count();
    let mut sets = (count <= SUBTASK_LIMIT).then(|| vec![0; words * count])?;
    for subtask in task.topological_order().rev() {
        for successor in task.successors(subtask) {
            for word in 0..words {
                sets[subtask * words + word] |= sets[successor * words + word];
            }
            insert(&mut sets[subtask * words..], successor);
        }
    }
    Some(sets)
}

/// Adds an element to a bit set.
fn insert(set: &mut [u64], element: usize) {
    set[element / 64] |= 1 << (element % 64);
}

/// Removes an element from a bit set.
fn remove(set: &mut [u64], element: usize) {
    set[element / 64] &= !(1 << (element % 64));
}

/// Reports whether a bit set has an element.
fn contains(set: &[u64], element: usize) -> bool {
    set[element / 64] >> (element % 64) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::intra_task;
    use crate::analysis::Task;

    #[test]
    fn too_many_paths_are_counted_not_walked() {
        // Diamonds in a row: each doubles the number of paths.
        let row = |diamonds: usize| {
            let edges: Vec<(usize, usize)> = (0..diamonds)
                .flat_map(|at| {
                    [(0, 1), (0, 2), (1, 3), (2, 3)].map(|(a, b)| (3 * at + a, 3 * at + b))
                })
                .collect();
            Task::new(999, 999, vec![1; 3 * diamonds + 1], &edges).unwrap()
        };
        let order: Vec<usize> = (0..400).collect();
        assert_eq!(intra_task(&row(12), &order[..37], 2), Some(31));
        assert_eq!(intra_task(&row(13), &order[..40], 2), None);
        assert_eq!(intra_task(&row(100), &order[..301], 2), None);
    }

    #[test]
    fn orders_against_precedence_do_not_apply() {
        let task = Task::new(9, 9, vec![1, 1], &[(0, 1)]).unwrap();
        assert_eq!(intra_task(&task, &[1, 0], 2), None);
        assert_eq!(intra_task(&task, &[0, 0], 2), None);
        assert_eq!(intra_task(&task, &[0, 1], 0), None);
        assert_eq!(intra_task(&task, &[0, 1], 2), Some(2));
    }
}
