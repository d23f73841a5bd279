//! Bounds of subtasks that wait by single forms, where all times are whole units.
//!
//! The bounds of a commit are those of [`answer()`](super::answer()): by the best of all forms,
//! at any instant of real time. These here stand for themselves, as the literature compares
//! tests: one job alone by each form of `waiting`, and sets by one of them.

use alloc::vec::Vec;

use super::interference::InterferenceBound;
use super::multi_path::multi_path;
use super::set::EquationSet;
use super::task::Task;
use super::waiting::{ReservedChains, Rounding, lower, reserved};

/// The bounds of one job alone by each form, in whole units of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AloneBounds {
    /// By one path.
    pub one_path_ns: u64,
    /// By the best number of reserved chains, none among them.
    pub reserved_ns: u64,
    /// By several paths, with waits that are executed.
    pub oblivious_ns: u64,
}

/// Bounds the response time of one job alone by each form; `None` without cores.
#[must_use]
pub fn alone_forms(task: &Task, cores: u32) -> Option<AloneBounds> {
    let waiting = |with: &ReservedChains| with.left / with.free;
    let reserved = reserved(task, cores);
    let bound = |waiting: u128| task.span_ns().checked_add(u64::try_from(waiting).ok()?);
    Some(AloneBounds {
        one_path_ns: bound(reserved.first().map(waiting)?)?,
        reserved_ns: bound(reserved.iter().map(waiting).min()?)?,
        oblivious_ns: multi_path(task.oblivious(), cores)?,
    })
}

/// Which forms bound the response times of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitingForm {
    /// One path, preemptive.
    OnePath,
    /// Any of the three forms, preemptive.
    Best,
    /// One path, with segments that keep their cores.
    NonPreemptive,
}

/// Bounds the response times under global fixed priorities, in whole units of time, the DAGs given
/// from the highest priority to the lowest. `None` if there is no core, or a DAG has no bound
/// within its deadline and its period.
#[must_use]
pub fn waiting_fp(tasks: &[&Task], cores: u32, form: WaitingForm) -> Option<Vec<u64>> {
    let set = in_units(tasks, cores, form)?;
    let order: Vec<usize> = (0..tasks.len()).collect();
    let solution = set.solve(&alloc::vec![None; tasks.len()], &order, |other, dag| {
        other < dag
    });
    solution.responses.into_iter().collect()
}

/// Bounds the response times under global EDF, in whole units of time and in the order given: down
/// from deadlines and periods. `None` as [`waiting_fp`].
#[must_use]
pub fn waiting_edf(tasks: &[&Task], cores: u32, form: WaitingForm) -> Option<Vec<u64>> {
    let mut set = in_units(tasks, cores, form)?;
    set.deadlines_limit = true;
    set.down_from_deadlines(&alloc::vec![None; tasks.len()], |_, _| true)
}

fn in_units<'a>(tasks: &'a [&Task], cores: u32, form: WaitingForm) -> Option<EquationSet<'a>> {
    let mut set = (cores > 0).then(|| EquationSet::new(tasks, cores))?;
    (set.rounding, set.is_of_waits) = (Rounding::Down, true);
    set.keep_cores = form == WaitingForm::NonPreemptive;
    set.clip = match form {
        WaitingForm::Best => InterferenceBound::Waiting,
        WaitingForm::OnePath | WaitingForm::NonPreemptive => InterferenceBound::Window,
    };
    for ((task, shape), figures) in (tasks.iter()).zip(&mut set.shapes).zip(&mut set.figures) {
        figures.allow_in_flight(1);
        // Only covers round up, so that they count as less than a core more.
        let by_covers = shape.left.iter_mut();
        (1..=u64::from(cores))
            .rev()
            .zip(by_covers)
            .for_each(|(free, left)| *left = left.saturating_add(free - 1));
        lower(&mut shape.left, &reserved(task, cores));
        if form != WaitingForm::Best {
            shape.left.truncate(1);
        }
    }
    Some(set)
}

#[cfg(test)]
mod tests {
    use super::{AloneBounds, WaitingForm, alone_forms, waiting_edf, waiting_fp};
    use crate::analysis::{SubtaskWaits, Task, multi_path};

    /// A task of subtasks with segments and the limits between them, in turn.
    fn task(period: u64, deadline: u64, subtasks: &[&[u64]], edges: &[(usize, usize)]) -> Task {
        let segments = |times: &'_ &[u64]| times.iter().copied().step_by(2).collect::<Vec<_>>();
        let waits = subtasks.iter().map(|times| SubtaskWaits {
            count: u32::try_from(times.len() / 2).unwrap(),
            limits_ns: times.iter().skip(1).step_by(2).sum(),
            longest_segment_ns: segments(times).into_iter().max().unwrap(),
        });
        let wcets = subtasks.iter().map(|times| segments(times).iter().sum());
        let task = Task::new(period, deadline, wcets.collect(), edges).unwrap();
        task.with_waits(waits.collect()).unwrap()
    }

    #[test]
    fn each_form_has_its_own_bound_of_a_job_alone() {
        let edges = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let one = task(99, 99, &[&[1], &[3, 4, 1], &[5], &[1]], &edges);
        let bounds = AloneBounds {
            one_path_ns: 12,
            reserved_ns: 11,
            oblivious_ns: 10,
        };
        assert_eq!((one.span_ns(), one.length_ns()), (10, 7));
        assert_eq!(alone_forms(&one, 2), Some(bounds));
        // At any instant of real time: the least of 12.5, 11 and 10, rounded up.
        assert_eq!(multi_path(&one, 2), Some(10));
        assert_eq!((alone_forms(&one, 0), multi_path(&one, 0)), (None, None));
    }

    #[test]
    fn real_time_rounds_up() {
        let one = task(99, 99, &[&[1, 9, 1], &[2], &[3]], &[]);
        // Two cores: max_P of 11 + (7 - 2) / 2, and 11 + (7 - 5) / 1 with one chain reserved.
        assert_eq!(alone_forms(&one, 2).unwrap().one_path_ns, 13);
        assert_eq!(alone_forms(&one, 2).unwrap().reserved_ns, 13);
        assert_eq!(multi_path(&one, 2), Some(13));
    }

    #[test]
    fn each_wait_may_be_blocked_again() {
        // E4: two cores, no wait; blocked at the release by two and at each end by one.
        let high = task(100, 100, &[&[1], &[1], &[1]], &[(0, 1), (1, 2)]);
        let low = task(100, 100, &[&[3], &[3], &[2]], &[]);
        let bounds = |high: &Task| waiting_fp(&[high, &low], 2, WaitingForm::NonPreemptive);
        let of_e4 = bounds(&high).unwrap()[0];
        let waiting = task(100, 100, &[&[1], &[1, 0, 1], &[1]], &[(0, 1), (1, 2)]);
        // One more unit of execution, and two lower ones after the wait.
        let with_wait = bounds(&waiting).unwrap()[0];
        assert_eq!((of_e4, with_wait), (9, 13));
    }

    #[test]
    fn later_deadlines_alone_do_not_bound_the_blocking_under_edf() {
        let waiting = task(40, 21, &[&[1, 8, 1], &[1]], &[(1, 0)]);
        let short = task(12, 20, &[&[3]], &[]);
        let bounds = waiting_edf(&[&waiting, &short], 1, WaitingForm::NonPreemptive);
        assert_eq!(bounds.unwrap()[0], 20);
    }
}
