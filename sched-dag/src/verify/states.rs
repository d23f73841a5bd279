//! States that subtasks of one DAG share: their checks, and their precedence.
//!
//! Words: a subtask that *updates* a state may change it, one that *reads* it may
//! not. Two uses *conflict* unless both read. Conflicting uses must not overlap,
//! and which one is first must not depend on execution times.
//!
//! # The order of a state's users
//!
//! Within a job the users take turns in the order in which one core would run the
//! DAG as stated, if it always took the ready subtask that was registered first.
//! So a path decides, and where there is none, the order of registration. For
//! each pair of neighbours that conflict an edge is added; readers between two
//! updates stay parallel. All edges follow one order that all paths follow, so
//! they close no cycle.
//!
//! Jobs take turns as well: the commit allows one in flight. Job k + 1 finds the
//! states as job k left them.
//!
//! The analysis sees nothing but a DAG with some more edges. There is no lock, so
//! nothing is ever blocked by a state and no priority is inverted.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use super::fault::Fault;
use super::findings::Findings;
use super::label::{DagLabel, SubtaskLabel};
use crate::graph::Graph;
use crate::ids::{SubtaskId, to_u32};
use crate::order::{sort_by_key, sorted_by_key};
use crate::spec::{DagSpec, StateSpec};
use crate::task_set::StatePrecedence;

/// Reports whether several subtasks use a state; one alone is in order by itself.
pub(super) fn is_shared(state: &StateSpec) -> bool {
    let first = state.users.first();
    first.is_some_and(|first| state.users.iter().any(|user| user.subtask != first.subtask))
}

/// Checks the states of all DAGs.
pub(super) fn check(specs: &[&DagSpec], findings: &mut Findings) {
    for (dag, spec) in specs.iter().enumerate() {
        for (position, state) in spec.states.iter().enumerate() {
            let is_repeated = |other: &StateSpec| other.name == state.name;
            if spec.states[..position].iter().any(is_repeated) {
                let (label, state) = (DagLabel::new(specs, dag), state.name.clone());
                findings.fault(dag, Fault::DuplicateState { dag: label, state });
            }
            check_users(specs, dag, state, findings);
        }
    }
}

#[inline(never)]
fn check_users(specs: &[&DagSpec], dag: usize, state: &StateSpec, findings: &mut Findings) {
    let spec = &specs[dag];
    let label = || DagLabel::new(specs, dag);
    let user = |user: usize| SubtaskLabel::new(spec, user);
    let name = || state.name.clone();
    let mut users: Vec<usize> = state.users.iter().map(|user| user.subtask).collect();
    sort_by_key(&mut users, |user| user);
    match state.users.first() {
        None => findings.fault(
            dag,
            Fault::UnusedState {
                dag: label(),
                state: name(),
            },
        ),
        Some(first) if state.users.iter().all(|user| !user.updates) => findings.fault(
            dag,
            Fault::StateNeverUpdated {
                dag: label(),
                state: name(),
                reader: user(first.subtask),
            },
        ),
        Some(_) => {}
    }
    for same in users.chunk_by(|one, other| one == other) {
        if let [subtask, _, ..] = *same {
            findings.fault(
                dag,
                Fault::StateUsedTwice {
                    dag: label(),
                    state: name(),
                    subtask: user(subtask),
                },
            );
        }
    }
    users.dedup();
    if let Some(in_flight) = spec.in_flight.filter(|&jobs| jobs > 1)
        && is_shared(state)
    {
        findings.fault(
            dag,
            Fault::StateOverJobs {
                dag: label(),
                state: name(),
                in_flight,
                users: users.into_iter().map(user).collect(),
            },
        );
    }
}

/// Returns the precedence that shared states add to a graph without cycle.
#[inline(never)]
pub(super) fn order_users(spec: &DagSpec, graph: &Graph) -> Vec<StatePrecedence> {
    let mut precedences = Vec::new();
    if !spec.states.iter().any(is_shared) {
        return precedences;
    }
    let place = places(graph);
    for state in spec.states.iter().filter(|state| is_shared(state)) {
        let place_of = |user: usize| place.get(state.users[user].subtask).copied();
        let users = sorted_by_key(state.users.len(), place_of);
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
                // Through the readers it also follows the update before them.
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

/// Returns each subtask's place in the order in which one core runs the DAG if it
/// always takes the first registered of the ready ones.
fn places(graph: &Graph) -> Vec<usize> {
    let mut missing = graph.predecessor_counts();
    let mut ready: BinaryHeap<Reverse<SubtaskId>> =
        graph.sources.iter().copied().map(Reverse).collect();
    let mut place = vec![0; missing.len()];
    let mut next = 0;
    while let Some(Reverse(subtask)) = ready.pop() {
        place[subtask.index()] = next;
        next += 1;
        for &successor in graph.successors.of(subtask) {
            missing[successor.index()] -= 1;
            if missing[successor.index()] == 0 {
                ready.push(Reverse(successor));
            }
        }
    }
    place
}
