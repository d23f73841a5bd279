//! Checks one DAG's graph as a whole: edges in range, sources, sinks, connection, cycles.
//!
//! # One shortest cycle for each knot of a graph
//!
//! A *knot* is a strongly connected component of two or more subtasks: a set in which each subtask
//! precedes every other. Knots are found by Kosaraju's two walks (Sharir, Computers and Mathematics
//! 7, 1981), without recursion. Each knot gets a single report, because the number of cycles may be
//! exponential. The report shows the shortest cycle, because that is the easiest to read.
//!
//! Finding the shortest cycle takes one breadth-first search from each subtask of the knot. All
//! searches of one graph share a budget of visited edges, so a wrong graph of any size is refused
//! in bounded time. When the budget is used up, the shortest cycle found so far is reported. Knots
//! of up to about a thousand subtasks stay within the budget.

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;

use super::fault::{DagFault, Warning};
use super::label::SubtaskLabel;
use super::topics::TopicGraph;
use super::{ConstructionPolicy, CountLimit, DagFindings, VerifyFindings, topics};
use crate::graph::{AdjacencyList, Graph};
use crate::ids::{SubtaskId, to_u32};
use crate::order::{sorted, sorted_by_key};
use crate::task_set::StatePrecedence;

/// Checks the graph of DAG number `dag`.
#[inline(never)]
pub(super) fn check(
    dag: usize,
    mut topology: TopicGraph<'_>,
    policy: ConstructionPolicy,
    findings: &mut VerifyFindings<'_>,
) -> (Graph, Vec<StatePrecedence>) {
    let page = &mut findings.findings_of(dag);
    let spec = page.spec;
    // Edges without topics and edges of topics are treated alike from here on.
    add_plain_edges(&mut topology.edges, page);
    let mut graph = Graph::new(spec.subtasks.len(), &topology.edges);
    check_connection(&graph, policy, page);
    check_sources(&graph, policy, page);
    check_sinks(&graph, policy, &topology.unread, page);
    check_deadlines(&graph, page);
    // One cycle for each knot: the author has to find the right edge to remove anyway.
    if !graph.is_acyclic() {
        for cycle in shortest_cycles(&graph) {
            let hops = labels(page, &cycle);
            page.fault(|dag| DagFault::Cycle { dag, hops });
        }
    }
    // Last, so that all other checks judge the graph stated by the author.
    let mut state_precedences = Vec::new();
    if graph.is_acyclic() {
        state_precedences = topics::order_users(spec, &graph);
    }
    if !state_precedences.is_empty() {
        let added = state_precedences.iter();
        let added = added.map(|added| (added.earlier.0, added.later.0));
        topology.edges.extend(added);
        graph = Graph::new(graph.len(), &topology.edges);
    }
    (graph, state_precedences)
}

/// Adds the edges stated without a topic.
fn add_plain_edges(edges: &mut Vec<(u32, u32)>, page: &mut DagFindings<'_, '_>) {
    let subtasks = page.spec.subtasks.len();
    edges.reserve(page.spec.edges.len());
    for &edge in &page.spec.edges {
        let (from, to) = edge;
        if from >= subtasks || to >= subtasks {
            page.fault(|dag| DagFault::EdgeOutOfRange {
                dag,
                edge,
                subtasks,
            });
        } else if from == to {
            let (subtask, topic) = (page.subtask(from), None);
            page.fault(|dag| DagFault::SelfEdge {
                dag,
                subtask,
                topic,
            });
        } else {
            edges.push((to_u32(from), to_u32(to)));
        }
    }
}

fn check_connection(graph: &Graph, policy: ConstructionPolicy, page: &mut DagFindings<'_, '_>) {
    if policy.parts == CountLimit::Several {
        return;
    }
    let (part_of, parts) = graph.parts();
    // Subtask 0 is in part 0, so no path connects it with any other part.
    if let Some(other) = part_of.iter().position(|&part| part != 0) {
        let (one, other) = (page.subtask(0), page.subtask(other));
        page.fault(|dag| DagFault::NotConnected {
            dag,
            parts,
            one,
            other,
        });
    }
}

