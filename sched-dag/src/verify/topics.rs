//! Turns topics into precedence edges.
//!
//! A topic is a named, typed bundle of edges from its writer to its readers inside one DAG. This
//! module finds all ends of each topic, checks that the ends fit, and returns the resulting edges.
//! After a fault, the module goes on with the edges the author most likely meant. So the checks of
//! the graph's shape do not report consequences of a known fault.
//!
//! A reader of a topic's *latest value* waits for nothing. The reader may belong to any DAG and
//! adds no edge, but counts as a reader of the topic: the topic is not unread, the types must
//! agree, and a message that can only be moved can have no other reader.
//!
//! # States shared by subtasks of one DAG: checks and precedence
//!
//! Words: a subtask that *updates* a state may change it; a subtask that *reads* a state may not.
//! Two uses *conflict* unless both read. Conflicting uses must not overlap, and their order must
//! not depend on execution times.
//!
//! # The order of a state's users
//!
//! Within a job, the users take turns as if one core ran the DAG as stated and always took the
//! ready subtask registered first. So a path between two users decides their order; without a path,
//! the order of registration decides. For each pair of conflicting neighbours an edge is added;
//! readers between two updates stay parallel. All edges follow one order consistent with all paths,
//! so the edges close no cycle.
//!
//! Jobs take turns as well: the commit allows one job in flight of a DAG with a shared state. (A
//! state with a single user needs no limit, as R2 puts the user's instances in sequence.) Job k + 1
//! finds the states as job k left them.
//!
//! The analysis sees nothing but a DAG with some more edges. There is no lock, so no subtask is
//! ever blocked by a state and no priority is inverted.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use super::fault::{DagFault, TopicSide};
use super::label::SubtaskLabel;
use super::names::Interner;
use super::{CommitOptions, CountLimit, DagFindings, VerifyFindings};
use crate::graph::Graph;
use crate::ids::{SubtaskId, to_u32};
use crate::order::{sort_by_key, sorted_by_key};
use crate::spec::{DagSpec, LatestSpec, StateSpec, TopicPort};
use crate::task_set::StatePrecedence;

/// The graph made by the topics of a DAG.
#[derive(Clone, Default)]
pub(super) struct TopicGraph<'a> {
    /// Edges `(predecessor, successor)`, perhaps repeated, never from a subtask to itself.
    pub(super) edges: Vec<(u32, u32)>,
    /// Topics written but not read, each with its writer.
    pub(super) unread: Vec<(usize, &'a str)>,
}

/// An end of a topic.
#[derive(Clone, Copy)]
struct TopicEnd<'a> {
    /// The topic's number.
    topic: usize,
    dag: usize,
    subtask: usize,
    direction: TopicSide,
    port: &'a TopicPort,
}

/// The ends of a topic in a DAG, at most one writer and one reader entry for each subtask.
#[derive(Default)]
struct TopicEnds<'a> {
    writers: Vec<TopicEnd<'a>>,
    readers: Vec<TopicEnd<'a>>,
}

