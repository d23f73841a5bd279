//! Numbers names in the order of their first appearance, and suggests corrections for wrong names.
//!
//! Commits of many thousand subtasks and topics look up every name once. So the table is a hash
//! table with open addressing, sized once; a tree or a sort would dominate the whole commit. The
//! hash is FNV-1a with a final mix, sufficient for names chosen by an app's author.
//!
//! # A topic with only one end
//!
//! A topic with a reader but no writer, or with a writer but no reader, is often another topic's
//! name with a slip of the pen. Its fault then suggests the nearest topic of the DAG as a remedy:
//! for a reader a written topic, for a writer a topic read but not written. Only the faults shown
//! in a message get suggestions, as each is compared with every topic of its DAG.

use alloc::vec;
use alloc::vec::Vec;

use super::MOST_FAULTS;
use super::fault::{DagFault, Warning};
use crate::fnv::{EMPTY, fnv_1a};
use crate::ids::SubtaskId;
use crate::nearest::nearest;
use crate::spec::{DagSpec, SubtaskSpec};

/// An empty slot of the table.
const FREE: u32 = u32::MAX;

/// A table of distinct names.
pub(super) struct Interner<'a> {
    /// Positions in `names`, at the hash's place or after it.
    table: Vec<u32>,
    names: Vec<(u64, &'a str)>,
}

impl<'a> Interner<'a> {
    /// Makes a table for at most `capacity` names.
    pub(super) fn new(capacity: usize) -> Self {
        let slots = (2 * capacity).next_power_of_two().max(2);
        Self {
            table: vec![FREE; slots],
            names: Vec::with_capacity(capacity),
        }
    }

    /// Returns the name's number, counted from 0; an unknown name gets the next number.
    pub(super) fn intern(&mut self, name: &'a str) -> usize {
        let hash = fnv_1a(EMPTY, name.as_bytes());
        let hash = hash ^ (hash >> 32);
        let mask = self.table.len() - 1;
        #[allow(clippy::cast_possible_truncation, reason = "low bits suffice")]
        let mut place = hash as usize & mask;
        loop {
            let entry = self.table[place];
            if entry == FREE {
                let number = self.names.len();
                self.table[place] = crate::ids::to_u32(number);
                self.names.push((hash, name));
                return number;
            }
            let number = entry as usize;
            let (known_hash, known) = self.names[number];
            if known_hash == hash && known == name {
                return number;
            }
            place = (place + 1) & mask;
        }
    }
}

/// Adds the topic that was probably meant to each of the first faults.
#[inline(never)]
pub(super) fn suggest(specs: &[&DagSpec], faults: &mut [DagFault]) {
    // Faults that no message shows need no advice.
    for index in 0..faults.len().min(MOST_FAULTS) {
        let found = match &faults[index] {
            DagFault::UnwrittenTopic {
                dag, topic, reader, ..
            } => {
                let spec = &specs[dag.id.index()];
                let own = own_topics(spec, reader.id);
                nearest(topic, &written(spec, &own))
            }
            DagFault::LatestUnwritten { dag, topic, .. } => {
                nearest(topic, &written(specs[dag.id.index()], &[]))
            }
            DagFault::UnreadTopic {
                dag, topic, writer, ..
            } => {
                let own = own_topics(specs[dag.id.index()], writer.id);
                let unwritten = faults.iter().filter_map(|fault| match fault {
                    DagFault::UnwrittenTopic {
                        dag: other, topic, ..
                    }
                    | DagFault::LatestUnwritten {
                        dag: other, topic, ..
                    } if other.id == dag.id => Some(topic.as_str()),
                    _ => None,
                });
                let wanted: Vec<&str> = unwritten.filter(|name| !own.contains(name)).collect();
                nearest(topic, &wanted)
            }
            _ => None,
        };
        let found = found.map(Into::into);
        if let DagFault::UnwrittenTopic { meant, .. }
        | DagFault::LatestUnwritten { meant, .. }
        | DagFault::UnreadTopic { meant, .. } = &mut faults[index]
        {
            *meant = found;
        }
    }
}

/// Adds, to the first warnings about a sink's unread value, the topic of the DAG that was probably
/// meant: a topic with a reader.
#[inline(never)]
pub(super) fn suggest_for_sinks(specs: &[&DagSpec], warnings: &mut [Warning]) {
    for warning in warnings.iter_mut().take(MOST_FAULTS) {
        if let Warning::UnreadSinkValue {
            dag,
            subtask,
            topic,
            meant,
        } = warning
        {
            let spec = specs[dag.id.index()];
            let own = own_topics(spec, subtask.id);
            let inputs = spec.subtasks.iter().flat_map(|subtask| &subtask.inputs);
            let read = inputs.map(|port| port.topic.as_str());
            let read: Vec<&str> = read.filter(|name| !own.contains(name)).collect();
            *meant = nearest(topic, &read).map(Into::into);
        }
    }
}

/// Returns the topics already used by a subtask, on either side.
fn own_topics(spec: &DagSpec, subtask: SubtaskId) -> Vec<&str> {
    let SubtaskSpec {
        inputs, outputs, ..
    } = &spec.subtasks[subtask.index()];
    let ports = inputs.iter().chain(outputs);
    ports.map(|port| port.topic.as_str()).collect()
}

/// Returns the written topics of a DAG, except for the given ones.
fn written<'s>(spec: &'s DagSpec, own: &[&str]) -> Vec<&'s str> {
    let outputs = spec.subtasks.iter().flat_map(|subtask| &subtask.outputs);
    let topics = outputs.map(|port| port.topic.as_str());
    topics.filter(|name| !own.contains(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_first_appearance() {
        let mut interner = Interner::new(4);
        let numbers: Vec<usize> = ["b", "a", "b", "", "a"]
            .into_iter()
            .map(|name| interner.intern(name))
            .collect();
        assert_eq!(numbers, [0, 1, 0, 2, 1]);
    }
}
