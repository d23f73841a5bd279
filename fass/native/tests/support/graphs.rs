//! Graphs, and bodies that check what R2 and R3 promise.
#![allow(dead_code, reason = "each test program uses some of it")]

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use native::{Closure, Setting};
use sched_dag::{
    Clusters, CommitOptions, ConstructionPolicy, DagSpec, SubtaskSpec, TaskSet, verify,
};

/// A DAG by its edges, whose subtasks have priorities by their numbers.
pub(crate) fn spec(subtasks: usize, edges: &[(usize, usize)], jobs: u64) -> DagSpec {
    DagSpec {
        period_ns: Some(100_000),
        relative_deadline_ns: Some(100_000),
        jobs: Some(jobs),
        subtasks: vec![SubtaskSpec::default(); subtasks],
        edges: edges.to_vec(),
        ..DagSpec::default()
    }
}

/// Commits DAGs for workers that are not divided.
pub(crate) fn commit(specs: &[DagSpec], setting: Setting) -> TaskSet {
    commit_divided(specs, setting, &[])
}

/// Commits DAGs for clusters of so many workers each.
pub(crate) fn commit_divided(specs: &[DagSpec], setting: Setting, sizes: &[u32]) -> TaskSet {
    let clusters = match sizes {
        [] => Clusters::Undivided,
        _ => Clusters::Of(sizes.to_vec()),
    };
    let options = CommitOptions::new(setting.policy, setting.workers)
        .with_construction(ConstructionPolicy::any_graph())
        .with_clusters(clusters);
    verify(specs, &options)
        .expect("the graphs are right")
        .task_set
}

/// Bodies that count their jobs and check that all predecessors are as far as they
/// have to be, and no successor is.
pub(crate) fn checking(task_set: &TaskSet) -> (Vec<Vec<Closure>>, Vec<Arc<[AtomicU64]>>) {
    let mut counts = Vec::new();
    let bodies = task_set.dags().iter().map(|dag| {
        let done: Arc<[AtomicU64]> = dag.subtasks().iter().map(|_| AtomicU64::new(0)).collect();
        counts.push(Arc::clone(&done));
        let ids = (0..dag.subtasks().len()).map(|index| u32::try_from(index).expect("few"));
        ids.map(|own| {
            let own = sched_dag::SubtaskId(own);
            let predecessors = dag.predecessors(own).to_vec();
            let successors = dag.successors(own).to_vec();
            let done = Arc::clone(&done);
            Box::new(move |job: u64| {
                let of = |subtask: &sched_dag::SubtaskId| done[subtask.index()].load(Relaxed);
                assert!(
                    predecessors.iter().all(|earlier| of(earlier) == job + 1),
                    "R2"
                );
                assert!(successors.iter().all(|later| of(later) == job), "R3");
                assert_eq!(of(&own), job, "one instance after the other");
                done[own.index()].store(job + 1, Relaxed);
            }) as Closure
        })
        .collect()
    });
    (bodies.collect(), counts)
}

/// Runs DAGs to the end, written down and at full speed: all jobs of all subtasks run, as the
/// rules say.
pub(crate) fn runs_all(specs: &[DagSpec], setting: Setting, sizes: &[u32]) {
    let jobs = |spec: &DagSpec| spec.jobs.expect("stated");
    let ran_all = |counts: &[Arc<[AtomicU64]>]| {
        for (done, spec) in counts.iter().zip(specs) {
            assert!(done.iter().all(|count| count.load(Relaxed) == jobs(spec)));
        }
    };
    let task_set = commit_divided(specs, setting, sizes);
    let (bodies, counts) = checking(&task_set);
    let recorded = native::run_recorded(task_set, bodies, setting);
    assert_eq!(recorded.violations, [], "{setting:?}, {sizes:?}");
    ran_all(&counts);
    for (statistics, spec) in recorded.report.statistics.iter().zip(specs) {
        assert_eq!(statistics.completed, jobs(spec));
    }
    let instances = specs
        .iter()
        .map(|spec| spec.subtasks.len() as u64 * jobs(spec));
    assert_eq!(recorded.instances, instances.sum::<u64>());

    // And once more at full speed, where nobody looks on.
    let task_set = commit_divided(specs, setting, sizes);
    let (bodies, counts) = checking(&task_set);
    native::run(task_set, bodies, setting);
    ran_all(&counts);
}

/// The edges of subtasks one after the other.
pub(crate) fn chain(length: usize) -> Vec<(usize, usize)> {
    (1..length).map(|later| (later - 1, later)).collect()
}

/// Those of so many side by side, between two.
pub(crate) fn fork_join(parallel: usize) -> Vec<(usize, usize)> {
    let branches = 1..=parallel;
    branches.flat_map(|b| [(0, b), (b, parallel + 1)]).collect()
}

/// Layers of 8; each subtask follows three of the layer before.
pub(crate) fn layered(layers: usize) -> Vec<(usize, usize)> {
    let mut edges = Vec::new();
    for subtask in 8..8 * layers {
        let before = (subtask / 8 - 1) * 8;
        let mut places = [subtask * 7 % 8, subtask * 5 % 8, (subtask / 3) % 8];
        places.sort_unstable();
        edges.extend(places.map(|place| (before + place, subtask)));
    }
    edges.dedup();
    edges
}
