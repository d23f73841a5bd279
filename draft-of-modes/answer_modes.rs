//! Modes: DAGs that never run together delay each other only while the mode changes.
//!
//! In a mode the DAGs of other modes release nothing. So the set of those that run is analysed by
//! itself, without the others. What that proves holds for a machine that has always been in the
//! mode, and from the first instant on at which, since the mode was entered, nothing at all was in
//! flight: from there on the schedule is one of this set alone, of releases that are at least a
//! period apart.
//!
//! *While a mode changes* it does not hold. A job may wait for one of the old mode and then for one
//! of the new, and each mode counts only one of them (J. Real and A. Crespo, Mode Change
//! Protocols for Real-Time Systems, 2004, doi:10.1023/B:TIME.0000016129.97430.c6). What holds at
//! all times is the bound of all DAGs together, which [`answer`] gives: pauses only make
//! releases fewer.

use alloc::vec::Vec;

use super::answer::{Answer, DagBound, Settings};
use super::judge::answer_among;
use crate::ids::DagId;
use crate::task_set::TaskSet;

/// Returns for each DAG the longest of the bounds that it has in its modes, each analysed by
/// itself; `None` if it has none in one of them. `modes` are the DAGs of each; a DAG that is in
/// no mode runs in all.
#[must_use]
pub fn answer_in_modes(
    task_set: &TaskSet,
    settings: &Settings,
    modes: &[Vec<DagId>],
) -> Vec<Option<DagBound>> {
    let in_none = |dag: DagId| !modes.iter().any(|mode| mode.contains(&dag));
    let answers: Vec<Answer> = modes
        .iter()
        .map(|mode| answer_among(task_set, settings, |dag| mode.contains(&dag) || in_none(dag)))
        .collect();
    let dags = (0..).map(DagId).take(task_set.dags().len());
    let longest = dags.map(|dag| {
        let of_dag = modes.iter().zip(&answers);
        let of_dag = of_dag.filter(|(mode, _)| mode.contains(&dag) || in_none(dag));
        let mut bounds = of_dag.map(|(_, answer)| answer.bounds[dag.index()]);
        let first = bounds.next()??;
        bounds.try_fold(first, |longest, bound| {
            let bound = bound?;
            Some(if bound.bound_ns > longest.bound_ns { bound } else { longest })
        })
    });
    longest.collect()
}
