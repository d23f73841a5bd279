//! Response times of DAGs in tables, by the entries' times.
//!
//! In a table that is *right* ([`check_table`](crate::analysis::check_table)), no entry finishes
//! later than its time, whatever other DAGs do and whatever the policy is. So a bound is the latest
//! finish after a release. The proof is in `docs/bounds.md`, "Tables".
//!
//! A table of one DAG begins a lap with each job. Where no entry belongs to another lap's job, the
//! DAG may be sporadic. Then long steps and a device's interrupts (bursts, in `workload`) are
//! covered, too, as long as the job ends by its deadline and the next release: each entry is late
//! by no more than they take. In a table of several DAGs lateness would be handed on from lap to
//! lap, so the DAGs have no bound then.
//!
//! Assumes subtasks that do not wait, and preemptible members on the table's cores. As many jobs
//! may be in flight as the bounds need.

use alloc::vec::Vec;

use super::{BoundTest, BoundWitness, JobBounds, Responses, SinkBounds};
use crate::analysis::case::{AnalysisInput, CaseTable};
use crate::analysis::features::covers;
use crate::analysis::table_check::TableCondition;
use crate::analysis::{NotProvenReason, SchedulabilityTest};
use crate::ids::SubtaskId;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::Table],
    covers: covers!(
        ONE_CORE CORES GROUPS TABLE LATE_DEADLINES FEW_IN_FLIGHT OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    sinks,
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: |case, _, dag, bound_ns, text| {
        text.line(format_args!("bound {} {bound_ns} table", case.members[dag]));
    },
    sinks: |case, _, dag, bound_ns, text| {
        let finishes_ns = case.table_of(dag).map(|table| finishes_ns(case, table));
        for &sink in case.dag(dag).sinks() {
            if let Some(Ok(finishes_ns)) = &finishes_ns
                && let finish_ns = finishes_ns[place(case, dag)][sink.index()]
                && finish_ns < bound_ns
            {
                let id = case.members[dag];
                text.line(format_args!("sink {id} {} {finish_ns} 0", sink.0));
            }
        }
    },
    ..BoundWitness::NONE
};

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    for table in &case.tables {
        let finishes_ns = finishes_ns(case, table);
        for (place, &dag) in table.dags.iter().enumerate() {
            let reason = match &finishes_ns {
                Ok(finishes_ns) => {
                    let (bound_ns, subtask) = latest(&finishes_ns[place]);
                    if bound_ns <= case.tasks[dag].relative_deadline_ns() {
                        found.offer(dag, bound_ns, SchedulabilityTest::Table);
                        continue;
                    }
                    NotProvenReason::LateInTable { subtask, bound_ns }
                }
                Err((Some(failing), _)) if *failing != dag => NotProvenReason::DelayedBy {
                    dag: case.id(*failing),
                },
                Err((_, reason)) => *reason,
            };
            found.reasons[dag] = Some(reason);
        }
    }
}

fn sinks(case: &AnalysisInput<'_>, _: Responses<'_>, found: &mut SinkBounds) {
    for table in &case.tables {
        if let Ok(finishes_ns) = finishes_ns(case, table) {
            for (&dag, of_dag) in table.dags.iter().zip(finishes_ns) {
                let sinks = case.dag(dag).sinks().iter();
                found.offer(dag, sinks.map(|sink| Some(of_dag[sink.index()])));
            }
        }
    }
}

/// Returns the position of a DAG in its table.
fn place(case: &AnalysisInput<'_>, dag: usize) -> usize {
    let table = case.table_of(dag);
    let place = table.and_then(|table| table.dags.iter().position(|&of| of == dag));
    place.unwrap_or_default()
}

/// Returns the last finish of a job, and the subtask.
fn latest(finishes_ns: &[u64]) -> (u64, SubtaskId) {
    let subtasks = (0..).map(SubtaskId);
    let latest = finishes_ns.iter().copied().zip(subtasks).max_by_key(|of| of.0);
    latest.unwrap_or((0, SubtaskId(0)))
}

/// The latest finish after the release of each subtask of a table, by DAG and subtask. The error
/// says why the table has no bounds, and which DAG is to blame, unless all are.
pub(super) type TableFinishes = Result<Vec<Vec<u64>>, (Option<usize>, NotProvenReason)>;

/// Computes the finishes of a table.
pub(super) fn finishes_ns(case: &AnalysisInput<'_>, table: &CaseTable<'_>) -> TableFinishes {
    let times = table.times.as_ref().map_err(|reason| (None, *reason))?;
    let mut finishes_ns = times.latest_ns.clone();
    let overheads = &case.settings.overheads;
    let has_bursts = overheads.ready_ns > 0 || overheads.device_ns > 0;
    if let [dag] = table.dags[..] {
        // With a lap at each release, lateness stays within its job.
        let mut entries = table.table.lists.iter().flat_map(|list| &list.entries);
        let is_strict = has_bursts || case.dag(dag).is_sporadic();
        if let Some(of) = entries.find(|entry| is_strict && entry.job != 0) {
            let fault = of.fails(TableCondition::OwnLap);
            return Err((None, NotProvenReason::NotRight(fault)));
        }
        for finish_ns in &mut finishes_ns[0] {
            let after_ns = case.set.bursts.after(*finish_ns);
            *finish_ns = after_ns.ok_or((None, NotProvenReason::Limit))?;
        }
        let (bound_ns, subtask) = latest(&finishes_ns[0]);
        let task = case.tasks[dag];
        let limit_ns = task.period_ns().min(task.relative_deadline_ns());
        if has_bursts && bound_ns > limit_ns {
            return Err((None, NotProvenReason::LateInTable { subtask, bound_ns }));
        }
    } else if has_bursts || case.has_locks() {
        return Err((None, NotProvenReason::TableOverheads));
    }
    for (&dag, finishes_ns) in table.dags.iter().zip(&finishes_ns) {
        let in_flight = case.dag(dag).in_flight();
        let room = u128::from(in_flight) * u128::from(case.tasks[dag].period_ns());
        // A job that finds no room is released late, and makes all others late.
        if room < u128::from(latest(finishes_ns).0) {
            return Err((Some(dag), NotProvenReason::InFlightTooFew { in_flight }));
        }
    }
    Ok(finishes_ns)
}
