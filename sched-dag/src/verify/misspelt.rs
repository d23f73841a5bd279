//! What was probably meant by a topic that has one end only.
//!
//! A topic that is read and that no subtask writes, or the other way round, is often
//! another one's name with a slip of the pen. Its fault then names the nearest topic of
//! the DAG that would mend it: for a reader a topic that is written, for a writer one
//! that is read and not written. Only the faults that a message tells are looked at,
//! as each is compared with every topic of its DAG.

use alloc::vec::Vec;

use super::MOST_FAULTS;
use super::fault::Fault;
use crate::ids::SubtaskId;
use crate::nearest::nearest;
use crate::spec::{DagSpec, SubtaskSpec};

/// Adds to the first faults which topic was probably meant.
#[inline(never)]
pub(super) fn suggest(specs: &[&DagSpec], faults: &mut [Fault]) {
    for index in 0..faults.len().min(MOST_FAULTS) {
        let found = match &faults[index] {
            Fault::UnwrittenTopic {
                dag, topic, reader, ..
            } => {
                let spec = &specs[dag.id.index()];
                let own = own_topics(spec, reader.id);
                nearest(topic, &written(spec, &own))
            }
            Fault::LatestUnwritten { dag, topic, .. } => {
                nearest(topic, &written(specs[dag.id.index()], &[]))
            }
            Fault::UnreadTopic {
                dag, topic, writer, ..
            } => {
                let own = own_topics(specs[dag.id.index()], writer.id);
                let unwritten = faults.iter().filter_map(|fault| match fault {
                    Fault::UnwrittenTopic {
                        dag: other, topic, ..
                    }
                    | Fault::LatestUnwritten {
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
        if let Fault::UnwrittenTopic { meant, .. }
        | Fault::LatestUnwritten { meant, .. }
        | Fault::UnreadTopic { meant, .. } = &mut faults[index]
        {
            *meant = found;
        }
    }
}

/// Returns the topics that a subtask has already, on either side.
fn own_topics(spec: &DagSpec, subtask: SubtaskId) -> Vec<&str> {
    let SubtaskSpec {
        inputs, outputs, ..
    } = &spec.subtasks[subtask.index()];
    let ports = inputs.iter().chain(outputs);
    ports.map(|port| port.topic.as_str()).collect()
}

/// Returns the topics of a DAG that are written, but for those of one subtask.
fn written<'s>(spec: &'s DagSpec, own: &[&str]) -> Vec<&'s str> {
    let outputs = spec.subtasks.iter().flat_map(|subtask| &subtask.outputs);
    let topics = outputs.map(|port| port.topic.as_str());
    topics.filter(|name| !own.contains(name)).collect()
}
