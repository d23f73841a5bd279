//! Jobs that overlap: relative deadlines beyond the period.
//!
//! Global preemptive fixed priorities, one priority a DAG; each subtask is
//! sequential over its own jobs, and the older job wins. Derived for this
//! project; related work (J. Fonseca, G. Nelissen, V. Nélis, Real-Time Systems
//! 55, 2019) has arbitrary deadlines without the own-job rule. The equation and
//! its terms are explained in this module's sibling `response`.
//!
//! Words: the critical chain *crosses* a release if it comes from the same
//! subtask's job before.
//!
//! [`pipelined_fp`] follows the chain back over as many releases as it can
//! cross: to cross the `j`-th, its part since the first must be able to last
//! until then. A set is accepted only when that ends.
//!
//! Traps, both found in an earlier form:
//!
//! 1. To follow the chain back only over the jobs that the job itself can meet
//!    (`j T < R`). But each job may delay only the next, and a delay still be
//!    handed on forever: a subtask with a WCET of one period never catches up.
//!    In the test `delays_handed_on_are_counted` that would claim 18 where
//!    observed response times grow without end.
//! 2. To take another DAG to use no more cores than one of its jobs can, also
//!    when its jobs overlap. In the test `overlapping_jobs_stack` that would
//!    claim 8, and 9 is observed.
//!
//! With `D <= T` this is [`melani_fp_width`](super::melani_fp_width).

use alloc::vec::Vec;

use super::melani::widths;
use super::refusal::Refusal;
use super::set::Set;
use super::task::Task;

/// Bounds the response times under global fixed priorities with any deadlines,
/// the DAGs given from the highest priority to the lowest.
///
/// # Errors
///
/// [`Refusal`] if there is no core, or a DAG has no bound within its deadline.
pub fn pipelined_fp(tasks: &[&Task], cores: u32) -> Result<Vec<u64>, Refusal> {
    if cores == 0 {
        return Err(Refusal::DoesNotApply);
    }
    let widths = widths(tasks, cores);
    let set = Set::new(tasks, cores.into(), &widths);
    for (position, task) in tasks.iter().enumerate() {
        if u128::from(task.volume_ns()) > u128::from(cores) * u128::from(task.period_ns()) {
            return Err(Refusal::Fails { position });
        }
    }
    let order: Vec<usize> = (0..tasks.len()).collect();
    set.solve(&order, |other, dag| other < dag).complete()
}

#[cfg(test)]
mod tests {
    use super::pipelined_fp;
    use crate::analysis::{Refusal, Task};

    #[test]
    fn e8_two_pipelines() {
        let chain = Task::new(10, 30, vec![4, 5, 3], &[(0, 1), (1, 2)]).unwrap();
        let diamond = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let other = Task::new(25, 50, vec![1, 3, 3, 1], &diamond).unwrap();
        assert_eq!(pipelined_fp(&[&chain, &other], 3), Ok(vec![12, 14]));
    }

    #[test]
    fn overlapping_jobs_stack() {
        // Two of the chain's jobs run for 8 of each 10: then two of four cores
        // are left, on which six subtasks of 3 take 9.
        let edges = [(0, 1), (1, 2)];
        let chain = Task::new(10, 30, vec![6, 6, 6], &edges).unwrap();
        let wide = Task::new(100, 60, vec![3; 6], &[]).unwrap();
        let bounds = pipelined_fp(&[&chain, &wide], 4).unwrap();
        assert!(bounds[1] >= 9, "{bounds:?}");
    }

    #[test]
    fn delays_handed_on_are_counted() {
        // Once a period of 1000 all four cores are busy for 5. Each time, the
        // second subtask below falls behind by 5, and can never catch up.
        let burst = Task::new(1000, 1000, vec![5; 4], &[]).unwrap();
        let full = Task::new(10, 30, vec![1, 10], &[(0, 1)]).unwrap();
        let refusal = pipelined_fp(&[&burst, &full], 4);
        assert_eq!(refusal, Err(Refusal::Fails { position: 1 }));
        // With one unit of slack a period it does catch up.
        let slack = Task::new(10, 30, vec![1, 9], &[(0, 1)]).unwrap();
        assert!(pipelined_fp(&[&burst, &slack], 4).is_ok());
    }
}
