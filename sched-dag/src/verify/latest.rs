//! The checks of latest values: topics with readers that wait for nothing.
//!
//! Such a reader may belong to any DAG and makes no edge. For the topic it is one
//! reader more: the topic is not unread, the types must agree, and a message that
//! can only be moved can have no other reader.

use alloc::vec::Vec;

use super::fault::Fault;
use super::findings::Findings;
use super::label::{DagLabel, SubtaskLabel};
use super::topics::Topology;
use crate::spec::{DagSpec, LatestSpec};

/// Checks all latest values, and takes their topics out of the unread ones.
pub(super) fn check(specs: &[&DagSpec], topologies: &mut [Topology<'_>], findings: &mut Findings) {
    for (dag, topology) in topologies.iter_mut().enumerate() {
        for latest in &specs[dag].latest {
            topology
                .unread
                .retain(|&(_, topic)| topic != latest.port.topic);
            check_one(specs, dag, latest, findings);
        }
    }
}

#[inline(never)]
fn check_one(specs: &[&DagSpec], dag: usize, latest: &LatestSpec, findings: &mut Findings) {
    let spec = &specs[dag];
    let label = DagLabel::new(specs, dag);
    let topic = latest.port.topic.clone();
    if latest.samplers == 0 {
        let (dag_label, topic) = (label.clone(), topic.clone());
        findings.fault(
            dag,
            Fault::LatestUnread {
                dag: dag_label,
                topic,
            },
        );
    }
    let is_here = |other: &&_| -> bool { is_topic(other, &topic) };
    let writers = (spec.subtasks.iter().enumerate())
        .filter_map(|(index, subtask)| Some((index, subtask.outputs.iter().find(is_here)?)));
    let Some((writer, written)) = writers.into_iter().next() else {
        findings.fault(
            dag,
            Fault::LatestUnwritten {
                dag: label,
                topic,
                meant: None,
            },
        );
        return;
    };
    if written.type_id != latest.port.type_id {
        findings.fault(
            dag,
            Fault::LatestTypeMismatch {
                dag: label,
                topic,
                writer: SubtaskLabel::new(spec, writer),
                written: written.type_name,
                read: latest.port.type_name,
            },
        );
        return;
    }
    let inputs: Vec<_> = (spec.subtasks.iter())
        .flat_map(|subtask| subtask.inputs.iter().filter(is_here))
        .collect();
    let readers = inputs.len() + latest.samplers;
    if readers > 1 && !written.can_fan_out {
        findings.fault(
            dag,
            Fault::LatestOfMoved {
                dag: label,
                topic,
                type_name: written.type_name,
                readers,
            },
        );
    }
}

fn is_topic(port: &crate::spec::TopicPort, topic: &str) -> bool {
    port.topic == topic
}
