//! Global preemptive scheduling of several DAGs, `D <= T`: response times.
//!
//! A. Melani, M. Bertogna, V. Bonifaci, A. Marchetti-Spaccamela, G. Buttazzo,
//! "Response-Time Analysis of Conditional DAG Tasks in Multiprocessor Systems",
//! ECRTS 2015, and IEEE Trans. Computers 66(2), 2017,
//! doi:10.1109/TC.2016.2584064, for DAGs without conditions:
//!
//! - fixed priority:
//!   `R_k = length + (volume - length + sum over higher i of W_i(R_k)) / m`;
//! - EDF: the same over all other `i`, with `min(W_i(R_k), WE_i)`.
//!
//! The workloads are described in this module's sibling `workload`. The width
//! refinement replaces `m` cores by the `min(m, width)` that a job can use; for
//! a chain that is the bound of Bertogna and Cirinei (RTSS 2007). It is never
//! worse.
//!
//! Assumes: preemptive, work-conserving, `D <= T` for every DAG, and for fixed
//! priorities one priority a DAG: *all* subtasks of an earlier DAG outrank all
//! of a later one (any order inside a DAG). Sporadic releases and shorter
//! execution times are covered.

use alloc::vec::Vec;

use super::refusal::Refusal;
use super::set::Set;
use super::task::Task;
use super::width::parallelism;

/// Bounds the response times under global fixed priorities, the DAGs given
/// from the highest priority to the lowest.
///
/// # Errors
///
/// [`Refusal`] if a DAG has `D > T`, or no bound within its deadline.
pub fn melani_fp(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    let all = alloc::vec![u64::from(cores); tasks.len()];
    fixed_priority(tasks, cores, &all)
}

/// As [`melani_fp`], with the width refinement.
///
/// # Errors
///
/// As [`melani_fp`].
pub fn melani_fp_width(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    fixed_priority(tasks, cores, &widths(tasks, cores))
}

/// Bounds the response times under global EDF, in the order given.
///
/// # Errors
///
/// [`Refusal`] if a DAG has `D > T`, or no bound within its deadline.
pub fn melani_edf(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    let all = alloc::vec![u64::from(cores); tasks.len()];
    edf(tasks, cores, &all)
}

/// As [`melani_edf`], with the width refinement.
///
/// # Errors
///
/// As [`melani_edf`].
pub fn melani_edf_width(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    edf(tasks, cores, &widths(tasks, cores))
}

fn fixed_priority(tasks: &[&Task], cores: u32, parallelism: &[u64]) -> Result<Vec<u64>, Refusal> {
    if !constrained(tasks, cores) {
        return Err(Refusal::DoesNotApply);
    }
    let order: Vec<usize> = (0..tasks.len()).collect();
    Set::new(tasks, cores.into(), parallelism)
        .solve(&order, |other, dag| other < dag)
        .complete()
}

fn edf(tasks: &[&Task], cores: u32, parallelism: &[u64]) -> Result<Vec<u64>, Refusal> {
    if !constrained(tasks, cores) {
        return Err(Refusal::DoesNotApply);
    }
    let order: Vec<usize> = (0..tasks.len()).collect();
    let mut set = Set::new(tasks, cores.into(), parallelism);
    set.deadlines_limit = true;
    set.solve(&order, |_, _| true).complete()
}

/// Reports whether there are cores and every DAG has `D <= T`.
pub(super) fn constrained(tasks: &[&Task], cores: u32) -> bool {
    let one = |task: &&Task| task.relative_deadline_ns() <= task.period_ns();
    cores > 0 && tasks.iter().all(one)
}

/// Returns the most cores that a job can use, by DAG.
pub(super) fn widths(tasks: &[&Task], cores: u32) -> Vec<u64> {
    tasks.iter().map(|task| parallelism(task, cores)).collect()
}