/// Checks the sources. A subtask whose only inputs are topics without a writer has no predecessor,
/// but its author did not mean a source; the missing writer is reported by itself.
fn check_sources(graph: &Graph, policy: ConstructionPolicy, page: &mut DagFindings<'_, '_>) {
    let subtasks = &page.spec.subtasks;
    let is_source = |subtask: &SubtaskId| subtasks[subtask.index()].inputs.is_empty();
    // Judged by stated inputs, since a topic without a writer leaves no edge.
    let sources = graph.sources.iter().copied().filter(is_source);
    let sources = labels(page, &sources.collect::<Vec<_>>());
    // An empty DAG has a fault of its own.
    if sources.is_empty() && !subtasks.is_empty() {
        page.fault(|dag| DagFault::NoSource { dag });
    } else if sources.len() > 1 && policy.sources == CountLimit::One {
        page.fault(|dag| DagFault::SeveralSources { dag, sources });
    }
}

/// Checks the sinks. A topic without a reader is a fault, but at an accepted sink it is only a
/// value nobody uses. If the policy wants one sink and a subtask without outputs fits, then other
/// ends of the graph are not sinks but writers of unread topics, most likely misspelt.
#[inline(never)]
fn check_sinks(
    graph: &Graph,
    policy: ConstructionPolicy,
    unread: &[(usize, &str)],
    page: &mut DagFindings<'_, '_>,
) {
    let ends = &*graph.sinks;
    let mut writes_unread = alloc::vec![false; graph.len()];
    for &(writer, _) in unread {
        writes_unread[writer] = true;
    }
    // An end that writes an unread topic may be no sink: the topic may be misspelt.
    let silent = ends.iter().filter(|end| !writes_unread[end.index()]);
    let silent: Vec<SubtaskId> = silent.copied().collect();
    let wants_one = policy.sinks == CountLimit::One;
    let sinks = match wants_one && !silent.is_empty() {
        true => &silent,
        false => ends,
    };

    if sinks.is_empty() && graph.len() > 0 {
        page.fault(|dag| DagFault::NoSink { dag });
    } else if sinks.len() > 1 && wants_one {
        let sinks = labels(page, sinks);
        page.fault(|dag| DagFault::SeveralSinks { dag, sinks });
    }

    // The only end may write a value nobody reads; it is still the sink.
    let accepted = !wants_one || (silent.is_empty() && ends.len() == 1);
    for &(writer, topic) in unread {
        let is_end = ends.binary_search(&SubtaskId(to_u32(writer))).is_ok();
        let (writer, topic) = (page.subtask(writer), topic.into());
        if accepted && is_end {
            page.warn(|dag| Warning::UnreadSinkValue {
                dag,
                subtask: writer,
                topic,
                meant: None,
            });
        } else {
            page.fault(|dag| DagFault::UnreadTopic {
                dag,
                topic,
                writer,
                meant: None,
            });
        }
    }
}

/// Checks that only sinks have deadlines of their own.
fn check_deadlines(graph: &Graph, page: &mut DagFindings<'_, '_>) {
    let stated = &page.spec.subtasks;
    for subtask in graph.subtasks() {
        if stated[subtask.index()].relative_deadline_ns.is_some()
            && let Some(successor) = graph.successors.neighbours(subtask).first()
        {
            let (subtask, successor) = (subtask.index(), successor.index());
            let (subtask, successor) = (page.subtask(subtask), page.subtask(successor));
            page.fault(|dag| DagFault::DeadlineOfNoSink {
                dag,
                subtask,
                successor,
            });
        }
    }
}

fn labels(page: &DagFindings<'_, '_>, subtasks: &[SubtaskId]) -> Vec<SubtaskLabel> {
    let labels = subtasks.iter().map(|subtask| page.subtask(subtask.index()));
    labels.collect()
}

/// The maximum number of edges visited by all searches in one graph.
const BUDGET: usize = 4_000_000;

/// In no knot, or not found yet.
const NONE: u32 = u32::MAX;

/// Returns one cycle for each knot, starting from its smallest subtask.
fn shortest_cycles(graph: &Graph) -> Vec<Vec<SubtaskId>> {
    // A cycle lies within one strongly connected part, so each part is searched by itself.
    let knots = knots(graph);
    let mut knot_of = vec![NONE; graph.len()];
    for (number, knot) in knots.iter().enumerate() {
        for subtask in knot {
            knot_of[subtask.index()] = to_u32(number);
        }
    }
    let mut search = CycleSearch {
        graph,
        knot_of: &knot_of,
        found_by: vec![NONE; graph.len()],
        found_from: vec![SubtaskId(NONE); graph.len()],
        queue: VecDeque::new(),
        budget: BUDGET,
    };
    knots
        .iter()
        .filter_map(|knot| search.shortest_in(knot))
        .collect()
}

