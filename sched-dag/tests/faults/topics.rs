//! Faults of topics, names and arity.

use sched_dag::{ConstructionPolicy, Count, verify};

use crate::{assert_fault, assert_faults, dag, drive, options, port, rejected, subtask};

#[test]
fn topics_without_reader_or_writer() {
    assert_fault(
        |spec| spec.subtasks[0].outputs.push(port::<u32>("spare")),
        "unread_topic",
        "subtask `camera` of dag `drive` writes topic `spare`, which no subtask reads; register a reader or \
         drop the output",
    );
    assert_fault(
        |spec| spec.subtasks[1].inputs.push(port::<u32>("lidar")),
        "unwritten_topic",
        "subtask `fuse` of dag `drive` reads topic `lidar`, which no subtask writes; register a writer or \
         drop the input",
    );
}

#[test]
fn a_misspelt_topic_is_reported_from_both_sides_and_makes_no_second_sink() {
    let mut spec = drive();
    spec.subtasks[1].outputs[0].topic = "obstacel".to_owned();
    let rejected = rejected(&[spec]);
    let codes: Vec<&str> = rejected
        .faults()
        .iter()
        .map(sched_dag::Fault::code)
        .collect();
    assert_eq!(codes, ["unwritten_topic", "not_connected", "unread_topic"]);
    let texts = [0, 2].map(|fault| rejected.faults()[fault].to_string());
    assert_eq!(
        texts,
        [
            "subtask `brake` of dag `drive` reads topic `obstacle`, which no subtask writes; did you mean \
             `obstacel`? If not, register a writer or drop the input",
            "subtask `fuse` of dag `drive` writes topic `obstacel`, which no subtask reads; did you mean \
             `obstacle`? If not, register a reader or drop the output",
        ]
    );
}

#[test]
fn a_topic_that_would_be_another_fault_is_not_suggested() {
    // `fuse` reads `image` already, and so cannot mean it again.
    assert_fault(
        |spec| spec.subtasks[1].inputs.push(port::<u32>("image2")),
        "unwritten_topic",
        "subtask `fuse` of dag `drive` reads topic `image2`, which no subtask writes; register a writer or \
         drop the input",
    );
    // `image` has its writer.
    assert_fault(
        |spec| spec.subtasks[1].outputs.push(port::<u32>("imagf")),
        "unread_topic",
        "subtask `fuse` of dag `drive` writes topic `imagf`, which no subtask reads; register a reader or \
         drop the output",
    );
}

#[test]
fn a_topic_of_another_dag_is_not_suggested() {
    let mut spec = drive();
    spec.subtasks[2].inputs.push(port::<u32>("nera"));
    let other = dag(
        "park",
        vec![
            subtask("sonar", &[], &["near"]),
            subtask("stop", &["near"], &[]),
        ],
    );
    assert_faults(
        &[spec, other],
        &[(
            "unwritten_topic",
            "subtask `brake` of dag `drive` reads topic `nera`, which no subtask writes; register a writer \
             or drop the input",
        )],
    );
}

#[test]
fn of_many_misspelt_topics_those_that_are_told_get_a_suggestion() {
    let topics: Vec<String> = (0..25).map(|number| format!("topic {number:03}")).collect();
    let mut subtasks = vec![subtask("from", &[], &["start"])];
    for topic in &topics {
        let misspelt = topic.replace("topic", "topci");
        subtasks.push(subtask("", &["start"], &[topic.as_str()]));
        subtasks.push(subtask("", &[misspelt.as_str()], &[]));
    }
    let rejected = rejected(&[dag("", subtasks)]);
    let is_asked = |fault: &sched_dag::Fault| fault.to_string().contains("did you mean `topic 0");
    let asked: Vec<bool> = rejected.faults().iter().map(is_asked).collect();
    assert_eq!(asked[..20], [true; 20]);
    assert!(!asked[20..].contains(&true));
}

#[test]
fn an_unread_value_of_the_sink_is_a_warning() {
    let mut spec = drive();
    spec.subtasks[2].outputs.push(port::<u32>("force"));
    let verified = verify(&[spec], &options()).expect("only a warning");
    assert_eq!(verified.warnings.len(), 1);
    assert_eq!(verified.warnings[0].code(), "unread_sink_value");
    assert_eq!(
        verified.warnings[0].to_string(),
        "subtask `brake`, a sink of dag `drive`, writes topic `force`, which no subtask reads; drop the output"
    );
}

