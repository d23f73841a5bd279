//! The multi-path bound for whole sets: the tests that take or refuse a set at once.
//!
//! They are what the literature compares; a commit asks [`answer()`](super::answer()), which
//! judges each DAG on its own account.

use alloc::vec::Vec;

use super::interference::Clip;
use super::pipelined::Unsolved;
use super::set::{Set, constrained};
use super::task::Task;
use crate::worded::texts;

texts! {
    /// Why a sufficient test did not prove a set of DAGs schedulable.
    ///
    /// None of these says that the set is infeasible. DAGs are named by their position.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Refusal {
        /// The set is outside the test's assumptions: there are no cores, or a
        /// deadline or priority is not of the kind the test is about.
        DoesNotApply = "the test does not apply to these DAGs";
        /// This DAG has no bound within its relative deadline.
        Fails { position: usize } =
            "dag {position} has no bound within its relative deadline; give it more time, more \
             cores or less interference";
        /// The computation reached a limit on steps, on jobs in flight or on the
        /// size of numbers, at this DAG.
        Limit { position: usize } =
            "the analysis of dag {position} reached a limit; shorten its deadline in periods or \
             use a coarser unit of time";
    }
}

impl core::error::Error for Refusal {}

impl Unsolved {
    /// Names the DAG whose equation has no usable solution.
    pub(super) const fn at(self, position: usize) -> Refusal {
        match self {
            Self::BeyondDeadline => Refusal::Fails { position },
            Self::Limit => Refusal::Limit { position },
        }
    }
}

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
