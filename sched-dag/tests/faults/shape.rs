//! Faults of the graph as a whole: cycles, sources, sinks, connection.

use sched_dag::{ConstructionPolicy, DagSpec, SubtaskSpec, verify};

use crate::{assert_fault, assert_faults, dag, drive, options, rejected, subtask};

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
fn an_empty_dag_lacks_nothing_else_and_is_called_by_its_number() {
    let no_subtasks = [("no_subtasks", "dag 0 has")];
    assert_faults(&[dag("", vec![])], &no_subtasks);
    // Neither what subtasks would have stated is missed.
    assert_faults(&[DagSpec::default()], &no_subtasks);
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
                ": subtask `s2` -> subtask `s4` -> subtask `s3` -> subtask `s2`;",
            ),
            ("cycle", ": subtask `s5` -> subtask `s6` -> subtask `s5`;"),
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
            ("no_source", "dag 0"),
            ("no_sink", "dag 0"),
            ("cycle", "dag 0...: subtask 0 -> subtask 1 -> subtask 0;"),
        ],
    );
}

#[test]
fn an_edge_to_oneself() {
    let to_itself = |spec: &mut DagSpec| spec.edges.push((1, 1));
    assert_fault(to_itself, "self_edge", "subtask `fuse` of dag `drive`");
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
                "2 parts...subtask `camera`...subtask `logger`",
            ),
            (
                "several_sources",
                "2 sources: subtask `camera`, subtask `logger`",
            ),
            (
                "several_sinks",
                "2 sinks: subtask `brake`, subtask `logger`",
            ),
        ],
    );
    let relaxed = options().with_construction(ConstructionPolicy::any_graph());
    assert_eq!(verify(&[spec], &relaxed).expect("any graph").warnings, []);
}

#[test]
fn of_very_many_faults_the_first_are_written_and_all_are_there() {
    let dags: Vec<_> = (0..10_000).map(|n| dag(&format!("d{n}"), vec![])).collect();
    let rejected = rejected(&dags);
    assert_eq!(rejected.faults().len(), 10_000);
    let text = rejected.to_string();
    assert_eq!(text.lines().count(), 21);
    assert!(text.contains("dag `d19` has no subtask"), "{text}");
    assert!(text.ends_with("\nand 9980 more faults"), "{text}");
}
