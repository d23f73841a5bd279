//! Certificates: closed lists of states as text, carried along with a set of DAGs.
//!
//! ```text
//! certificate v1 of HASH              of cores, order, times and graphs, with all that is charged
//! state LAPS COUNT.. FREE.. FINISH..  the numbers of a state
//! ```
//!
//! A host explores ([`explore()`](super::explore())); a commit checks the list in one pass. A list
//! cut or altered by somebody, or made for another set, costs only the bounds.
//!
//! Executions count as real numbers here, and whole numbers are a special case.
//!
//! Assumes a *fixed* set: all jobs are released, and none is paused, cut or aborted. A commit with
//! a certificate refuses DAGs that start paused, and subtasks that may pause a DAG, enter a mode or
//! end the run. A fault may still change the set, and voids the bounds. Charges of the platform
//! lengthen executions, and releases may be late by as much (the jitter): a step of the scheduler
//! sees a release together with all releases due no later.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::Write;

use super::AnalysisSettings;
use super::abstraction::{
    AbstractState, AbstractionDag, AbstractionSet, AbstractionSubtask, NotClosed, check_closed,
};
use super::explore::STATE_LIMIT;
use super::task::Task;
use super::workload::WorkloadBursts;
use crate::policy::Preemption;
use crate::task_set::{Dag, Subtask};

/// Returns how late a step may see a release, in nanoseconds. A charge may also stand for lateness;
/// unlike a longer execution, lateness changes the order of instances.
pub(super) fn lateness_ns(settings: &AnalysisSettings, bursts: &WorkloadBursts) -> u64 {
    let charge_ns = settings.overheads.of_an_instance_ns(settings.preemption);
    bursts.late_ns.max(charge_ns.unwrap_or(u64::MAX))
}

/// Reports whether a budget may end an instance before it has executed its WCET.
fn is_cut(of: &Subtask) -> bool {
    of.budget_ns
        .is_some_and(|budget_ns| of.wcet_ns.is_none_or(|wcet_ns| budget_ns < wcet_ns))
}

/// Returns the graph of DAGs that share the cores of the settings, and no core with others.
///
/// # Errors
///
/// [`NotClosed::NotCovered`] or [`NotClosed::Limit`].
pub(super) fn graph_of(
    dags: &mut dyn Iterator<Item = (&Dag, &Task)>,
    settings: &AnalysisSettings,
    bursts: &WorkloadBursts,
) -> Result<AbstractionSet, NotClosed> {
    let mut all = Vec::new();
    for (dag, task) in dags {
        let keeps = settings.preemption == Preemption::Disabled;
        let mut subtasks = dag.subtasks().iter();
        let is_covered = subtasks
            .all(|of| of.waits().is_empty() && (keeps || of.is_non_preemptive()) && !is_cut(of))
            && !dag.is_sporadic()
            && !dag.is_confined()
            && dag.locks().is_empty()
            && dag.first_job() == 0;
        if !is_covered {
            return Err(NotClosed::NotCovered);
        }
        let mut of_dag = AbstractionDag {
            period_ns: dag.period_ns(),
            offset_ns: dag.offset_ns(),
            jitter_ns: lateness_ns(settings, bursts),
            jobs: dag.jobs(),
            subtasks: Vec::new(),
            edges: Vec::new(),
        };
        for (from, to) in dag.graph.successors.edges() {
            of_dag.edges.push((from as usize, to as usize));
        }
        let numbers = settings.policy.numbers(dag);
        for (id, (&wcet_ns, number)) in task.wcets_ns().iter().zip(numbers).enumerate() {
            let is_sink = dag.sinks().iter().any(|sink| sink.index() == id);
            of_dag.subtasks.push(AbstractionSubtask {
                best_ns: 0,
                wcet_ns: bursts.after(wcet_ns).ok_or(NotClosed::Limit)?,
                number,
                deadline_ns: is_sink.then(|| dag.subtasks()[id].relative_deadline_ns()),
            });
        }
        all.push(of_dag);
    }
    let adds_release = settings.policy.adds_release();
    AbstractionSet::new(settings.cores, &all, adds_release, true)
}

/// Writes a list of states.
pub(super) fn write_certificate(set: &AbstractionSet, states: &[AbstractState]) -> String {
    let mut text = format!("certificate v1 of {}\n", set.hash());
    for state in states {
        text.push_str("state");
        for number in state.numbers() {
            // Writing into a `String` cannot fail.
            let _ = write!(text, " {number}");
        }
        text.push('\n');
    }
    text
}

/// Checks a certificate, and returns by DAG and subtask the longest responses of sinks.
///
/// # Errors
///
/// The text does not belong to this set, or its list is not closed.
pub(super) fn check_certificate(
    set: &AbstractionSet,
    text: &str,
) -> Result<Vec<Vec<u64>>, NotClosed> {
    check_closed(set, &read_states(set, text)?)
}

/// Reads the states of a certificate.
pub(super) fn read_states(
    set: &AbstractionSet,
    text: &str,
) -> Result<Vec<AbstractState>, NotClosed> {
    let mut lines = text.lines();
    let hash = lines
        .next()
        .and_then(|line| line.strip_prefix("certificate v1 of "));
    if hash.and_then(|hash| hash.parse().ok()) != Some(set.hash()) {
        return Err(NotClosed::Foreign);
    }
    let (mut states, mut numbers) = (Vec::new(), Vec::new());
    for (state, line) in lines.enumerate() {
        if state >= STATE_LIMIT {
            return Err(NotClosed::Limit);
        }
        let mut words = line.split_ascii_whitespace();
        let mut is_read = words.next() == Some("state");
        numbers.clear();
        for word in words {
            let number = word.parse::<i64>();
            is_read &= number.is_ok();
            numbers.push(number.unwrap_or(0));
        }
        let read = set.state(&numbers).filter(|_| is_read);
        states.push(read.ok_or(NotClosed::Malformed { state })?);
    }
    Ok(states)
}
