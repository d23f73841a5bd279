//! The commit of a large random DAG against a walk of the same graph.
//!
//! The walk is the least that any look at a graph costs: depth first from every
//! subtask that was not seen before, over neighbours that lie side by side in
//! memory, without doing anything on the way. Both are measured in turn, so that
//! a change of the host's speed meets both.

use std::any::TypeId;
use std::time::Duration;

use sched_dag::analysis::{Overheads, Settings, answer};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, SubtaskSpec, TopicPort, verify,
};

use super::super::{ratio, shortest, time};

/// Subtasks of the DAG.
pub(super) const SUBTASKS: usize = 10_000;

/// Edges of the DAG, all different.
pub(super) const EDGES: usize = 30_000;

const ROUNDS: usize = 41;

/// What one form of the commit costs.
pub(super) struct Figure {
    pub(super) what: &'static str,
    pub(super) time: Duration,
    /// The time in walks of the graph.
    pub(super) walks: f64,
    /// Whether the limit is for this form.
    pub(super) is_limited: bool,
}

/// Measures the walk, and the commit with edges, with the answer about deadlines
/// added, and with a topic for each edge.
pub(super) fn measure() -> Vec<Figure> {
    let edges = random_edges();
    let by_edges = spec(&edges, false);
    let by_topics = spec(&edges, true);
    let graph = neighbours(&edges);
    let options = CommitOptions::new(Policy::StaticPriority, 8)
        .with_construction(ConstructionPolicy::any_graph());
    let commit = |spec: &DagSpec| {
        verify(std::slice::from_ref(spec), &options).expect("the random DAG is right")
    };
    let settings = Settings {
        policy: Policy::StaticPriority,
        preemption: Preemption::Enabled,
        cores: 8,
        overheads: Overheads::default(),
    };
    let commit_and_answer = |spec: &DagSpec| {
        let verified = commit(spec);
        let answer = answer(&verified.task_set, &settings);
        assert!(answer.is_proven(), "the DAG has time to spare");
        (verified, answer)
    };
    let (mut walks, mut edge_commits, mut topic_commits) = (Vec::new(), Vec::new(), Vec::new());
    let mut answers = Vec::new();
    for _ in 0..ROUNDS {
        walks.push(time(|| walk(&graph)));
        edge_commits.push(time(|| commit(&by_edges)));
        answers.push(time(|| commit_and_answer(&by_edges)));
        topic_commits.push(time(|| commit(&by_topics)));
    }
    let walk = shortest(walks);
    let figure = |what, times, is_limited| {
        let time = shortest(times);
        Figure {
            what,
            time,
            walks: ratio(time, walk),
            is_limited,
        }
    };
    vec![
        Figure {
            what: "depth-first walk",
            time: walk,
            walks: 1.0,
            is_limited: false,
        },
        figure("commit, edges", edge_commits, true),
        figure("commit with answer", answers, true),
        figure("commit, a topic an edge", topic_commits, false),
    ]
}

/// Draws different edges from smaller to larger positions of a shuffled order,
/// at most 16 to and from each subtask.
fn random_edges() -> Vec<(usize, usize)> {
    let mut state = 1_u64;
    let mut below = |limit: usize| {
        // A linear congruential generator (Knuth's MMIX), its upper half.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).expect("31 bits") % limit
    };
    let mut order: Vec<usize> = (0..SUBTASKS).collect();
    for position in (1..SUBTASKS).rev() {
        order.swap(position, below(position + 1));
    }
    let mut seen = std::collections::HashSet::new();
    let mut arity = vec![(0, 0); SUBTASKS];
    let mut edges = Vec::with_capacity(EDGES);
    while edges.len() < EDGES {
        let (one, other) = (below(SUBTASKS), below(SUBTASKS));
        let (from, to) = (order[one.min(other)], order[one.max(other)]);
        if from != to && arity[from].1 < 16 && arity[to].0 < 16 && seen.insert((from, to)) {
            arity[from].1 += 1;
            arity[to].0 += 1;
            edges.push((from, to));
        }
    }
    edges
}

fn spec(edges: &[(usize, usize)], by_topics: bool) -> DagSpec {
    let subtask = |index: usize| SubtaskSpec {
        name: format!("subtask_{index}"),
        wcet_ns: Some(1 + index as u64 % 97),
        ..SubtaskSpec::default()
    };
    let mut spec = DagSpec {
        name: "random".to_owned(),
        period_ns: Some(1_000_000),
        relative_deadline_ns: Some(1_000_000),
        subtasks: (0..SUBTASKS).map(subtask).collect(),
        ..DagSpec::default()
    };
    if by_topics {
        for (number, &(from, to)) in edges.iter().enumerate() {
            let port = TopicPort {
                topic: format!("topic_{number}"),
                type_id: TypeId::of::<u32>(),
                type_name: "u32",
                can_fan_out: true,
            };
            spec.subtasks[from].outputs.push(port.clone());
            spec.subtasks[to].inputs.push(port);
        }
    } else {
        spec.edges = edges.to_vec();
    }
    spec
}

/// All successors side by side, and where each subtask's begin.
struct Neighbours {
    starts: Vec<u32>,
    successors: Vec<u32>,
}

fn neighbours(edges: &[(usize, usize)]) -> Neighbours {
    let number = |index: usize| u32::try_from(index).expect("few subtasks");
    let mut sorted = edges.to_vec();
    sorted.sort_unstable();
    let starts = (0..=SUBTASKS).map(|from| number(sorted.partition_point(|edge| edge.0 < from)));
    Neighbours {
        starts: starts.collect(),
        successors: sorted.iter().map(|edge| number(edge.1)).collect(),
    }
}

fn walk(graph: &Neighbours) -> usize {
    let mut seen = vec![false; SUBTASKS];
    let mut pending = Vec::with_capacity(SUBTASKS);
    let mut visited = 0;
    for first in 0..SUBTASKS {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        pending.push(first);
        while let Some(subtask) = pending.pop() {
            visited += 1;
            let range = graph.starts[subtask] as usize..graph.starts[subtask + 1] as usize;
            for &successor in &graph.successors[range] {
                let successor = successor as usize;
                if !std::mem::replace(&mut seen[successor], true) {
                    pending.push(successor);
                }
            }
        }
    }
    visited
}
