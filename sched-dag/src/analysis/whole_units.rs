//! Bounds for waiting subtasks by single forms, with all times as whole units.
//!
//! A commit gets its bounds from [`answer()`](super::answer()), by the best of all forms and at any
//! instant of real time. The bounds here are separate, the way the literature compares tests: one
//! job alone by each form of `waiting`, and sets by a chosen form.

use alloc::vec::Vec;

use super::interference::InterferenceBound;
use super::multi_path::multi_path;
use super::set::EquationSet;
use super::task::Task;
use super::waiting::{ReservedChains, Rounding, lower, reserved};

/// The bounds of one job alone by each form, in whole units of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AloneBounds {
    /// The bound by one path.
    pub one_path_ns: u64,
    /// The bound by the best number of reserved chains, including none.
    pub reserved_ns: u64,
    /// The bound by several paths, with waits executed.
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

/// The forms used to bound the response times of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitingForm {
    /// One path, preemptive.
    OnePath,
    /// Any of the three forms, preemptive.
    Best,
    /// One path, with segments that keep their cores.
    NonPreemptive,
}

/// Bounds the response times under global fixed priorities, in whole units of time, with the DAGs
/// from the highest priority to the lowest. Returns `None` if there are no cores, or if a DAG has
/// no bound within its deadline and its period.
#[must_use]
pub fn waiting_fp(tasks: &[&Task], cores: u32, form: WaitingForm) -> Option<Vec<u64>> {
    in_units(tasks, cores, form)?.in_order()
}

/// Bounds the response times under global EDF, in whole units of time and in the order given, going
/// down from deadlines and periods. Returns `None` in the same cases as [`waiting_fp`].
#[must_use]
pub fn waiting_edf(tasks: &[&Task], cores: u32, form: WaitingForm) -> Option<Vec<u64>> {
    let mut set = in_units(tasks, cores, form)?;
    set.deadlines_limit = true;
    set.down_from_deadlines(&alloc::vec![None; tasks.len()], &|_, _| true)
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
        // Only covers round up: with `free - 1` added, the division that rounds down does so, too.
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