impl<'a> TopicEnds<'a> {
    fn fill(&mut self, ends: &[TopicEnd<'a>]) {
        self.writers.clear();
        self.readers.clear();
        for end in ends {
            let side = match end.direction {
                TopicSide::Output => &mut self.writers,
                TopicSide::Input => &mut self.readers,
            };
            // A topic stated twice at a subtask is a fault of its own, and one end for the other
            // checks.
            if side.last().is_none_or(|last| last.subtask != end.subtask) {
                side.push(*end);
            }
        }
    }
}

/// Checks all topics and their latest values, and returns the resulting graphs, DAG by DAG.
pub(super) fn check<'a>(
    options: &CommitOptions,
    findings: &mut VerifyFindings<'a>,
) -> Vec<TopicGraph<'a>> {
    let mut topologies = vec![TopicGraph::default(); findings.specs.len()];
    // Refilled for each topic, so that many topics do not mean as many allocations.
    let mut sides = TopicEnds::default();
    for ends in ends_by_topic(findings.specs).chunk_by(|one, other| one.topic == other.topic) {
        let first = ends[0];
        let of_dags = || ends.chunk_by(|one, other| one.dag == other.dag);
        let is_shared = ends.iter().any(|end| end.dag != first.dag);
        // Reported once, at the first DAG, with all DAGs that name the topic.
        if is_shared {
            let dags = of_dags().map(|ends| findings.label(ends[0].dag)).collect();
            let topic = first.port.topic.clone();
            let shared = |_| DagFault::TopicInSeveralDags { topic, dags };
            findings.findings_of(first.dag).fault(shared);
        }
        for ends in of_dags() {
            let page = &mut findings.findings_of(ends[0].dag);
            let topology = &mut topologies[ends[0].dag];
            sides.fill(ends);
            report_duplicates(ends, page);
            check_topic(options, &sides, is_shared, topology, page);
        }
    }
    for (dag, topology) in topologies.iter_mut().enumerate() {
        let page = &mut findings.findings_of(dag);
        for latest in &page.spec.latest {
            let unread = &mut topology.unread;
            // A sampled topic is read, so it is no longer unread.
            unread.retain(|&(_, topic)| topic != latest.port.topic);
            check_latest(latest, page);
        }
    }
    topologies
}

/// Returns all ends, grouped by topic, and within a topic in the order of DAGs and subtasks.
#[inline(never)]
fn ends_by_topic<'a>(specs: &[&'a DagSpec]) -> Vec<TopicEnd<'a>> {
    let subtasks = specs.iter().flat_map(|spec| &spec.subtasks);
    let count = subtasks.map(|subtask| subtask.inputs.len() + subtask.outputs.len());
    let mut topics = Interner::new(count.sum());
    let mut ends = Vec::new();
    for (dag, spec) in specs.iter().enumerate() {
        for (subtask, of) in spec.subtasks.iter().enumerate() {
            let inputs = of.inputs.iter().map(|port| (TopicSide::Input, port));
            let outputs = of.outputs.iter().map(|port| (TopicSide::Output, port));
            for (direction, port) in inputs.chain(outputs) {
                let topic = topics.intern(&port.topic);
                ends.push(TopicEnd {
                    topic,
                    dag,
                    subtask,
                    direction,
                    port,
                });
            }
        }
    }
    // Stable: within a topic, the order remains by DAG and subtask.
    let order = sorted_by_key(ends.len(), |end| ends[end].topic);
    order.into_iter().map(|end| ends[end]).collect()
}

