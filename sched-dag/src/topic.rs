//! The topics of a verified DAG, for code that shows the graph.
//!
//! Scheduling needs only the edges, which are in [`Dag`](crate::Dag). The stated topics of the
//! edges are kept here.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;

use crate::ids::{SubtaskId, to_u32};
use crate::order::sorted;
use crate::spec::DagSpec;

/// A named, typed bundle of edges from one subtask to others of its DAG.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// The name.
    pub name: String,
    /// The name of the message's type, as given by the compiler.
    pub type_name: &'static str,
    /// The subtask writing the topic.
    pub writer: SubtaskId,
    /// The subtasks reading the topic, ascending.
    pub readers: Box<[SubtaskId]>,
    /// Whether subtasks, of any DAG, also read the topic's latest value.
    pub is_sampled: bool,
}

/// Collects the topics of a valid DAG, in the order of their writers and, within a writer, of its
/// outputs.
pub(crate) fn topics_of(spec: &DagSpec) -> Box<[Topic]> {
    let subtasks = spec.subtasks.iter().enumerate();
    let inputs = subtasks.flat_map(|(subtask, reader)| {
        let ports = reader.inputs.iter();
        ports.map(move |port| (&*port.topic, SubtaskId(to_u32(subtask))))
    });
    // By topic, then by reader.
    let inputs = sorted(&inputs.collect::<Vec<_>>());
    let is_sampled = |name: &str| spec.latest.iter().any(|latest| latest.port.topic == name);
    let mut topics = Vec::new();
    for (writer, of) in spec.subtasks.iter().enumerate() {
        for port in &of.outputs {
            let first = inputs.partition_point(|&(topic, _)| topic < &*port.topic);
            let of_topic = inputs[first..]
                .iter()
                .take_while(|&&(topic, _)| topic == port.topic);
            topics.push(Topic {
                name: port.topic.clone(),
                type_name: port.type_name,
                writer: SubtaskId(to_u32(writer)),
                readers: of_topic.map(|&(_, reader)| reader).collect(),
                is_sampled: is_sampled(&port.topic),
            });
        }
    }
    topics.into_boxed_slice()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{SubtaskSpec, TopicPort};
    use alloc::vec;
    use core::any::TypeId;

    fn ports(names: &[&str]) -> Vec<TopicPort> {
        let port = |name: &&str| TopicPort {
            topic: (*name).into(),
            type_id: TypeId::of::<u8>(),
            type_name: "u8",
            can_fan_out: true,
        };
        names.iter().map(port).collect()
    }

    fn subtask(inputs: &[&str], outputs: &[&str]) -> SubtaskSpec {
        SubtaskSpec {
            inputs: ports(inputs),
            outputs: ports(outputs),
            ..SubtaskSpec::default()
        }
    }

    #[test]
    fn each_topic_has_its_writer_and_all_its_readers() {
        let spec = DagSpec {
            subtasks: vec![
                subtask(&["b"], &[]),
                subtask(&[], &["b", "a"]),
                subtask(&["a", "b"], &[]),
            ],
            ..DagSpec::default()
        };
        let topics = topics_of(&spec);
        let [b, a] = &topics[..] else {
            panic!("{topics:?}");
        };
        assert_eq!((a.name.as_str(), a.writer), ("a", SubtaskId(1)));
        assert_eq!(*a.readers, [SubtaskId(2)]);
        assert_eq!(*b.readers, [SubtaskId(0), SubtaskId(2)]);
        assert_eq!((b.type_name, b.is_sampled), ("u8", false));
    }
}
