//! The checks of one DAG's graph as a whole: edges in range, sources, sinks,
//! connection, cycles.

use alloc::vec::Vec;

use super::cycles;
use super::fault::{Fault, Warning};
use super::findings::{Findings, Page};
use super::label::SubtaskLabel;
use super::options::{ConstructionPolicy, Count};
use super::states;
use super::topics::Topology;
use crate::graph::Graph;
use crate::ids::{SubtaskId, to_u32};
use crate::task_set::StatePrecedence;

/// The graph of a DAG, with the edges that follow from shared states.
pub(super) struct Shape {
    pub(super) graph: Graph,
    pub(super) state_precedences: Vec<StatePrecedence>,
}

/// Checks the graph of DAG number `dag`.
#[inline(never)]
pub(super) fn check(
    dag: usize,
    mut topology: Topology<'_>,
    policy: ConstructionPolicy,
    findings: &mut Findings<'_>,
) -> Shape {
    let page = &mut findings.of(dag);
    let spec = page.spec;
    add_plain_edges(&mut topology.edges, page);
    let mut graph = Graph::new(spec.subtasks.len(), &topology.edges);
    check_connection(&graph, policy, page);
    check_sources(&graph, policy, page);
    check_sinks(&graph, policy, &topology.unread, page);
    check_deadlines(&graph, page);
    if !graph.is_acyclic() {
        for cycle in cycles::shortest_cycles(&graph) {
            let hops = labels(page, &cycle);
            page.fault(|dag| Fault::Cycle { dag, hops });
        }
    }
    // Last, so that all other checks judge the graph that the author stated.
    let mut state_precedences = Vec::new();
    if graph.is_acyclic() {
        state_precedences = states::order_users(spec, &graph);
    }
    if !state_precedences.is_empty() {
        let added = state_precedences.iter();
        let added = added.map(|added| (added.earlier.0, added.later.0));
        topology.edges.extend(added);
        graph = Graph::new(graph.len(), &topology.edges);
    }
    Shape {
        graph,
        state_precedences,
    }
}

/// Adds the edges that are given without a topic.
fn add_plain_edges(edges: &mut Vec<(u32, u32)>, page: &mut Page<'_, '_>) {
    let subtasks = page.spec.subtasks.len();
    edges.reserve(page.spec.edges.len());
    for &edge in &page.spec.edges {
        let (from, to) = edge;
        if from >= subtasks || to >= subtasks {
            page.fault(|dag| Fault::EdgeOutOfRange {
                dag,
                edge,
                subtasks,
            });
        } else if from == to {
            let (subtask, topic) = (page.subtask(from), None);
            page.fault(|dag| Fault::SelfEdge {
                dag,
                subtask,
                topic,
            });
        } else {
            edges.push((to_u32(from), to_u32(to)));
        }
    }
}

fn check_connection(graph: &Graph, policy: ConstructionPolicy, page: &mut Page<'_, '_>) {
    if policy.parts == Count::Several {
        return;
    }
    let (part_of, parts) = graph.parts();
    if let Some(other) = part_of.iter().position(|&part| part != 0) {
        let (one, other) = (page.subtask(0), page.subtask(other));
        page.fault(|dag| Fault::NotConnected {
            dag,
            parts,
            one,
            other,
        });
    }
}

/// A subtask that only reads topics without writer has no predecessor, but
/// its author did not mean a source: that fault is reported by itself.
fn check_sources(graph: &Graph, policy: ConstructionPolicy, page: &mut Page<'_, '_>) {
    let subtasks = &page.spec.subtasks;
    let is_source = |subtask: &SubtaskId| subtasks[subtask.index()].inputs.is_empty();
    let sources = graph.sources.iter().copied().filter(is_source);
    let sources = labels(page, &sources.collect::<Vec<_>>());
    if sources.is_empty() && !subtasks.is_empty() {
        page.fault(|dag| Fault::NoSource { dag });
    } else if sources.len() > 1 && policy.sources == Count::One {
        page.fault(|dag| Fault::SeveralSources { dag, sources });
    }
}

/// A topic without reader is a fault, but at an accepted sink it is only a
/// value that nobody uses. Where one sink is wanted and a subtask without
/// outputs is there to be it, other ends of the graph are no sinks but
/// writers of unread topics, most likely of misspelt ones.
#[inline(never)]
fn check_sinks(
    graph: &Graph,
    policy: ConstructionPolicy,
    unread: &[(usize, &str)],
    page: &mut Page<'_, '_>,
) {
    let ends = &*graph.sinks;
    let mut writes_unread = alloc::vec![false; graph.len()];
    for &(writer, _) in unread {
        writes_unread[writer] = true;
    }
    let silent = ends.iter().filter(|end| !writes_unread[end.index()]);
    let silent: Vec<SubtaskId> = silent.copied().collect();
    let wants_one = policy.sinks == Count::One;
    let sinks = match wants_one && !silent.is_empty() {
        true => &silent,
        false => ends,
    };

    if sinks.is_empty() && graph.len() > 0 {
        page.fault(|dag| Fault::NoSink { dag });
    } else if sinks.len() > 1 && wants_one {
        let sinks = labels(page, sinks);
        page.fault(|dag| Fault::SeveralSinks { dag, sinks });
    }

    let accepted = !wants_one || (silent.is_empty() && ends.len() == 1);
    for &(writer, topic) in unread {
        let is_end = ends.binary_search(&SubtaskId(to_u32(writer))).is_ok();
        let (writer, topic) = (page.subtask(writer), topic.into());
        if accepted && is_end {
            page.warn(|dag| Warning::UnreadSinkValue {
                dag,
                subtask: writer,
                topic,
            });
        } else {
            page.fault(|dag| Fault::UnreadTopic {
                dag,
                topic,
                writer,
                meant: None,
            });
        }
    }
}

/// Of subtasks only sinks have deadlines of their own.
fn check_deadlines(graph: &Graph, page: &mut Page<'_, '_>) {
    let stated = &page.spec.subtasks;
    for subtask in graph.subtasks() {
        if stated[subtask.index()].relative_deadline_ns.is_some()
            && let Some(successor) = graph.successors.of(subtask).first()
        {
            let (subtask, successor) = (subtask.index(), successor.index());
            let (subtask, successor) = (page.subtask(subtask), page.subtask(successor));
            page.fault(|dag| Fault::DeadlineOfNoSink {
                dag,
                subtask,
                successor,
            });
        }
    }
}

fn labels(page: &Page<'_, '_>, subtasks: &[SubtaskId]) -> Vec<SubtaskLabel> {
    let labels = subtasks.iter().map(|subtask| page.subtask(subtask.index()));
    labels.collect()
}
