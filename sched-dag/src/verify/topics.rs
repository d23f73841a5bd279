//! From topics to precedence edges.
//!
//! A topic is a named, typed bundle of edges from its writer to its readers
//! inside one DAG. This module finds all ends of each topic, checks that they
//! fit, and returns the edges that they make. It goes on after a fault, with
//! the edges that the author most likely meant, so that the checks of the
//! graph's shape do not report consequences of a fault that is known.

use alloc::vec;
use alloc::vec::Vec;

use super::fault::{Direction, Fault};
use super::findings::Findings;
use super::interner::Interner;
use super::label::{DagLabel, SubtaskLabel};
use super::options::CommitOptions;
use crate::ids::to_u32;
use crate::spec::{DagSpec, TopicPort};

/// What the topics of one DAG say about its graph.
#[derive(Clone, Default)]
pub(super) struct Topology<'a> {
    /// Edges `(predecessor, successor)`, perhaps repeated, never to oneself.
    pub(super) edges: Vec<(u32, u32)>,
    /// Topics that are written and not read, with their writer.
    pub(super) unread: Vec<(usize, &'a str)>,
}

/// One end of a topic.
#[derive(Clone, Copy)]
struct End<'a> {
    dag: usize,
    subtask: usize,
    direction: Direction,
    port: &'a TopicPort,
}

/// The ends of one topic in one DAG, at most one of each kind a subtask.
#[derive(Default)]
struct Sides<'a> {
    writers: Vec<End<'a>>,
    readers: Vec<End<'a>>,
}

impl<'a> Sides<'a> {
    fn fill(&mut self, ends: &[End<'a>]) {
        self.writers.clear();
        self.readers.clear();
        for end in ends {
            let side = match end.direction {
                Direction::Output => &mut self.writers,
                Direction::Input => &mut self.readers,
            };
            if side.last().is_none_or(|last| last.subtask != end.subtask) {
                side.push(*end);
            }
        }
    }
}

/// Checks all topics and returns what they say, one entry a DAG.
pub(super) fn check<'a>(
    specs: &[&'a DagSpec],
    options: &CommitOptions,
    findings: &mut Findings,
) -> Vec<Topology<'a>> {
    let mut topologies = vec![Topology::default(); specs.len()];
    let (ends, starts) = ends_by_topic(specs);
    // Filled anew for each topic, so that many topics do not mean as many
    // allocations.
    let mut sides = Sides::default();
    for range in starts.windows(2) {
        let ends = &ends[range[0]..range[1]];
        let shared = ends.iter().any(|end| end.dag != ends[0].dag);
        if shared {
            report_shared(specs, ends, findings);
        }
        for ends in ends.chunk_by(|one, other| one.dag == other.dag) {
            let topology = &mut topologies[ends[0].dag];
            sides.fill(ends);
            report_duplicates(specs, ends, findings);
            check_topic(specs, options, &sides, shared, topology, findings);
        }
    }
    topologies
}

/// Returns all ends grouped by topic, within a topic in the order of DAGs and
/// subtasks, and where each group starts.
#[inline(never)]
fn ends_by_topic<'a>(specs: &[&'a DagSpec]) -> (Vec<End<'a>>, Vec<usize>) {
    let mut unordered: Vec<End<'_>> = Vec::new();
    for (dag, spec) in specs.iter().enumerate() {
        for (subtask, ports) in spec.subtasks.iter().enumerate() {
            let end = |direction| {
                move |port| End {
                    dag,
                    subtask,
                    direction,
                    port,
                }
            };
            unordered.extend(ports.inputs.iter().map(end(Direction::Input)));
            unordered.extend(ports.outputs.iter().map(end(Direction::Output)));
        }
    }
    let mut topics = Interner::new(unordered.len());
    let numbers: Vec<usize> = unordered
        .iter()
        .map(|end| topics.intern(&end.port.topic))
        .collect();

    // A counting sort, which is stable and linear.
    let mut starts = vec![0; topics.len() + 1];
    for &number in &numbers {
        starts[number + 1] += 1;
    }
    for number in 0..topics.len() {
        starts[number + 1] += starts[number];
    }
    let mut next = starts.clone();
    let mut ends = unordered.clone();
    for (end, &number) in unordered.iter().zip(&numbers) {
        ends[next[number]] = *end;
        next[number] += 1;
    }
    (ends, starts)
}

