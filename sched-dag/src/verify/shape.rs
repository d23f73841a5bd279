//! The checks of one DAG's graph as a whole: edges in range, sources, sinks,
//! connection, cycles.

use alloc::vec::Vec;

use super::cycles;
use super::fault::Fault;
use super::findings::Findings;
use super::label::{DagLabel, SubtaskLabel};
use super::options::{CommitOptions, ConstructionPolicy};
use super::states;
use super::topics::Topology;
use super::warning::Warning;
use crate::graph::Graph;
use crate::ids::{SubtaskId, to_u32};
use crate::spec::DagSpec;
use crate::task_set::StatePrecedence;

/// The graph of a DAG, with the edges that follow from shared states.
pub(super) struct Shape {
    pub(super) graph: Graph,
    pub(super) state_precedences: Vec<StatePrecedence>,
}

/// Checks the graph of DAG number `dag`.
#[inline(never)]
pub(super) fn check(
    specs: &[&DagSpec],
    dag: usize,
    mut topology: Topology<'_>,
    options: &CommitOptions,
    findings: &mut Findings,
) -> Shape {
    let spec = &specs[dag];
    add_plain_edges(specs, dag, &mut topology.edges, findings);
    let mut graph = Graph::new(spec.subtasks.len(), &topology.edges);
    let check = Check {
        specs,
        dag,
        policy: options.construction,
        graph: &graph,
    };
    check.connection(findings);
    check.sources(findings);
    check.sinks(&topology.unread, findings);
    check.deadlines(findings);
    if !graph.is_acyclic() {
        for cycle in cycles::shortest_cycles(&graph) {
            let hops = cycle.iter().map(|&subtask| check.label(subtask)).collect();
            findings.fault(
                dag,
                Fault::Cycle {
                    dag: check.dag_label(),
                    hops,
                },
            );
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
fn add_plain_edges(
    specs: &[&DagSpec],
    dag: usize,
    edges: &mut Vec<(u32, u32)>,
    findings: &mut Findings,
) {
    let spec = &specs[dag];
    let subtasks = spec.subtasks.len();
    edges.reserve(spec.edges.len());
    for &(from, to) in &spec.edges {
        if from >= subtasks || to >= subtasks {
            let fault = Fault::EdgeOutOfRange {
                dag: DagLabel::new(specs, dag),
                edge: (from, to),
                subtasks,
            };
            findings.fault(dag, fault);
        } else if from == to {
            let fault = Fault::SelfEdge {
                dag: DagLabel::new(specs, dag),
                subtask: SubtaskLabel::new(spec, from),
                topic: None,
            };
            findings.fault(dag, fault);
        } else {
            edges.push((to_u32(from), to_u32(to)));
        }
    }
}

struct Check<'a> {
    specs: &'a [&'a DagSpec],
    dag: usize,
    policy: ConstructionPolicy,
    graph: &'a Graph,
}

impl Check<'_> {
    fn connection(&self, findings: &mut Findings) {
        if !self.policy.parts.is_one() {
            return;
        }
        let (part_of, parts) = self.graph.parts();
        if let Some(other) = part_of.iter().position(|&part| part != 0) {
            findings.fault(
                self.dag,
                Fault::NotConnected {
                    dag: self.dag_label(),
                    parts,
                    one: SubtaskLabel::new(self.specs[self.dag], 0),
                    other: SubtaskLabel::new(self.specs[self.dag], other),
                },
            );
        }
    }

    /// A subtask that only reads topics without writer has no predecessor, but
    /// its author did not mean a source: that fault is reported by itself.
    fn sources(&self, findings: &mut Findings) {
        let subtasks = &self.specs[self.dag].subtasks;
        let is_source = |subtask: &SubtaskId| subtasks[subtask.index()].inputs.is_empty();
        let sources = self.graph.sources.iter().copied();
        let sources: Vec<SubtaskId> = sources.filter(is_source).collect();
        let dag = || self.dag_label();
        if sources.is_empty() && !subtasks.is_empty() {
            findings.fault(self.dag, Fault::NoSource { dag: dag() });
        } else if sources.len() > 1 && self.policy.sources.is_one() {
            let sources = self.labels(&sources);
            findings.fault(
                self.dag,
                Fault::SeveralSources {
                    dag: dag(),
                    sources,
                },
            );
        }
    }

    /// A topic without reader is a fault, but at an accepted sink it is only a
    /// value that nobody uses. Where one sink is wanted and a subtask without
    /// outputs is there to be it, other ends of the graph are no sinks but
    /// writers of unread topics, most likely of misspelt ones.
    #[inline(never)]
    fn sinks(&self, unread: &[(usize, &str)], findings: &mut Findings) {
        let ends = &*self.graph.sinks;
        let mut writes_unread = alloc::vec![false; self.graph.len()];
        for &(writer, _) in unread {
            writes_unread[writer] = true;
        }
        let silent: Vec<SubtaskId> = ends
            .iter()
            .copied()
            .filter(|end| !writes_unread[end.index()])
            .collect();
        let wants_one = self.policy.sinks.is_one();
        let sinks = if wants_one && !silent.is_empty() {
            &silent
        } else {
            ends
        };

        if sinks.is_empty() && self.graph.len() > 0 {
            findings.fault(
                self.dag,
                Fault::NoSink {
                    dag: self.dag_label(),
                },
            );
        } else if sinks.len() > 1 && wants_one {
            let sinks = self.labels(sinks);
            findings.fault(
                self.dag,
                Fault::SeveralSinks {
                    dag: self.dag_label(),
                    sinks,
                },
            );
        }

        let accepted = !wants_one || (silent.is_empty() && ends.len() == 1);
        for &(writer, topic) in unread {
            let writer = SubtaskId(to_u32(writer));
            let (dag, label, topic) = (self.dag_label(), self.label(writer), topic.into());
            if accepted && self.graph.successors.of(writer).is_empty() {
                findings.warnings.push(Warning::UnreadSinkValue {
                    dag,
                    subtask: label,
                    topic,
                });
            } else {
                findings.fault(
                    self.dag,
                    Fault::UnreadTopic {
                        dag,
                        topic,
                        writer: label,
                        meant: None,
                    },
                );
            }
        }
    }

    /// Of subtasks only sinks have deadlines of their own.
    fn deadlines(&self, findings: &mut Findings) {
        let stated = &self.specs[self.dag].subtasks;
        for subtask in self.graph.subtasks() {
            if stated[subtask.index()].relative_deadline_ns.is_some()
                && let Some(&successor) = self.graph.successors.of(subtask).first()
            {
                let fault = Fault::DeadlineOfNoSink {
                    dag: self.dag_label(),
                    subtask: self.label(subtask),
                    successor: self.label(successor),
                };
                findings.fault(self.dag, fault);
            }
        }
    }

    fn dag_label(&self) -> DagLabel {
        DagLabel::new(self.specs, self.dag)
    }

    fn label(&self, subtask: SubtaskId) -> SubtaskLabel {
        SubtaskLabel::new(self.specs[self.dag], subtask.index())
    }

    fn labels(&self, subtasks: &[SubtaskId]) -> Vec<SubtaskLabel> {
        subtasks
            .iter()
            .map(|&subtask| self.label(subtask))
            .collect()
    }
}
