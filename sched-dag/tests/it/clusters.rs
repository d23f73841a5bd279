//! Clusters: each is bounded as if it were alone on a machine of its own. (That it runs so, each
//! scenario tells, event by event.)

use sched_dag::analysis::{self, AnalysisResult, NotProvenReason, SchedulabilityTest};
use sched_dag::{
    ClusterId, CommitOptions, ConstructionPolicy, CoreDivision, DagId, DagSpec, Policy, Preemption,
    SubtaskId, verify,
};

use crate::analysis::{bounds, settings};
use crate::support::{self, TWO_CORES};

/// Two DAGs of 6 ms each in 10, and one of unknown length.
fn three() -> [DagSpec; 3] {
    [(0, Some(6)), (1, Some(6)), (1, None)].map(|(cluster, wcet_ns)| {
        let mut dag = support::dag(10, 10, 1, &[1], &[]);
        dag.subtasks[0].wcet_ns = wcet_ns;
        dag.cluster = Some(ClusterId(cluster));
        dag
    })
}

/// Analyses DAGs in two clusters of one core.
fn answer(specs: &[DagSpec]) -> (AnalysisResult, String) {
    let settings = settings((Policy::Edf, Preemption::Enabled), 2);
    let options = CommitOptions::new(Policy::Edf, 2)
        .with_construction(ConstructionPolicy::any_graph())
        .with_clusters(CoreDivision::Of(vec![1, 1]));
    let task_set = verify(specs, &options).expect("sets are right").task_set;
    let answer = analysis::answer(&task_set, &settings);
    (answer, analysis::witness(&task_set, &settings))
}

#[test]
fn each_cluster_is_analysed_on_its_own_cores() {
    let (one_each, _) = answer(&three()[..2]);
    assert_eq!(bounds(&one_each), [Some(6), Some(6)]);
    assert_eq!(one_each.sinks_ns, [[Some(6)], [Some(6)]]);
    // Both on one core: that is too much for it, and the other cluster's core is no help.
    let (one_for_both, _) = answer(&[three()[1].clone(), three()[1].clone()]);
    assert!(
        one_for_both
            .reasons
            .contains(&Some(NotProvenReason::Overload))
    );
}

#[test]
fn what_is_unknown_in_one_cluster_weakens_nothing_in_another() {
    let (answer, witness) = answer(&three());
    assert_eq!(answer.bounds[0].unwrap().bound_ns, 6);
    assert_eq!(
        answer.reasons[1],
        Some(NotProvenReason::DelayedBy { dag: DagId(2) })
    );
    let unknown = answer.first_failing.unwrap();
    assert_eq!(unknown.dag, DagId(2));
    assert!(
        matches!(unknown.reason, NotProvenReason::Unknown(_)),
        "{unknown:?}"
    );
    let begins = |line: &&str| line.starts_with("machine 1 ");
    assert_eq!(witness.lines().filter(begins).count(), 2, "one for each");
}

#[test]
fn bounds_of_pinned_subtasks_need_an_order_on_cores_of_their_own() {
    let mut specs = three();
    specs[2].subtasks[0].wcet_ns = Some(1);
    let before = answer(&specs).0;
    assert!(before.is_proven());
    // On its core it goes first, whatever the deadlines.
    specs[2].subtasks[0].core = Some(0);
    let owned = answer(&specs).0;
    let bounds = owned.bounds.iter().map(|bound| {
        let bound = bound.as_ref().unwrap();
        (bound.bound_ns, bound.test)
    });
    let (first, other) = (before.bounds[0].unwrap(), before.bounds[1].unwrap());
    let expected = [
        (first.bound_ns, first.test),
        (other.bound_ns, SchedulabilityTest::Member),
        (1, SchedulabilityTest::Owner),
    ];
    assert_eq!(bounds.collect::<Vec<_>>(), expected);
    // No edge says which of two goes first.
    let again = specs[2].subtasks[0].clone();
    specs[2].subtasks.push(again);
    let (unordered, _) = answer(&specs);
    let pinned = |subtask| NotProvenReason::Pinned {
        subtask: SubtaskId(subtask),
    };
    let behind = NotProvenReason::DelayedBy { dag: DagId(2) };
    assert_eq!(unordered.reasons, [None, Some(behind), Some(pinned(1))]);
    assert_eq!(unordered.first_failing.unwrap().dag, DagId(2));
    // Of two DAGs on one core neither has it to itself, and each counts for the other.
    specs[2].subtasks.pop();
    specs[1].subtasks[0].core = Some(0);
    let (shared, _) = answer(&specs);
    let beside = SchedulabilityTest::BesidePins;
    let tests = shared.bounds.iter().map(|bound| bound.unwrap().test);
    assert_eq!(tests.collect::<Vec<_>>(), [first.test, beside, beside]);
}

#[test]
fn an_undivided_machine_is_cluster_0() {
    let mut dag = support::dag(10, 10, 1, &[1], &[]);
    dag.cluster = Some(ClusterId(0));
    let task_set = support::commit(&[dag], TWO_CORES);
    assert!(!task_set.is_divided());
    assert_eq!(task_set.clusters().collect::<Vec<_>>(), [ClusterId(0)]);
    assert_eq!(task_set.cores_of(ClusterId(0), 2), 0..2);
    assert_eq!(task_set.dag(DagId(0)).subtask(SubtaskId(0)).priority().0, 1);
}
