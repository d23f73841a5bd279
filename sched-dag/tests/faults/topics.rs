//! Faults of topics, names and arity.

use sched_dag::{ConstructionPolicy, Count, DagSpec, LatestSpec, verify};

use crate::{assert_fault, assert_faults, dag, drive, options, port, rejected, subtask};

#[test]
fn a_misspelt_topic_is_reported_from_both_sides_and_makes_no_second_sink() {
    let mut spec = drive();
    spec.subtasks[1].outputs[0].topic = "obstacel".to_owned();
    assert_faults(
        &[spec],
        &[
            (
                "unwritten_topic",
                "`brake`...`obstacle`...did you mean `obstacel`? If not, ",
            ),
            ("not_connected", "2 parts"),
            (
                "unread_topic",
                "`fuse`...`obstacel`...did you mean `obstacle`? If not, ",
            ),
        ],
    );
    assert_fault(
        |spec| {
            spec.latest = vec![LatestSpec {
                port: port::<u32>("obstakle"),
                samplers: 1,
            }]
        },
        "latest_unwritten",
        "`obstakle`...did you mean `obstacle`? If not, ",
    );
}

#[test]
fn a_topic_that_would_be_another_fault_or_is_of_another_dag_is_not_suggested() {
    let said = |change: fn(&mut DagSpec)| {
        let mut spec = drive();
        change(&mut spec);
        let sonar = subtask("sonar", &[], &["near"]);
        let other = dag("park", vec![sonar, subtask("stop", &["near"], &[])]);
        rejected(&[spec, other]).to_string()
    };
    for (text, topic) in [
        // `fuse` reads `image` already, and so cannot mean it again.
        (
            said(|spec| spec.subtasks[1].inputs.push(port::<u32>("image2"))),
            "`image2`",
        ),
        // `image` has its writer.
        (
            said(|spec| spec.subtasks[1].outputs.push(port::<u32>("imagf"))),
            "`imagf`",
        ),
        (
            said(|spec| spec.subtasks[2].inputs.push(port::<u32>("nera"))),
            "`nera`",
        ),
    ] {
        assert!(
            text.contains(topic) && !text.contains("did you mean"),
            "{text}"
        );
    }
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
fn several_writers_are_refused_unless_the_policy_says_otherwise() {
    let mut spec = drive();
    spec.subtasks[0].outputs.push(port::<u32>("obstacle"));
    assert_faults(
        &[spec.clone()],
        &[(
            "several_writers",
            "`obstacle`...: subtask `camera`, subtask `fuse`;",
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
fn duplicates() {
    assert_fault(
        |spec| spec.subtasks[0].outputs.push(port::<u32>("image")),
        "duplicate_topic",
        "subtask `camera`...writes topic `image` twice",
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
            ("arity_too_large", "`from`...17 outputs"),
            ("arity_too_large", "`to`...17 inputs"),
        ],
    );
}
