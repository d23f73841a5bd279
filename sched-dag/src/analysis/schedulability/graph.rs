//! Response times by a certificate: a closed list of the states of a schedule-abstraction graph.
//!
//! [`abstraction`](crate::analysis::abstraction) has graph, check and their common assumptions;
//! [`certificate`](crate::analysis::certificate) the text, and the way from DAGs to a graph. The
//! proof is about all DAGs together: a DAG that is not covered, or not analysed, leaves all without
//! these bounds, and the graph isolates no DAG from a fault or an overrun of another.

use alloc::vec;
use alloc::vec::Vec;

use super::{BoundTest, BoundWitness, JobBounds};
use crate::analysis::case::AnalysisInput;
use crate::analysis::certificate::lateness_ns;
use crate::analysis::features::covers;
use crate::analysis::{NotProvenReason, SchedulabilityTest};

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::Graph],
    covers: covers!(
        RANKED BY_DEADLINE ONE_CORE CORES ALL_KEEP SINK_DEADLINES INTERLEAVED LATE_DEADLINES
        FEW_IN_FLIGHT OVERHEADS BURSTS
    ),
    jobs,
    sinks: |case, _, found| {
        if let Ok(bounds) = bounds(case, &found.asked) {
            for (dag, of_dag) in bounds.iter().enumerate() {
                let sinks = case.dag(dag).sinks().iter();
                found.offer(dag, sinks.map(|sink| Some(of_dag[sink.index()])));
            }
        }
    },
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    certificate: |case, _, text| {
        // The first line is the hash; the checker does not need it.
        if matches!(case.closed, Some(Ok(_))) {
            let states = case.certificate.unwrap_or_default().lines().skip(1);
            states.for_each(|state| text.line(format_args!("{state}")));
        }
    },
    job: |case, _, dag, bound_ns, text| {
        text.line(format_args!("bound {} {bound_ns} graph", case.members[dag]));
    },
    sinks: |case, _, dag, bound_ns, text| {
        let Ok(bounds) = bounds(case, &vec![true; case.members.len()]) else {
            return;
        };
        for sink in case.dag(dag).sinks() {
            let sink_ns = bounds[dag][sink.index()];
            if sink_ns < bound_ns {
                let id = case.members[dag];
                text.line(format_args!("latest {id} {} {sink_ns}", sink.0));
            }
        }
    },
};

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    match bounds(case, &found.asked) {
        Ok(bounds) => {
            for (dag, of_dag) in bounds.iter().enumerate() {
                found.offer(dag, latest(of_dag), SchedulabilityTest::Graph);
            }
        }
        // This reason tells more than the general one for a missing bound.
        Err(Some(reason)) => found.reasons.fill(Some(reason)),
        Err(None) => {}
    }
}

fn latest(of_dag: &[u64]) -> u64 {
    of_dag.iter().copied().max().unwrap_or(0)
}

/// Returns the bounds of sinks by DAG and subtask, or the reason for having none despite a
/// certificate.
fn bounds<'c>(
    case: &'c AnalysisInput<'_>,
    asked: &[bool],
) -> Result<&'c [Vec<u64>], Option<NotProvenReason>> {
    let checked = case.closed.as_ref().ok_or(None)?;
    let not_closed = |fault| Some(NotProvenReason::NoCertificate(fault));
    if asked.contains(&false) {
        return Err(not_closed(crate::analysis::NotClosed::NotCovered));
    }
    let bounds = checked.as_ref().map_err(|fault| not_closed(*fault))?;
    for (dag, of_dag) in bounds.iter().enumerate() {
        let model = case.dag(dag);
        let in_flight = model.in_flight();
        let room_ns = u128::from(in_flight) * u128::from(model.period_ns());
        // A release that finds no room is put off, or lost.
        let late_ns = lateness_ns(case.settings, &case.set.bursts);
        if u128::from(latest(of_dag)) + u128::from(late_ns) > room_ns {
            return Err(Some(NotProvenReason::InFlightTooFew { in_flight }));
        }
    }
    Ok(bounds)
}