/// Returns the knots, each with its subtasks in ascending order.
#[inline(never)]
fn knots(graph: &Graph) -> Vec<Vec<SubtaskId>> {
    let (mut is_seen, mut ended) = (vec![false; graph.len()], Vec::new());
    for root in graph.subtasks() {
        walk(&graph.successors, root, &mut is_seen, &mut ended);
    }
    is_seen.fill(false);
    let mut knots: Vec<Vec<SubtaskId>> = Vec::new();
    // Backwards from the subtask that ended last, no edge leads out of its own part.
    for root in ended.into_iter().rev() {
        let mut knot = Vec::new();
        walk(&graph.predecessors, root, &mut is_seen, &mut knot);
        // A single subtask with an edge to itself was refused before.
        if knot.len() > 1 {
            knots.push(sorted(&knot));
        }
    }
    // Knots have no member in common, so their first members tell them apart.
    let order = sorted_by_key(knots.len(), |knot| knots[knot].first().copied());
    order
        .iter()
        .map(|&knot| core::mem::take(&mut knots[knot]))
        .collect()
}

/// Adds all unseen subtasks reachable from `root`, each after the subtasks reachable from it. The
/// path is a list instead of a recursion: a graph may be 100,000 subtasks deep.
fn walk(edges: &AdjacencyList, root: SubtaskId, is_seen: &mut [bool], ended: &mut Vec<SubtaskId>) {
    let mut enter = |subtask: SubtaskId| !core::mem::replace(&mut is_seen[subtask.index()], true);
    let mut path = Vec::new();
    path.extend(enter(root).then_some((root, 0)));
    while let Some((subtask, tried)) = path.last_mut() {
        if let Some(&next) = edges.neighbours(*subtask).get(*tried) {
            *tried += 1;
            path.extend(enter(next).then_some((next, 0)));
        } else {
            ended.push(*subtask);
            path.pop();
        }
    }
}

struct CycleSearch<'a> {
    graph: &'a Graph,
    knot_of: &'a [u32],
    /// The root of the last search that found a subtask.
    found_by: Vec<u32>,
    /// The predecessor through which the search found the subtask.
    found_from: Vec<SubtaskId>,
    queue: VecDeque<(SubtaskId, usize)>,
    budget: usize,
}

impl CycleSearch<'_> {
    fn shortest_in(&mut self, knot: &[SubtaskId]) -> Option<Vec<SubtaskId>> {
        let mut best: Option<Vec<SubtaskId>> = None;
        for &root in knot {
            let below = best.as_ref().map_or(usize::MAX, Vec::len);
            // Two is the length of the shortest possible cycle.
            if below == 2 || (self.budget == 0 && best.is_some()) {
                break;
            }
            // Only a shorter cycle is wanted, so the search ends early.
            if let Some(cycle) = self.shortest_through(root, below) {
                best = Some(cycle);
            }
        }
        let mut cycle = best?;
        let smallest = (0..cycle.len()).min_by_key(|&position| cycle[position])?;
        // The same cycle is reported the same way, wherever the search began.
        cycle.rotate_left(smallest);
        Some(cycle)
    }

    /// Returns a shortest cycle through `root` if it has fewer than `below` hops.
    fn shortest_through(&mut self, root: SubtaskId, below: usize) -> Option<Vec<SubtaskId>> {
        self.queue.clear();
        self.queue.push_back((root, 1));
        self.found_by[root.index()] = root.0;
        while let Some((subtask, hops)) = self.queue.pop_front() {
            // Breadth first: from here on, all paths are at least as long.
            if hops >= below {
                return None;
            }
            for &successor in self.graph.successors.neighbours(subtask) {
                // A large graph gets a cycle that may not be the shortest, rather than no answer in
                // time.
                self.budget = self.budget.saturating_sub(1);
                if successor == root {
                    return Some(self.way_back(subtask, root));
                }
                let to = successor.index();
                if self.knot_of[to] == self.knot_of[root.index()] && self.found_by[to] != root.0 {
                    self.found_by[to] = root.0;
                    self.found_from[to] = subtask;
                    self.queue.push_back((successor, hops + 1));
                }
            }
        }
        None
    }

    fn way_back(&self, last: SubtaskId, root: SubtaskId) -> Vec<SubtaskId> {
        let mut cycle = vec![last];
        let mut at = last;
        while at != root {
            at = self.found_from[at.index()];
            cycle.push(at);
        }
        cycle.reverse();
        cycle
    }
}
