//! Bounds a DAG by its subtasks' priorities if nothing can delay the DAG and no other bound of it
//! is shorter.

use super::{BoundTest, BoundWitness, JobBounds};
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::intra_task::{SUBTASK_LIMIT, each_path, intra_task};
use crate::analysis::waiting::Rounding;
use crate::analysis::{SchedulabilityTest, multi_path};
use crate::order::sorted_by_key;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::IntraTask],
    covers: covers!(
        RANKED CORES PREEMPTION INTERLEAVED LATE_DEADLINES FEW_IN_FLIGHT OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    ..BoundTest::NONE
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: |case, _, dag, bound_ns, text| {
        let (id, cores) = (case.members[dag], case.set.cores);
        text.line(format_args!("bound {id} {bound_ns} priorities {cores}"));
        each_path(case.tasks[dag], |path| {
            text.list("path", path.iter().map(|&subtask| subtask as i128));
        });
    },
    ..BoundWitness::NONE
};

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    for dag in 0..case.members.len() {
        if TEST.is_for(case, dag)
            && let Some(bound_ns) = by_priorities(case, dag)
        {
            found.offer(dag, bound_ns, SchedulabilityTest::IntraTask);
        }
    }
}

fn by_priorities(case: &AnalysisInput<'_>, dag: usize) -> Option<u64> {
    let (task, cores) = (case.tasks[dag], case.settings.cores);
    let numbers = case.settings.policy.numbers(case.dag(dag));
    if numbers.len() > SUBTASK_LIMIT || !case.is_alone(dag) {
        return None;
    }
    let order = sorted_by_key(numbers.len(), |subtask| numbers[subtask]);
    let others = multi_path::alone(task, &case.set.shapes[dag].left, cores, Rounding::Up)?;
    let limit = task.relative_deadline_ns().min(task.period_ns());
    let bound = intra_task(task, &order, cores).filter(|&bound_ns| bound_ns < others);
    // No equation of this test counts long steps or a device's interrupts, so their time is added.
    let bound = bound.and_then(|bound_ns| case.set.bursts.after(bound_ns));
    bound.filter(|&bound_ns| bound_ns <= limit)
}
