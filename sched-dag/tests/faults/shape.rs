//! Faults of the graph as a whole: cycles, sources, sinks, connection.

use sched_dag::{CommitOptions, ConstructionPolicy, DagSpec, Policy, SubtaskSpec, verify};

use crate::{assert_fault, assert_faults, dag, drive, options, port, rejected, subtask};

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
    let no_subtasks = [(
        "no_subtasks",
        "dag 0 has no subtask; register one or drop the DAG",
    )];
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
fn of_very_many_faults_the_first_are_written_and_all_are_there() {
    let dags: Vec<_> = (0..10_000).map(|n| dag(&format!("d{n}"), vec![])).collect();
    let rejected = rejected(&dags);
    assert_eq!(rejected.faults().len(), 10_000);
    let text = rejected.to_string();
    assert_eq!(text.lines().count(), 21);
    assert!(text.contains("dag `d19` has no subtask"), "{text}");
    assert!(text.ends_with("\nand 9980 more faults"), "{text}");
}
