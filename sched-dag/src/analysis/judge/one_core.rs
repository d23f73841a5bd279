//! The tests of one core, as far as a commit's attributes allow them.

use alloc::vec;
use alloc::vec::Vec;

use super::Case;
use crate::analysis::one_core::{Due, Load, Response, demand};
use crate::analysis::set::Steps;
use crate::policy::{Policy, Preemption};

/// Returns the DAGs of a case as their response times on one core need them.
pub(in crate::analysis) fn loads(case: &Case<'_>) -> Vec<Load> {
    let loads = case.tasks.iter().enumerate().map(|(dag, task)| Load {
        volume_ns: task.volume_ns(),
        period_ns: task.period_ns(),
        limit_ns: case.set.figures[dag].limit_ns(),
        priorities: case.relation.ranks(dag),
        keeps_ns: dues(case, dag)
            .iter()
            .map(|due| due.keeps_ns)
            .max()
            .unwrap_or(0),
    });
    loads.collect()
}

/// Bounds the response times of DAGs that something may delay, where all that may delay them
/// keep their own.
pub(super) fn responses(case: &Case<'_>) -> Vec<Option<u64>> {
    let loads = loads(case);
    let (loads, bursts) = (&loads, &case.set.bursts);
    let (mut steps, mut found) = (Steps::of(loads.len()), vec![None; loads.len()]);
    for &dag in &case.order {
        found[dag] = steps.spend(dag, |steps| Response::of(loads, bursts, dag).solve(steps));
    }
    let known = (0..loads.len()).map(|dag| {
        let others = Response::of(loads, bursts, dag).others;
        let are_known = others.iter().all(|&other| found[other].is_some());
        found[dag].filter(|_| are_known && !case.is_alone(dag))
    });
    known.collect()
}

/// Reports whether each subtask is finished by its deadline, under EDF.
pub(in crate::analysis) fn are_in_time(case: &Case<'_>) -> bool {
    let fit =
        |dag: usize| case.set.figures[dag].limit_ns() == case.tasks[dag].relative_deadline_ns();
    let applies = case.settings.cores == 1 && case.settings.policy == Policy::Edf;
    applies && (0..case.tasks.len()).all(fit) && demand(&all_dues(case), &case.set.bursts).is_some()
}

/// Returns what is due of all DAGs.
pub(in crate::analysis) fn all_dues(case: &Case<'_>) -> Vec<Due> {
    (0..case.tasks.len())
        .flat_map(|dag| dues(case, dag))
        .collect()
}

/// Returns what is due of a DAG, by deadlines.
fn dues(case: &Case<'_>, dag: usize) -> Vec<Due> {
    let (task, subtasks) = (case.tasks[dag], case.dag(dag).subtasks());
    let mut dues: Vec<Due> = Vec::new();
    for (subtask, &wcet_ns) in subtasks.iter().zip(task.wcets_ns()) {
        let deadline_ns = subtask.relative_deadline_ns();
        let known = dues.iter().position(|due| due.deadline_ns == deadline_ns);
        let place = known.unwrap_or(dues.len());
        if known.is_none() {
            dues.push(Due {
                deadline_ns,
                period_ns: task.period_ns(),
                volume_ns: 0,
                keeps_ns: 0,
            });
        }
        let due = &mut dues[place];
        due.volume_ns += wcet_ns;
        if subtask.is_non_preemptive() || case.settings.preemption == Preemption::Disabled {
            due.keeps_ns = due.keeps_ns.max(wcet_ns);
        }
    }
    dues
}