/// Checks the ends of a topic in a DAG.
#[inline(never)]
fn check_topic<'a>(
    options: &CommitOptions,
    TopicEnds { writers, readers }: &TopicEnds<'a>,
    is_shared: bool,
    topology: &mut TopicGraph<'a>,
    page: &mut DagFindings<'_, '_>,
) {
    let Some(TopicEnd { port, .. }) = writers.first().or(readers.first()).copied() else {
        return;
    };
    let (spec, topic) = (page.spec, || port.topic.clone());
    let label = |end: &TopicEnd<'_>| SubtaskLabel::new(spec, end.subtask);

    if writers.len() > 1 && options.construction.writers == CountLimit::One {
        page.fault(|dag| DagFault::SeveralWriters {
            dag,
            topic: topic(),
            writers: writers.iter().map(label).collect(),
        });
    }
    match (writers.first(), readers.first()) {
        // Perhaps a sink writing for nobody; the check of the graph's shape decides.
        (Some(writer), None) if !is_shared => topology.unread.push((writer.subtask, &port.topic)),
        (None, Some(_)) if !is_shared => {
            for reader in readers {
                page.fault(|dag| DagFault::UnwrittenTopic {
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
        page.fault(|dag| DagFault::SeveralReaders {
            dag,
            topic: topic(),
            type_name: port.type_name,
            readers: readers.iter().map(label).collect(),
        });
    }
}

/// Reports a topic stated twice among the inputs, or twice among the outputs, of a subtask. Such
/// ends are neighbours in `ends`.
fn report_duplicates(ends: &[TopicEnd<'_>], page: &mut DagFindings<'_, '_>) {
    let kind = |end: &TopicEnd<'_>| (end.subtask, end.direction);
    for same in ends.chunk_by(|one, other| kind(one) == kind(other)) {
        if let [first, _, ..] = same {
            let subtask = page.subtask(first.subtask);
            page.fault(|dag| DagFault::DuplicateTopic {
                dag,
                subtask,
                topic: first.port.topic.clone(),
                direction: first.direction,
            });
        }
    }
}

/// Compares every reader with the first writer, and every further writer with the first reader:
/// linear, and every wrong end is named.
fn report_mismatches(
    writers: &[TopicEnd<'_>],
    readers: &[TopicEnd<'_>],
    page: &mut DagFindings<'_, '_>,
) {
    let spec = page.spec;
    // Against the first end only: n differing ends give n - 1 faults, not n times n.
    let with_first_writer = readers.iter().map(|reader| (&writers[0], reader));
    let with_first_reader = writers.iter().skip(1).map(|writer| (writer, &readers[0]));
    for (writer, reader) in with_first_writer.chain(with_first_reader) {
        if writer.port.type_id != reader.port.type_id {
            page.fault(|dag| DagFault::TypeMismatch {
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
    writers: &[TopicEnd<'_>],
    readers: &[TopicEnd<'_>],
    topology: &mut TopicGraph<'_>,
    page: &mut DagFindings<'_, '_>,
) {
    for (position, writer) in writers.iter().enumerate() {
        // If the policy allows a single writer, further writers are a fault already. One edge for
        // each keeps them connected without a product of two counts.
        let all = position == 0 || options.construction.writers != CountLimit::One;
        for reader in if all { readers } else { &readers[..1] } {
            if writer.subtask == reader.subtask {
                let subtask = page.subtask(writer.subtask);
                page.fault(|dag| DagFault::SelfEdge {
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
fn check_latest(latest: &LatestSpec, page: &mut DagFindings<'_, '_>) {
    let subtasks = page.spec.subtasks.iter();
    let topic = latest.port.topic.clone();
    if latest.samplers == 0 {
        let topic = topic.clone();
        page.fault(|dag| DagFault::LatestUnread { dag, topic });
    }
    let is_here = |other: &&TopicPort| other.topic == latest.port.topic;
    let mut writers = (subtasks.clone().enumerate())
        .filter_map(|(index, subtask)| Some((index, subtask.outputs.iter().find(is_here)?)));
    let Some((writer, written)) = writers.next() else {
        let meant = None;
        page.fault(|dag| DagFault::LatestUnwritten { dag, topic, meant });
        return;
    };
    if written.type_id != latest.port.type_id {
        let writer = page.subtask(writer);
        page.fault(|dag| DagFault::LatestTypeMismatch {
            dag,
            topic,
            writer,
            written: written.type_name,
            read: latest.port.type_name,
        });
        return;
    }
    let inputs = subtasks.flat_map(|subtask| subtask.inputs.iter().filter(is_here));
    // A sampler is a reader, too, and a moved value can have only one reader.
    let readers = inputs.count() + latest.samplers;
    if readers > 1 && !written.can_fan_out {
        page.fault(|dag| DagFault::LatestOfMoved {
            dag,
            topic,
            type_name: written.type_name,
            readers,
        });
    }
}

/// Checks the states of all DAGs.
pub(super) fn check_states(findings: &mut VerifyFindings<'_>) {
    for dag in 0..findings.specs.len() {
        let page = &mut findings.findings_of(dag);
        for (position, state) in page.spec.states.iter().enumerate() {
            let is_repeated = |other: &StateSpec| other.name == state.name;
            if page.spec.states[..position].iter().any(is_repeated) {
                let state = state.name.clone();
                page.fault(|dag| DagFault::DuplicateState { dag, state });
            }
            check_users(state, page);
        }
    }
}

#[inline(never)]
fn check_users(stated: &StateSpec, page: &mut DagFindings<'_, '_>) {
    let spec = page.spec;
    let label = |user: usize| SubtaskLabel::new(spec, user);
    let state = || stated.name.clone();
    let mut users: Vec<usize> = stated.users.iter().map(|user| user.subtask).collect();
    sort_by_key(&mut users, |user| user);
    match stated.users.first() {
        None => page.fault(|dag| DagFault::UnusedState {
            dag,
            state: state(),
        }),
        Some(first) if stated.users.iter().all(|user| !user.updates) => {
            page.fault(|dag| DagFault::StateNeverUpdated {
                dag,
                state: state(),
                reader: label(first.subtask),
            });
        }
        Some(_) => {}
    }
    for same in users.chunk_by(|one, other| one == other) {
        if let [subtask, _, ..] = *same {
            page.fault(|dag| DagFault::StateUsedTwice {
                dag,
                state: state(),
                subtask: label(subtask),
            });
        }
    }
    // Only now, since repeated users had to be reported first.
    users.dedup();
    // Without a stated number, the commit takes 1.
    if let Some(in_flight @ 2..) = spec.in_flight
        && stated.is_shared()
    {
        page.fault(|dag| DagFault::StateOverJobs {
            dag,
            state: state(),
            in_flight,
            users: users.into_iter().map(label).collect(),
        });
    }
}

/// Returns the precedences that shared states add to an acyclic graph.
#[inline(never)]
pub(super) fn order_users(spec: &DagSpec, graph: &Graph) -> Vec<StatePrecedence> {
    let mut precedences = Vec::new();
    if !spec.states.iter().any(StateSpec::is_shared) {
        return precedences;
    }
    let place = places(graph);
    for state in spec.states.iter().filter(|state| state.is_shared()) {
        let place_of = |user: usize| place.get(state.users[user].subtask).copied();
        let users = sorted_by_key(state.users.len(), place_of);
        // Users are in topological order, so no added edge closes a cycle.
        let users: Vec<_> = users.iter().map(|&user| state.users[user]).collect();
        let mut add = |earlier: usize, later: usize| {
            precedences.push(StatePrecedence {
                state: state.name.clone(),
                earlier: SubtaskId(to_u32(earlier)),
                later: SubtaskId(to_u32(later)),
            });
        };
        let mut updater: Option<usize> = None;
        let mut readers: Vec<usize> = Vec::new();
        for user in users {
            if !user.updates {
                if let Some(updater) = updater {
                    add(updater, user.subtask);
                }
                readers.push(user.subtask);
            } else {
                // Through the readers, the update also follows the previous update.
                let before = if readers.is_empty() {
                    updater.as_slice()
                } else {
                    &readers
                };
                for &before in before {
                    add(before, user.subtask);
                }
                readers.clear();
                updater = Some(user.subtask);
            }
        }
    }
    precedences
}

/// Returns each subtask's place in the order of a single core that always runs the first registered
/// ready subtask.
fn places(graph: &Graph) -> Vec<usize> {
    let mut missing = graph.predecessor_counts();
    let mut ready: BinaryHeap<Reverse<SubtaskId>> =
        graph.sources.iter().copied().map(Reverse).collect();
    let mut place = vec![0; missing.len()];
    let mut next = 0;
    while let Some(Reverse(subtask)) = ready.pop() {
        place[subtask.index()] = next;
        next += 1;
        for &successor in graph.successors.neighbours(subtask) {
            missing[successor.index()] -= 1;
            if missing[successor.index()] == 0 {
                ready.push(Reverse(successor));
            }
        }
    }
    place
}
