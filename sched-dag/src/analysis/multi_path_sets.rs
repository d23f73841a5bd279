//! The multi-path bound for whole sets: the tests that take or refuse a set at once.
//!
//! They are what the literature compares; a commit asks [`answer()`](super::answer()), which
//! judges each DAG on its own account.

use alloc::vec::Vec;

use super::interference::Clip;
use super::pipelined::Refusal;
use super::set::{Set, constrained};
use super::task::Task;

/// Bounds the response times under global fixed priorities, the DAGs given from the highest
/// priority to the lowest; also of jobs that overlap.
///
/// # Errors
///
/// [`Refusal`] if there is no core, or a DAG has no bound within its deadline.
pub fn multi_path_fp(tasks: &[&Task], cores: u32, clip: Clip) -> Result<Vec<u64>, Refusal> {
    if cores == 0 {
        return Err(Refusal::DoesNotApply);
    }
    let mut set = Set::new(tasks, cores);
    set.clip = clip;
    let order: Vec<usize> = (0..tasks.len()).collect();
    set.solve(&order, |other, dag| other < dag).complete()
}

/// Bounds the response times under global EDF, in the order given: down from the
/// deadlines, so it accepts a little less than [`answer()`](super::answer()).
///
/// # Errors
///
/// [`Refusal`] if a DAG has `D > T`, or no bound within its deadline.
pub fn multi_path_edf(tasks: &[&Task], cores: u32, clip: Clip) -> Result<Vec<u64>, Refusal> {
    if !constrained(tasks, cores) {
        return Err(Refusal::DoesNotApply);
    }
    let mut set = Set::new(tasks, cores);
    set.clip = clip;
    set.deadlines_limit = true;
    set.down_from_deadlines(|_, _| true)
        .map_err(|(position, why)| why.at(position))
}

#[cfg(test)]
mod tests {
    use super::{Clip, multi_path_fp};
    use crate::analysis::Task;

    #[test]
    fn nothing_beside_the_chains_is_not_nothing_to_wait_for() {
        let high = Task::new(100, 100, vec![3, 3], &[]).unwrap();
        let low = Task::new(100, 100, vec![5], &[]).unwrap();
        for clip in [Clip::Window, Clip::Waiting, Clip::Chains] {
            assert_eq!(multi_path_fp(&[&high, &low], 2, clip), Ok(vec![3, 8]));
        }
    }

    #[test]
    fn interference_counts_only_while_the_job_waits() {
        // One of two cores is always free for the chain, so at most 2 of the 9 matter.
        let long = Task::new(100, 100, vec![9, 2], &[]).unwrap();
        let low = Task::new(100, 100, vec![4, 4], &[(0, 1)]).unwrap();
        let bounds = |clip| multi_path_fp(&[&long, &low], 2, clip).unwrap()[1];
        assert_eq!((bounds(Clip::Window), bounds(Clip::Chains)), (14, 11));
    }
}