fn report_shared(specs: &[&DagSpec], ends: &[End<'_>], findings: &mut Findings) {
    let dags = ends.chunk_by(|one, other| one.dag == other.dag);
    findings.fault(
        ends[0].dag,
        Fault::TopicInSeveralDags {
            topic: ends[0].port.topic.clone(),
            dags: dags.map(|ends| DagLabel::new(specs, ends[0].dag)).collect(),
        },
    );
}

/// Checks the ends that one topic has in one DAG.
#[inline(never)]
fn check_topic<'a>(
    specs: &[&'a DagSpec],
    options: &CommitOptions,
    sides: &Sides<'a>,
    shared: bool,
    topology: &mut Topology<'a>,
    findings: &mut Findings,
) {
    let Sides { writers, readers } = sides;
    let Some(End { dag, port, .. }) = writers.first().or(readers.first()).copied() else {
        return;
    };
    let topic = &port.topic;
    let dag_label = || DagLabel::new(specs, dag);
    let label = |end: &End<'_>| SubtaskLabel::new(specs[dag], end.subtask);

    if writers.len() > 1 && options.construction.writers.is_one() {
        findings.fault(
            dag,
            Fault::SeveralWriters {
                dag: dag_label(),
                topic: topic.clone(),
                writers: writers.iter().map(label).collect(),
            },
        );
    }
    match (writers.first(), readers.first()) {
        (Some(writer), None) if !shared => topology.unread.push((writer.subtask, topic)),
        (None, Some(_)) if !shared => {
            for reader in readers {
                findings.fault(
                    dag,
                    Fault::UnwrittenTopic {
                        dag: dag_label(),
                        topic: topic.clone(),
                        reader: label(reader),
                        meant: None,
                    },
                );
            }
        }
        (Some(_), Some(_)) => {
            report_mismatches(specs, writers, readers, findings);
            add_edges(specs, options, writers, readers, topology, findings);
        }
        _ => {}
    }
    let mut ends = writers.iter().chain(readers);
    if readers.len() > 1 && ends.any(|end| !end.port.can_fan_out) {
        findings.fault(
            dag,
            Fault::SeveralReaders {
                dag: dag_label(),
                topic: topic.clone(),
                type_name: writers.first().unwrap_or(&readers[0]).port.type_name,
                readers: readers.iter().map(label).collect(),
            },
        );
    }
}

/// Reports a topic that stands twice among the inputs, or among the outputs,
/// of a subtask: in `ends` such ends are neighbours.
fn report_duplicates(specs: &[&DagSpec], ends: &[End<'_>], findings: &mut Findings) {
    for same in
        ends.chunk_by(|one, other| one.subtask == other.subtask && one.direction == other.direction)
    {
        if let [first, _, ..] = same {
            findings.fault(
                first.dag,
                Fault::DuplicateTopic {
                    dag: DagLabel::new(specs, first.dag),
                    subtask: SubtaskLabel::new(specs[first.dag], first.subtask),
                    topic: first.port.topic.clone(),
                    direction: first.direction,
                },
            );
        }
    }
}

/// Compares every reader with the first writer, and every further writer with
/// the first reader: linear, and no wrong end stays unnamed.
fn report_mismatches(
    specs: &[&DagSpec],
    writers: &[End<'_>],
    readers: &[End<'_>],
    findings: &mut Findings,
) {
    let with_first_writer = readers.iter().map(|reader| (&writers[0], reader));
    let with_first_reader = writers.iter().skip(1).map(|writer| (writer, &readers[0]));
    for (writer, reader) in with_first_writer.chain(with_first_reader) {
        if writer.port.type_id != reader.port.type_id {
            let spec = &specs[writer.dag];
            findings.fault(
                writer.dag,
                Fault::TypeMismatch {
                    dag: DagLabel::new(specs, writer.dag),
                    topic: writer.port.topic.clone(),
                    writer: SubtaskLabel::new(spec, writer.subtask),
                    written: writer.port.type_name,
                    reader: SubtaskLabel::new(spec, reader.subtask),
                    read: reader.port.type_name,
                },
            );
        }
    }
}

fn add_edges(
    specs: &[&DagSpec],
    options: &CommitOptions,
    writers: &[End<'_>],
    readers: &[End<'_>],
    topology: &mut Topology<'_>,
    findings: &mut Findings,
) {
    for (position, writer) in writers.iter().enumerate() {
        // Under one writer a topic the further ones are a fault already: one
        // edge each keeps them connected without a product of two counts.
        let all = position == 0 || !options.construction.writers.is_one();
        for reader in if all { readers } else { &readers[..1] } {
            if writer.subtask == reader.subtask {
                findings.fault(
                    writer.dag,
                    Fault::SelfEdge {
                        dag: DagLabel::new(specs, writer.dag),
                        subtask: SubtaskLabel::new(specs[writer.dag], writer.subtask),
                        topic: Some(writer.port.topic.clone()),
                    },
                );
            } else {
                topology
                    .edges
                    .push((to_u32(writer.subtask), to_u32(reader.subtask)));
            }
        }
    }
}
