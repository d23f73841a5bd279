//! Clusters: each is bounded as if it were alone on a machine of its own. (That it runs so, each
//! scenario tells, event by event.)

use sched_dag::analysis::{self, AnalysisResult, NotProvenReason};
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
fn an_undivided_machine_is_cluster_0() {
    let mut dag = support::dag(10, 10, 1, &[1], &[]);
    dag.cluster = Some(ClusterId(0));
    let task_set = support::commit(&[dag], TWO_CORES);
    assert!(!task_set.is_divided());
    assert_eq!(task_set.clusters().collect::<Vec<_>>(), [ClusterId(0)]);
    assert_eq!(task_set.cores_of(ClusterId(0), 2), 0..2);
    assert_eq!(task_set.dag(DagId(0)).subtask(SubtaskId(0)).priority().0, 1);
}
