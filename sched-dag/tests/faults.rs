//! Every fault of a commit: its code, and its text with offender and remedy.

use std::any::{TypeId, type_name};

use sched_dag::{
    CommitOptions, ConstructionPolicy, Count, DagSpec, Policy, Priority, Rejected, SubtaskSpec,
    TopicPort, verify,
};

fn port<T: 'static>(topic: &str) -> TopicPort {
    TopicPort {
        topic: topic.to_owned(),
        type_id: TypeId::of::<T>(),
        type_name: type_name::<T>(),
        can_fan_out: true,
    }
}

fn subtask(name: &str, inputs: &[&str], outputs: &[&str]) -> SubtaskSpec {
    SubtaskSpec {
        name: name.to_owned(),
        inputs: inputs.iter().map(|topic| port::<u32>(topic)).collect(),
        outputs: outputs.iter().map(|topic| port::<u32>(topic)).collect(),
        ..SubtaskSpec::default()
    }
}

fn dag(name: &str, subtasks: Vec<SubtaskSpec>) -> DagSpec {
    DagSpec {
        name: name.to_owned(),
        period_ns: Some(100),
        relative_deadline_ns: Some(50),
        subtasks,
        ..DagSpec::default()
    }
}

/// camera -> fuse -> brake over the topics `image` and `obstacle`.
fn drive() -> DagSpec {
    dag(
        "drive",
        vec![
            subtask("camera", &[], &["image"]),
            subtask("fuse", &["image"], &["obstacle"]),
            subtask("brake", &["obstacle"], &[]),
        ],
    )
}

fn options() -> CommitOptions {
    CommitOptions::new(Policy::StaticPriority, 2)
}

#[track_caller]
fn rejected(specs: &[DagSpec]) -> Rejected {
    verify(specs, &options()).expect_err("the commit has a fault")
}

/// Compares all faults, each as code and text.
#[track_caller]
fn assert_faults(specs: &[DagSpec], expected: &[(&str, &str)]) {
    let rejected = rejected(specs);
    let texts: Vec<String> = rejected.faults().iter().map(ToString::to_string).collect();
    let faults: Vec<(&str, &str)> = rejected
        .faults()
        .iter()
        .map(sched_dag::Fault::code)
        .zip(texts.iter().map(String::as_str))
        .collect();
    assert_eq!(faults, expected);
    assert_eq!(rejected.to_string(), texts.join("\n"));
}

/// Compares the only fault of `drive` after a change.
#[track_caller]
fn assert_fault(change: impl FnOnce(&mut DagSpec), code: &str, text: &str) {
    let mut spec = drive();
    change(&mut spec);
    assert_faults(&[spec], &[(code, text)]);
}

#[test]
fn a_right_dag_has_neither_fault_nor_warning() {
    let verified = verify(&[drive()], &options()).expect("no fault");
    assert_eq!(verified.warnings, []);
    let dag = &verified.task_set.dags()[0];
    assert_eq!(
        (dag.name(), dag.in_flight(), dag.jobs()),
        ("drive", 2, None)
    );
    let named = |ids: &[sched_dag::SubtaskId]| ids.iter().map(|id| id.0).collect::<Vec<_>>();
    assert_eq!(named(dag.sources()), [0]);
    assert_eq!(named(dag.sinks()), [2]);
    assert_eq!(named(dag.topological_order()), [0, 1, 2]);
}

#[test]
fn no_dags_no_cores_no_subtasks() {
    assert_faults(
        &[],
        &[(
            "no_dags",
            "the commit has no dag; create one and register its subtasks",
        )],
    );
    let no_cores = verify(&[drive()], &CommitOptions::new(Policy::Edf, 0)).expect_err("no core");
    assert_eq!(
        no_cores.to_string(),
        "the commit is for 0 cores; give the scheduler at least 1"
    );
    assert_faults(
        &[dag("", vec![])],
        &[(
            "no_subtasks",
            "dag 0 has no subtask; register one or drop the dag",
        )],
    );
}

