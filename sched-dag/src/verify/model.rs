//! Makes the model from specs without faults.
//!
//! A DAG that does not give all its priorities gets priorities derived from its graph. A subtask's
//! *remaining path* is the longest path from its start to the end of the DAG, including its own
//! WCET, but no waits. The subtask with the longest remaining path comes first (the "highest level
//! first" order; T. C. Hu, Operations Research 9, 1961, and, as upward rank, Topcuoglu, Hariri and
//! Wu, IEEE TPDS 13, 2002); between equal paths, the order of registration decides. If the WCET of
//! any subtask of the DAG is unknown, every subtask counts 1, and the number of subtasks on a path
//! decides. Mixing known and invented times would favour the subtasks that happened to be measured.
//!
//! Between DAGs, derived priorities are deadline monotonic, as the fixed-priority tests assume: all
//! subtasks of the DAG with the shorter relative deadline come before all subtasks of the other
//! (equal ones in the order of the commit). If only some DAGs have given priorities, derived
//! priorities come after all given priorities.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::attributes::affinity;
use super::fault::DagFault;
use super::{CommitOptions, VerifyFindings};

use crate::graph::Graph;
use crate::ids::{SubtaskId, to_u32};
use crate::order::{sort_by_key, sorted_by_key};
use crate::policy::Priority;
use crate::spec::{DagSpec, LockUse};
use crate::task_set::{Dag, StatePrecedence, Subtask, TaskSet};
use crate::topic::topics_of;
use crate::wcets::{WcetSource, graph_hash};

/// Makes the model, or reports that the derived priorities do not fit.
///
/// # Panics
///
/// If the specs have a fault that an earlier check finds.
pub(super) fn build(
    options: &CommitOptions,
    shapes: Vec<(Graph, Vec<StatePrecedence>)>,
    findings: &mut VerifyFindings<'_>,
) -> Option<TaskSet> {
    let bases = priority_bases(findings);
    if findings.has_faults() {
        return None;
    }
    let dags = findings.specs.iter().zip(shapes).zip(bases);
    let dags = dags.map(|((spec, shape), base)| {
        let mut dag = build_dag(options, spec, shape, base);
        dag.locks = locks(spec, findings.specs);
        for of in &dag.locks {
            let wait_ns = &mut dag.subtasks[of.subtask].lock_wait_ns;
            let all_ns = of
                .longest_wait_ns(options.cores)
                .saturating_mul(of.sections.into());
            *wait_ns = wait_ns.saturating_add(all_ns);
        }
        dag
    });
    Some(TaskSet::new(dags.collect(), options.clusters.sizes()))
}

/// Returns a DAG's uses of locks, each marked if the lock has other users.
fn locks(spec: &DagSpec, all: &[&DagSpec]) -> Box<[LockUse]> {
    let of = spec.locks.iter().map(|of| {
        let others = all.iter().flat_map(|spec| &spec.locks);
        LockUse {
            is_shared: others.filter(|other| other.lock == of.lock).count() > 1,
            ..of.clone()
        }
    });
    of.collect()
}

/// Returns the first priority number for each DAG without priorities: deadline monotonic, after all
/// given priorities.
#[inline(never)]
fn priority_bases(findings: &mut VerifyFindings<'_>) -> Vec<u32> {
    let specs = findings.specs;
    let given = specs
        .iter()
        .filter(|spec| has_priorities(spec))
        .flat_map(|spec| &spec.subtasks);
    let largest = given
        .filter_map(|subtask| subtask.priority)
        .map(|Priority(number)| number)
        .max();
    let mut next = largest.map_or(0, |number| u64::from(number) + 1);

    let mut order: Vec<usize> = (0..specs.len())
        .filter(|&dag| !has_priorities(specs[dag]))
        .collect();
    // Deadline monotonic; a stable sort, so that equal deadlines keep the order of the commit.
    sort_by_key(&mut order, |dag| specs[dag].relative_deadline_ns);
    let mut bases = alloc::vec![0; specs.len()];
    for dag in order {
        let after = next + specs[dag].subtasks.len() as u64;
        match u32::try_from(next) {
            Ok(base) if after <= u64::from(u32::MAX) + 1 => bases[dag] = base,
            _ => (findings.findings_of(dag)).fault(|dag| DagFault::PrioritiesExhausted { dag }),
        }
        next = after;
    }
    bases
}

fn has_priorities(spec: &DagSpec) -> bool {
    spec.subtasks
        .iter()
        .all(|subtask| subtask.priority.is_some())
}

