//! Speed-up based tests: global EDF and DM, any deadlines.
//!
//! V. Bonifaci, A. Marchetti-Spaccamela, S. Stiller, A. Wiese, "Feasibility
//! Analysis in the Sporadic DAG Task Model", ECRTS 2013,
//! doi:10.1109/ECRTS.2013.32:
//!
//! - EDF (Theorem 21): each length at most `D / 3` and the sum of
//!   `volume / min(T, D)` at most `(m + 1/2) / 3`;
//! - DM (Theorem 22): `D / 5` and `(m + 1/4) / 5`; if `D <= T` for every DAG
//!   (Theorem 23): `D / 4` and `(m + 1/3) / 4`.
//!
//! Assumes: preemptive; for DM priorities by relative deadline, one a DAG. The
//! theorems let jobs of one subtask run side by side; here a subtask is
//! sequential over its own jobs. With `D <= T` an accepted set never has two
//! jobs of a DAG at once, so that is the same; with `D > T` it is not proven
//! for this model, and the verdict at commit does not use it there.

use super::ratio::Ratio;
use super::task::Task;

/// Tests global EDF (Theorem 21).
#[must_use]
pub fn bonifaci_edf(tasks: &[&Task], cores: u32) -> bool {
    accepts(tasks, 3, 2 * u128::from(cores) + 1, 6)
}

/// Tests global DM (Theorem 23 if `D <= T` for every DAG, else Theorem 22).
#[must_use]
pub fn bonifaci_dm(tasks: &[&Task], cores: u32) -> bool {
    let m = u128::from(cores);
    if super::set::constrained(tasks, cores) {
        accepts(tasks, 4, 3 * m + 1, 12)
    } else {
        accepts(tasks, 5, 4 * m + 1, 20)
    }
}

fn accepts(tasks: &[&Task], part: u128, numerator: u128, denominator: u128) -> bool {
    let short = |task: &&Task| {
        part * u128::from(task.length_ns()) <= u128::from(task.relative_deadline_ns())
    };
    let density = |task: &&Task| {
        let shorter = task.period_ns().min(task.relative_deadline_ns());
        (task.volume_ns(), shorter)
    };
    tasks.iter().all(short)
        && Ratio::sum(tasks.iter().map(density))
            .is_some_and(|sum| sum.at_most(numerator, denominator))
}

#[cfg(test)]
mod tests {
    use super::{bonifaci_dm, bonifaci_edf};
    use crate::analysis::Task;

    #[test]
    fn limits_are_inclusive() {
        // m = 1: EDF accepts density 1/2 and length D/3 exactly.
        let task =
            |wcets: Vec<u64>, period, deadline| Task::new(period, deadline, wcets, &[]).unwrap();
        assert!(bonifaci_edf(&[&task(vec![2, 1], 6, 6)], 1));
        assert!(!bonifaci_edf(&[&task(vec![2, 2], 6, 6)], 1));
        assert!(!bonifaci_edf(&[&task(vec![3], 6, 6)], 1));
        // DM, m = 1: density 1/3 with D <= T, 1/4 otherwise.
        assert!(bonifaci_dm(&[&task(vec![2, 2], 12, 12)], 1));
        assert!(!bonifaci_dm(&[&task(vec![2, 2], 12, 13)], 1));
        assert!(bonifaci_dm(&[&task(vec![2, 1], 12, 13)], 1));
    }
}
