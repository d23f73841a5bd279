//! From topics to precedence edges.
//!
//! A topic is a named, typed bundle of edges from its writer to its readers
//! inside one DAG. This module finds all ends of each topic, checks that they
//! fit, and returns the edges that they make. It goes on after a fault, with
//! the edges that the author most likely meant, so that the checks of the
//! graph's shape do not report consequences of a fault that is known.
//!
//! A reader of a topic's *latest value* waits for nothing: it may belong to any DAG and makes no
//! edge. For the topic it is one reader more: the topic is not unread, the types must agree, and
//! a message that can only be moved can have no other reader.

use alloc::vec;
use alloc::vec::Vec;

use super::fault::{Direction, Fault};
use super::findings::{Findings, Page};
use super::interner::Interner;
use super::label::SubtaskLabel;
use super::options::{CommitOptions, Count};
use crate::ids::to_u32;
use crate::order::sorted_by_key;
use crate::spec::{DagSpec, LatestSpec, TopicPort};

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
    /// The topic's number.
    topic: usize,
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

/// Checks all topics and their latest values and returns what they say, one entry a DAG.
pub(super) fn check<'a>(options: &CommitOptions, findings: &mut Findings<'a>) -> Vec<Topology<'a>> {
    let mut topologies = vec![Topology::default(); findings.specs.len()];
    // Filled anew for each topic, so that many topics do not mean as many
    // allocations.
    let mut sides = Sides::default();
    for ends in ends_by_topic(findings.specs).chunk_by(|one, other| one.topic == other.topic) {
        let first = ends[0];
        let of_dags = || ends.chunk_by(|one, other| one.dag == other.dag);
        let is_shared = ends.iter().any(|end| end.dag != first.dag);
        if is_shared {
            let dags = of_dags().map(|ends| findings.label(ends[0].dag)).collect();
            let topic = first.port.topic.clone();
            let shared = |_| Fault::TopicInSeveralDags { topic, dags };
            findings.of(first.dag).fault(shared);
        }
        for ends in of_dags() {
            let page = &mut findings.of(ends[0].dag);
            let topology = &mut topologies[ends[0].dag];
            sides.fill(ends);
            report_duplicates(ends, page);
            check_topic(options, &sides, is_shared, topology, page);
        }
    }
    for (dag, topology) in topologies.iter_mut().enumerate() {
        let page = &mut findings.of(dag);
        for latest in &page.spec.latest {
            let unread = &mut topology.unread;
            unread.retain(|&(_, topic)| topic != latest.port.topic);
            check_latest(latest, page);
        }
    }
    topologies
}

/// Returns all ends, those of a topic next to each other and in the order of DAGs and subtasks.
#[inline(never)]
fn ends_by_topic<'a>(specs: &[&'a DagSpec]) -> Vec<End<'a>> {
    let subtasks = specs.iter().flat_map(|spec| &spec.subtasks);
    let count = subtasks.map(|subtask| subtask.inputs.len() + subtask.outputs.len());
    let mut topics = Interner::new(count.sum());
    let mut ends = Vec::new();
    for (dag, spec) in specs.iter().enumerate() {
        for (subtask, of) in spec.subtasks.iter().enumerate() {
            let inputs = of.inputs.iter().map(|port| (Direction::Input, port));
            let outputs = of.outputs.iter().map(|port| (Direction::Output, port));
            for (direction, port) in inputs.chain(outputs) {
                let topic = topics.intern(&port.topic);
                ends.push(End {
                    topic,
                    dag,
                    subtask,
                    direction,
                    port,
                });
            }
        }
    }
    let order = sorted_by_key(ends.len(), |end| ends[end].topic);
    order.into_iter().map(|end| ends[end]).collect()
}

/// Checks the ends that one topic has in one DAG.
#[inline(never)]
fn check_topic<'a>(
    options: &CommitOptions,
    Sides { writers, readers }: &Sides<'a>,
    is_shared: bool,
    topology: &mut Topology<'a>,
    page: &mut Page<'_, '_>,
) {
    let Some(End { port, .. }) = writers.first().or(readers.first()).copied() else {
        return;
    };
    let (spec, topic) = (page.spec, || port.topic.clone());
    let label = |end: &End<'_>| SubtaskLabel::new(spec, end.subtask);

    if writers.len() > 1 && options.construction.writers == Count::One {
        page.fault(|dag| Fault::SeveralWriters {
            dag,
            topic: topic(),
            writers: writers.iter().map(label).collect(),
        });
    }
    match (writers.first(), readers.first()) {
        (Some(writer), None) if !is_shared => topology.unread.push((writer.subtask, &port.topic)),
        (None, Some(_)) if !is_shared => {
            for reader in readers {
                page.fault(|dag| Fault::UnwrittenTopic {
                    dag,
                    topic: topic(),
                    reader: label(reader),
                    meant: None,
                });
            }
        }
        (Some(_), Some(_)) => {
            report_mismatches(writers, readers, page);
            add_edges(options, writers, readers, topology, page);
        }
        _ => {}
    }
    let mut ends = writers.iter().chain(readers);
    if readers.len() > 1 && ends.any(|end| !end.port.can_fan_out) {
        page.fault(|dag| Fault::SeveralReaders {
            dag,
            topic: topic(),
            type_name: port.type_name,
            readers: readers.iter().map(label).collect(),
        });
    }
}