#[test]
fn cycles_are_printed_hop_by_hop_one_a_knot_and_the_shortest() {
    let mut spec = dag(
        "knots",
        (0..8)
            .map(|index| subtask(&format!("s{index}"), &[], &[]))
            .collect(),
    );
    // A source, a ring of four with a short cut of three, and a pair.
    spec.edges = vec![
        (0, 4),
        (4, 3),
        (3, 2),
        (2, 1),
        (1, 4),
        (2, 4),
        (2, 5),
        (5, 6),
        (6, 5),
        (6, 7),
    ];
    assert_faults(
        &[spec],
        &[
            (
                "cycle",
                "dag `knots` has a cycle: subtask `s2` -> subtask `s4` -> subtask `s3` -> subtask `s2`; \
                 remove one of these edges",
            ),
            (
                "cycle",
                "dag `knots` has a cycle: subtask `s5` -> subtask `s6` -> subtask `s5`; remove one of these \
                 edges",
            ),
        ],
    );
}

#[test]
fn a_cycle_of_everything_leaves_neither_source_nor_sink() {
    let mut spec = dag("", vec![SubtaskSpec::default(), SubtaskSpec::default()]);
    spec.edges = vec![(0, 1), (1, 0)];
    assert_faults(
        &[spec],
        &[
            (
                "no_source",
                "dag 0 has no source: every subtask has an input; register a periodic subtask",
            ),
            (
                "no_sink",
                "dag 0 has no sink: every subtask has a successor; register a sink subtask",
            ),
            (
                "cycle",
                "dag 0 has a cycle: subtask 0 -> subtask 1 -> subtask 0; remove one of these edges",
            ),
        ],
    );
}

#[test]
fn edges_to_oneself_and_out_of_range() {
    assert_fault(
        |spec| spec.edges.push((1, 1)),
        "self_edge",
        "subtask `fuse` of dag `drive` precedes itself; remove the edge",
    );
    assert_fault(
        |spec| spec.subtasks[1].inputs.push(port::<u32>("obstacle")),
        "self_edge",
        "subtask `fuse` of dag `drive` reads topic `obstacle`, which it writes itself; keep the value in the \
         subtask's own state",
    );
    assert_fault(
        |spec| spec.edges.push((1, 3)),
        "edge_out_of_range",
        "dag `drive` has an edge from 1 to 3, but its 3 subtasks are counted from 0; correct the edge or \
         register the subtask",
    );
}

#[test]
fn several_parts_sources_and_sinks_under_the_papers_policy() {
    let mut spec = drive();
    spec.subtasks.push(subtask("logger", &[], &[]));
    assert_faults(
        &[spec.clone()],
        &[
            (
                "not_connected",
                "dag `drive` falls into 2 parts: no edge leads from the part of subtask `camera` to the part \
                 of subtask `logger`; connect them or make them dags of their own",
            ),
            (
                "several_sources",
                "dag `drive` has 2 sources: subtask `camera`, subtask `logger`; keep one, or choose a \
                 construction policy with several",
            ),
            (
                "several_sinks",
                "dag `drive` has 2 sinks: subtask `brake`, subtask `logger`; keep one, or choose a \
                 construction policy with several",
            ),
        ],
    );
    let relaxed = options().with_construction(ConstructionPolicy::any_graph());
    assert_eq!(verify(&[spec], &relaxed).expect("any graph").warnings, []);
}

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
            "topic `image` is used by 2 dags: dag `drive`, dag `park`; a topic stays inside one dag, so \
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
        "two dags are named `drive` (number 0 and 1); rename one"
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

#[test]
fn periods_deadlines_and_counts() {
    assert_fault(
        |spec| spec.period_ns = None,
        "missing_period",
        "dag `drive` has no period; register its source as a periodic subtask",
    );
    assert_fault(
        |spec| spec.period_ns = Some(0),
        "zero_period",
        "dag `drive` has a period of 0; give it at least 1 ns",
    );
    assert_fault(
        |spec| spec.relative_deadline_ns = None,
        "missing_deadline",
        "dag `drive` has no relative deadline; register its sink as a sink subtask with one",
    );
    assert_fault(
        |spec| spec.relative_deadline_ns = Some(0),
        "zero_deadline",
        "dag `drive` has a relative deadline of 0; give it at least 1 ns",
    );
    assert_fault(
        |spec| spec.jobs = Some(0),
        "zero_jobs",
        "dag `drive` has a limit of 0 jobs; give at least 1, or no limit",
    );
    assert_fault(
        |spec| spec.in_flight = Some(0),
        "zero_in_flight",
        "dag `drive` has room for 0 jobs in flight; give at least 1, or leave it out",
    );
    assert_fault(
        |spec| spec.subtasks[1].wcet_ns = Some(51),
        "wcet_exceeds_deadline",
        "subtask `fuse` of dag `drive` has a WCET of 51 ns, longer than the relative deadline of 50 ns; \
         shorten it or extend the deadline",
    );
}

