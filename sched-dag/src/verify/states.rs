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
use super::findings::{Findings, Page};
use super::label::SubtaskLabel;
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
pub(super) fn check(findings: &mut Findings<'_>) {
    for dag in 0..findings.specs.len() {
        let page = &mut findings.of(dag);
        for (position, state) in page.spec.states.iter().enumerate() {
            let is_repeated = |other: &StateSpec| other.name == state.name;
            if page.spec.states[..position].iter().any(is_repeated) {
                let state = state.name.clone();
                page.fault(|dag| Fault::DuplicateState { dag, state });
            }
            check_users(state, page);
        }
    }
}

#[inline(never)]
fn check_users(stated: &StateSpec, page: &mut Page<'_, '_>) {
    let spec = page.spec;
    let label = |user: usize| SubtaskLabel::new(spec, user);
    let state = || stated.name.clone();
    let mut users: Vec<usize> = stated.users.iter().map(|user| user.subtask).collect();
    sort_by_key(&mut users, |user| user);
    match stated.users.first() {
        None => page.fault(|dag| Fault::UnusedState {
            dag,
            state: state(),
        }),
        Some(first) if stated.users.iter().all(|user| !user.updates) => {
            page.fault(|dag| Fault::StateNeverUpdated {
                dag,
                state: state(),
                reader: label(first.subtask),
            });
        }
        Some(_) => {}
    }
    for same in users.chunk_by(|one, other| one == other) {
        if let [subtask, _, ..] = *same {
            page.fault(|dag| Fault::StateUsedTwice {
                dag,
                state: state(),
                subtask: label(subtask),
            });
        }
    }
    users.dedup();
    if let Some(in_flight @ 2..) = spec.in_flight
        && is_shared(stated)
    {
        page.fault(|dag| Fault::StateOverJobs {
            dag,
            state: state(),
            in_flight,
            users: users.into_iter().map(label).collect(),
        });
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