/// Reports a topic that stands twice among the inputs, or among the outputs,
/// of a subtask: in `ends` such ends are neighbours.
fn report_duplicates(ends: &[End<'_>], page: &mut Page<'_, '_>) {
    let kind = |end: &End<'_>| (end.subtask, end.direction);
    for same in ends.chunk_by(|one, other| kind(one) == kind(other)) {
        if let [first, _, ..] = same {
            let subtask = page.subtask(first.subtask);
            page.fault(|dag| Fault::DuplicateTopic {
                dag,
                subtask,
                topic: first.port.topic.clone(),
                direction: first.direction,
            });
        }
    }
}

/// Compares every reader with the first writer, and every further writer with
/// the first reader: linear, and no wrong end stays unnamed.
fn report_mismatches(writers: &[End<'_>], readers: &[End<'_>], page: &mut Page<'_, '_>) {
    let spec = page.spec;
    let with_first_writer = readers.iter().map(|reader| (&writers[0], reader));
    let with_first_reader = writers.iter().skip(1).map(|writer| (writer, &readers[0]));
    for (writer, reader) in with_first_writer.chain(with_first_reader) {
        if writer.port.type_id != reader.port.type_id {
            page.fault(|dag| Fault::TypeMismatch {
                dag,
                topic: writer.port.topic.clone(),
                writer: SubtaskLabel::new(spec, writer.subtask),
                written: writer.port.type_name,
                reader: SubtaskLabel::new(spec, reader.subtask),
                read: reader.port.type_name,
            });
        }
    }
}

fn add_edges(
    options: &CommitOptions,
    writers: &[End<'_>],
    readers: &[End<'_>],
    topology: &mut Topology<'_>,
    page: &mut Page<'_, '_>,
) {
    for (position, writer) in writers.iter().enumerate() {
        // Under one writer a topic the further ones are a fault already: one
        // edge each keeps them connected without a product of two counts.
        let all = position == 0 || options.construction.writers != Count::One;
        for reader in if all { readers } else { &readers[..1] } {
            if writer.subtask == reader.subtask {
                let subtask = page.subtask(writer.subtask);
                page.fault(|dag| Fault::SelfEdge {
                    dag,
                    subtask,
                    topic: Some(writer.port.topic.clone()),
                });
            } else {
                let edge = (to_u32(writer.subtask), to_u32(reader.subtask));
                topology.edges.push(edge);
            }
        }
    }
}

#[inline(never)]
fn check_latest(latest: &LatestSpec, page: &mut Page<'_, '_>) {
    let subtasks = page.spec.subtasks.iter();
    let topic = latest.port.topic.clone();
    if latest.samplers == 0 {
        let topic = topic.clone();
        page.fault(|dag| Fault::LatestUnread { dag, topic });
    }
    let is_here = |other: &&TopicPort| other.topic == latest.port.topic;
    let mut writers = (subtasks.clone().enumerate())
        .filter_map(|(index, subtask)| Some((index, subtask.outputs.iter().find(is_here)?)));
    let Some((writer, written)) = writers.next() else {
        let meant = None;
        page.fault(|dag| Fault::LatestUnwritten { dag, topic, meant });
        return;
    };
    if written.type_id != latest.port.type_id {
        let writer = page.subtask(writer);
        page.fault(|dag| Fault::LatestTypeMismatch {
            dag,
            topic,
            writer,
            written: written.type_name,
            read: latest.port.type_name,
        });
        return;
    }
    let inputs = subtasks.flat_map(|subtask| subtask.inputs.iter().filter(is_here));
    let readers = inputs.count() + latest.samplers;
    if readers > 1 && !written.can_fan_out {
        page.fault(|dag| Fault::LatestOfMoved {
            dag,
            topic,
            type_name: written.type_name,
            readers,
        });
    }
}