#[test]
fn a_type_mismatch_names_both_types() {
    assert_fault(
        |spec| spec.subtasks[2].inputs = vec![port::<i64>("obstacle")],
        "type_mismatch",
        "topic `obstacle` of dag `drive` is written as `u32` by subtask `fuse` and read as `i64` by subtask \
         `brake`; make both the same type",
    );
}

#[test]
fn several_writers_are_refused_unless_the_policy_says_otherwise() {
    let mut spec = drive();
    spec.subtasks[0].outputs.push(port::<u32>("obstacle"));
    assert_faults(
        &[spec.clone()],
        &[(
            "several_writers",
            "topic `obstacle` of dag `drive` has 2 writers: subtask `camera`, subtask `fuse`; give each a \
             topic of its own",
        )],
    );
    let construction = ConstructionPolicy {
        writers: Count::Several,
        ..ConstructionPolicy::paper()
    };
    let verified = verify(&[spec], &options().with_construction(construction)).expect("allowed");
    let brake = sched_dag::SubtaskId(2);
    assert_eq!(verified.task_set.dags()[0].predecessors(brake).len(), 2);
}

#[test]
fn a_message_that_can_only_be_moved_has_one_reader() {
    assert_fault(
        |spec| {
            spec.subtasks[2].inputs.push(port::<u32>("image"));
            spec.subtasks[0].outputs[0].can_fan_out = false;
        },
        "several_readers",
        "topic `image` of dag `drive` carries `u32`, which can only be moved, and has 2 readers: subtask \
         `fuse`, subtask `brake`; keep one reader or send a type that can be shared",
    );
}

#[test]
fn a_topic_stays_inside_one_dag() {
    let other = dag(
        "park",
        vec![
            subtask("sonar", &[], &["near"]),
            subtask("stop", &["near", "image"], &[]),
        ],
    );
    assert_faults(
        &[drive(), other],
        &[(
            "topic_in_several_dags",
            "topic `image` is used by 2 DAGs: dag `drive`, dag `park`; a topic stays inside one dag, so \
             rename it in the others",
        )],
    );
}

#[test]
fn duplicates() {
    assert_fault(
        |spec| spec.subtasks[2].name = "camera".to_owned(),
        "duplicate_subtask",
        "dag `drive` has two subtasks named `camera` (registered as number 0 and 2); rename one",
    );
    assert_fault(
        |spec| spec.subtasks[2].inputs.push(port::<u32>("obstacle")),
        "duplicate_topic",
        "subtask `brake` of dag `drive` reads topic `obstacle` twice; drop one of the inputs",
    );
    assert_fault(
        |spec| spec.subtasks[0].outputs.push(port::<u32>("image")),
        "duplicate_topic",
        "subtask `camera` of dag `drive` writes topic `image` twice; drop one of the outputs",
    );
    let mut twin = drive();
    for subtask in &mut twin.subtasks {
        for port in subtask.inputs.iter_mut().chain(&mut subtask.outputs) {
            port.topic.insert_str(0, "twin/");
        }
    }
    let verified = verify(&[drive(), twin], &options()).expect("only a warning");
    assert_eq!(
        verified.warnings[0].to_string(),
        "two DAGs are named `drive` (number 0 and 1); rename one"
    );
}

#[test]
fn arity_is_at_most_16() {
    let topics: Vec<String> = (0..17).map(|index| format!("t{index}")).collect();
    let topics: Vec<&str> = topics.iter().map(String::as_str).collect();
    let wide = |count: usize| {
        dag(
            "",
            vec![
                subtask("from", &[], &topics[..count]),
                subtask("to", &topics[..count], &[]),
            ],
        )
    };
    assert!(verify(&[wide(16)], &options()).is_ok());
    assert_faults(
        &[wide(17)],
        &[
            (
                "arity_too_large",
                "subtask `from` of dag 0 has 17 outputs, more than 16; bundle some into one message",
            ),
            (
                "arity_too_large",
                "subtask `to` of dag 0 has 17 inputs, more than 16; bundle some into one message",
            ),
        ],
    );
}
