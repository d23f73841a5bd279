//! Subtasks that keep their core once started ("limited preemption"): a safe
//! form, derived for this project.
//!
//! `R_k = length + (volume - length + sum of W_i(R_k) + Delta(m) +
//! (N - 1) Delta(m - 1)) / m`, with `Delta(x)` the sum of the `x` largest
//! lower-ranked subtasks of other DAGs and `N` the most subtasks on a path of
//! DAG `k`.
//!
//! Why: while a subtask of the critical chain waits, nothing lower starts. What
//! lower-ranked work it finds was started before it became ready: on at most
//! `m` cores for the chain's first subtask, on at most `m - 1` for a later one,
//! because the core of its predecessor has just become free. A subtask never
//! overlaps with itself, so the `x` running ones are different subtasks.
//!
//! Trap: the published LP-max bound (M. A. Serrano et al., "Response-Time
//! Analysis of DAG Tasks under Fixed Priority Scheduling with Limited
//! Preemptions", DATE 2016) counts blocking after the first subtask only for
//! preemptions by higher-priority work. But a DAG's own serial phases leave
//! cores idle, and those admit new lower-priority subtasks without anybody
//! being preempted: in the unit test below that gives 10 and 11 is observed.
//!
//! Under EDF any other DAG's job may have the later deadline, so `Delta` is
//! over all other DAGs, and the workloads are those of EDF.
//!
//! Assumes: *no* subtask of any DAG is ever preempted; work-conserving;
//! `D <= T`; for fixed priorities one priority a DAG.

use alloc::vec::Vec;

use super::melani::{constrained, widths};
use super::refusal::Refusal;
use super::response::Blocking;
use super::set::Set;
use super::task::Task;

/// Bounds the response times of non-preemptive subtasks under global fixed
/// priorities, the DAGs given from the highest priority to the lowest.
///
/// # Errors
///
/// [`Refusal`] if a DAG has `D > T`, or no bound within its deadline.
pub fn np_safe_fp(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    let all = alloc::vec![u64::from(cores); tasks.len()];
    bound(tasks, cores, &all, false)
}

/// As [`np_safe_fp`], with the width refinement of the workloads.
///
/// # Errors
///
/// As [`np_safe_fp`].
pub fn np_safe_fp_width(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    bound(tasks, cores, &widths(tasks, cores), false)
}

/// Bounds the response times of non-preemptive subtasks under global EDF, with
/// the width refinement, in the order given.
///
/// # Errors
///
/// As [`np_safe_fp`].
pub fn np_safe_edf(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    bound(tasks, cores, &widths(tasks, cores), true)
}

fn bound(tasks: &[&Task], cores: u32, parallelism: &[u64], edf: bool) -> Result<Vec<u64>, Refusal> {
    if !constrained(tasks, cores) {
        return Err(Refusal::DoesNotApply);
    }
    let mut set = Set::new(tasks, cores.into(), parallelism);
    set.deadlines_limit = edf;
    for (dag, figures) in set.figures.iter_mut().enumerate() {
        let lower = tasks.iter().enumerate();
        let lower = lower.filter(|&(other, _)| if edf { other != dag } else { other > dag });
        let wcets = lower.flat_map(|(_, task)| task.wcets_ns().iter().copied());
        figures.blocking = Blocking::by(wcets.collect(), cores, tasks[dag]);
    }
    let order: Vec<usize> = (0..tasks.len()).collect();
    set.solve(&order, |other, dag| edf || other < dag)
        .complete()
}

impl Blocking {
    /// Returns what subtasks of these WCETs can block of `task`.
    pub(super) fn by(mut wcets_ns: Vec<u64>, cores: u32, task: &Task) -> Self {
        let cores = usize::try_from(cores).unwrap_or(usize::MAX);
        if cores < wcets_ns.len() {
            wcets_ns.select_nth_unstable_by_key(cores, |&wcet| core::cmp::Reverse(wcet));
            wcets_ns.truncate(cores);
        }
        let sum: u128 = wcets_ns.iter().map(|&wcet| u128::from(wcet)).sum();
        // The least of m blocking subtasks is not among the m - 1 largest.
        let least = if wcets_ns.len() < cores {
            0
        } else {
            wcets_ns.iter().copied().min().unwrap_or(0)
        };
        Self {
            first: sum,
            later: sum - u128::from(least),
            chain: task.most_subtasks_on_a_path().into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{np_safe_edf, np_safe_fp};
    use crate::analysis::Task;

    #[test]
    fn e4_blocking_without_any_preemption() {
        let diamond = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let high = Task::new(100, 100, vec![1, 3, 3, 1], &diamond).unwrap();
        let fork = (1..6).flat_map(|v| [(0, v), (v, 6)]).collect::<Vec<_>>();
        let low = Task::new(100, 100, vec![1, 4, 4, 4, 4, 4, 1], &fork).unwrap();
        let bounds = np_safe_fp(&[&high, &low], 2).unwrap();
        assert_eq!(bounds[0], 14);
        assert!(np_safe_edf(&[&high, &low], 2).unwrap()[0] >= 14);
    }
}