#[test]
fn times_and_counts_never_wrap() {
    assert_fault(
        |spec| spec.offset_ns = u64::MAX - 50,
        "time_overflow",
        "the deadline of the first job of dag `drive` exceeds 18446744073709551615 ns, the last time there \
         is; lower the offset or the relative deadline",
    );
    assert_fault(
        |spec| spec.jobs = Some(u64::MAX / 100 + 1),
        "time_overflow",
        "the deadline of the last job of dag `drive` exceeds 18446744073709551615 ns, the last time there \
         is; lower the number of jobs, the period or the offset",
    );
    assert_fault(
        |spec| {
            spec.period_ns = Some(u64::MAX / 4);
            spec.relative_deadline_ns = Some(u64::MAX - 1);
            spec.jobs = Some(1);
            for subtask in &mut spec.subtasks {
                subtask.wcet_ns = Some(u64::MAX / 2);
            }
        },
        "time_overflow",
        "the sum of the WCETs of dag `drive` exceeds 18446744073709551615 ns, the last time there is; lower \
         the WCETs",
    );
    assert_fault(
        |spec| spec.in_flight = Some(u32::MAX),
        "too_many_instances",
        "the jobs in flight need 12884901885 instances, more than the limit of 1048576, and dag `drive` with \
         4294967295 jobs in flight needs most; lower its in_flight or raise the instance limit",
    );
    assert_fault(
        |spec| {
            spec.period_ns = Some(1);
            spec.relative_deadline_ns = Some(u64::MAX / 2);
        },
        "too_many_instances",
        "the jobs in flight need 27670116110564327424 instances, more than the limit of 1048576, and dag \
         `drive` with 9223372036854775808 jobs in flight needs most; lower its in_flight or raise the \
         instance limit",
    );
}

#[test]
fn all_faults_of_all_dags_are_reported_at_once() {
    let mut first = drive();
    first.period_ns = None;
    first.relative_deadline_ns = Some(0);
    first.subtasks[1].inputs[0] = port::<u8>("image");
    let second = dag("empty", vec![]);
    let rejected = rejected(&[first, second]);
    let codes: Vec<&str> = rejected
        .faults()
        .iter()
        .map(sched_dag::Fault::code)
        .collect();
    assert_eq!(
        codes,
        [
            "missing_period",
            "zero_deadline",
            "type_mismatch",
            "no_subtasks"
        ]
    );
}

#[test]
fn priorities_are_given_to_all_subtasks_of_a_dag_or_to_none() {
    let mut spec = drive();
    spec.subtasks[1].priority = Some(Priority(3));
    assert_faults(
        &[spec.clone()],
        &[(
            "priorities_partly_given",
            "dag `drive` has subtasks with and 2 without priority: subtask `camera`, subtask `brake`; give \
             each a priority, or none",
        )],
    );
    // Under EDF priorities play no part.
    assert!(verify(&[spec], &CommitOptions::new(Policy::Edf, 1)).is_ok());
}

#[test]
fn equal_priorities_and_a_wcet_of_0_are_warnings() {
    let mut spec = drive();
    for (subtask, priority) in spec.subtasks.iter_mut().zip([7, 2, 7]) {
        subtask.priority = Some(Priority(priority));
    }
    spec.subtasks[1].wcet_ns = Some(0);
    let verified = verify(&[spec], &options()).expect("only warnings");
    let texts: Vec<String> = verified.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(
        texts,
        [
            "subtask `fuse` of dag `drive` has a WCET of 0 ns; measure it, or leave the WCET out",
            "priority 7 is given 2 times: to subtask `camera` of dag `drive`, subtask `brake` of dag \
             `drive`; the order of registration decides between them",
        ]
    );
}