#[inline(never)]
#[allow(clippy::too_many_lines, reason = "fills one structure, field by field")]
fn build_dag(
    options: &CommitOptions,
    spec: &DagSpec,
    (mut graph, state_precedences): (Graph, Vec<StatePrecedence>),
    priority_base: u32,
) -> Dag {
    let ranks = if has_priorities(spec) {
        Vec::new()
    } else {
        let wcets_ns: Vec<Option<u64>> = spec
            .subtasks
            .iter()
            .map(|subtask| subtask.wcet_ns)
            .collect();
        ranks(&wcets_ns, &graph)
    };
    let deadlines_ns = deadlines_ns(spec, &graph);
    let subtasks = spec
        .subtasks
        .iter()
        .enumerate()
        .map(|(index, subtask)| Subtask {
            name: subtask.name.clone(),
            wcet_ns: subtask.wcet_ns,
            waits: subtask.waits.as_slice().into(),
            wcet_source: match (subtask.wcet_ns, subtask.wcet_margin_percent) {
                (None, _) => WcetSource::None,
                (_, None) => WcetSource::Stated,
                (_, Some(margin_percent)) => WcetSource::Observed { margin_percent },
            },
            budget_ns: subtask.budget_ns,
            stack_bytes: subtask.stack_bytes,
            priority: match ranks.get(index) {
                Some(rank) => Priority(priority_base + rank),
                None => subtask.priority.expect("given to all subtasks of the DAG"),
            },
            non_preemptive: subtask.non_preemptive,
            relative_deadline_ns: deadlines_ns[index],
            lock_wait_ns: 0,
        });
    // A subtask with a stated deadline is a sink, though a shared state may put it before another.
    let is_sink = |subtask: &SubtaskId| {
        let states_deadline = spec.subtasks[subtask.index()]
            .relative_deadline_ns
            .is_some();
        states_deadline || graph.successors.neighbours(*subtask).is_empty()
    };
    graph.sinks = graph.subtasks().filter(is_sink).collect();
    let of_sinks_ns = graph.sinks.iter().map(|sink| deadlines_ns[sink.index()]);
    Dag {
        name: spec.name.clone(),
        graph_hash: graph_hash(spec),
        activation: spec.activation,
        period_ns: spec.period_ns.expect("verified to be given"),
        relative_deadline_ns: of_sinks_ns.max().expect("verified to have a sink"),
        offset_ns: spec.offset_ns,
        in_flight: u32::try_from(spec.most_in_flight())
            .expect("verified to fit the instance limit"),
        overrun: spec.overrun,
        on_fault: spec.on_fault,
        cluster: spec.cluster,
        affinity: affinity(options, spec).into(),
        why_there: None,
        first_job: 0,
        jobs: spec.jobs,
        subtasks: subtasks.collect(),
        graph,
        state_precedences: state_precedences.into_boxed_slice(),
        topics: topics_of(spec),
        locks: Box::default(),
    }
}

/// Returns, for each subtask, the least relative deadline of the sinks reachable from the subtask.
fn deadlines_ns(spec: &DagSpec, graph: &Graph) -> Vec<u64> {
    let whole_ns = spec.relative_deadline_ns.expect("verified to be given");
    let stated = spec
        .subtasks
        .iter()
        .map(|subtask| subtask.relative_deadline_ns);
    let mut deadlines_ns: Vec<u64> = stated.map(|own_ns| own_ns.unwrap_or(whole_ns)).collect();
    for subtask in graph.topological_order.iter().rev() {
        for next in graph.successors.neighbours(*subtask) {
            let least_ns = deadlines_ns[subtask.index()].min(deadlines_ns[next.index()]);
            deadlines_ns[subtask.index()] = least_ns;
        }
    }
    deadlines_ns
}

/// Returns each subtask's position in the order of remaining paths.
fn ranks(wcets_ns: &[Option<u64>], graph: &Graph) -> Vec<u32> {
    let known: Option<Vec<u64>> = wcets_ns.iter().copied().collect();
    let weights = known.unwrap_or_else(|| vec![1; wcets_ns.len()]);
    // The sum of all WCETs fits, so no path overflows.
    let paths = graph.levels(&weights);
    // Stable, so equal paths stay in the order of registration.
    let order = sorted_by_key(paths.len(), |subtask| core::cmp::Reverse(paths[subtask]));
    let mut ranks = vec![0; paths.len()];
    for (rank, &subtask) in order.iter().enumerate() {
        ranks[subtask] = to_u32(rank);
    }
    ranks
}
