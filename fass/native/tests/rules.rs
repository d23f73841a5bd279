//! Native runs obey the rules: on threads, with real races between workers.
//!
//! Every body checks what R2 and R3 promise, with memory that is not synchronized by
//! anything but the scheduler (relaxed atomics, which the processor may reorder); and
//! every run is written down and held against R1 to R5.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Barrier};

use native::{Closure, Setting};
use sched_dag::{CommitOptions, ConstructionPolicy, DagSpec, Policy, SubtaskSpec, TaskSet, verify};

/// A DAG by its edges, whose subtasks have priorities by their numbers.
fn spec(subtasks: usize, edges: &[(usize, usize)], jobs: u64) -> DagSpec {
    DagSpec {
        period_ns: Some(100_000),
        relative_deadline_ns: Some(100_000),
        jobs: Some(jobs),
        subtasks: vec![SubtaskSpec::default(); subtasks],
        edges: edges.to_vec(),
        ..DagSpec::default()
    }
}

fn commit(specs: &[DagSpec], setting: Setting) -> TaskSet {
    let options = CommitOptions::new(setting.policy, setting.workers)
        .with_construction(ConstructionPolicy::any_graph());
    verify(specs, &options)
        .expect("the graphs are right")
        .task_set
}

/// Bodies that count their jobs and check that all predecessors are as far as they
/// have to be, and no successor is.
fn checking(task_set: &TaskSet) -> (Vec<Vec<Closure>>, Vec<Arc<[AtomicU64]>>) {
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

fn chain(length: usize) -> Vec<(usize, usize)> {
    (1..length).map(|later| (later - 1, later)).collect()
}

fn fork_join(parallel: usize) -> Vec<(usize, usize)> {
    let branches = 1..=parallel;
    branches.flat_map(|b| [(0, b), (b, parallel + 1)]).collect()
}

/// Layers of 8; each subtask follows three of the layer before.
fn layered(layers: usize) -> Vec<(usize, usize)> {
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

fn holds(specs: &[DagSpec]) {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for workers in 1..=3 {
            let setting = Setting { policy, workers };
            let task_set = commit(specs, setting);
            let (bodies, counts) = checking(&task_set);
            let recorded = native::run_recorded(task_set, bodies, setting);
            assert_eq!(recorded.violations, [], "{policy:?}, {workers} workers");
            for ((spec, done), statistics) in
                specs.iter().zip(&counts).zip(&recorded.report.statistics)
            {
                let jobs = spec.jobs.expect("stated");
                assert_eq!(statistics.completed, jobs);
                assert!(done.iter().all(|count| count.load(Relaxed) == jobs));
            }
            let expected: u64 = specs
                .iter()
                .map(|spec| spec.subtasks.len() as u64 * spec.jobs.expect("stated"))
                .sum();
            assert_eq!(recorded.instances, expected);

            // And once more at full speed, where nobody looks on.
            let task_set = commit(specs, setting);
            let (bodies, counts) = checking(&task_set);
            native::run(task_set, bodies, setting);
            let ends = counts.iter().zip(specs);
            for (done, spec) in ends {
                let jobs = spec.jobs.expect("stated");
                assert!(done.iter().all(|count| count.load(Relaxed) == jobs));
            }
        }
    }
}

#[test]
fn a_chain_obeys_r1_to_r5() {
    holds(&[spec(64, &chain(64), 60)]);
}

#[test]
fn a_fork_join_obeys_r1_to_r5() {
    for parallel in [1, 2, 4, 6, 16] {
        holds(&[spec(parallel + 2, &fork_join(parallel), 150)]);
    }
}

#[test]
fn a_layered_graph_obeys_r1_to_r5() {
    holds(&[spec(8 * 30, &layered(30), 15)]);
}

#[test]
fn dags_side_by_side_obey_r1_to_r5() {
    holds(&[
        spec(8, &chain(8), 100),
        spec(6, &fork_join(4), 100),
        spec(24, &layered(3), 100),
        spec(5, &[], 100),
    ]);
}

#[test]
fn both_workers_work() {
    let setting = Setting {
        policy: Policy::StaticPriority,
        workers: 2,
    };
    let task_set = commit(&[spec(6, &fork_join(4), 20)], setting);
    // The branches meet in pairs, and a worker that does not work meets nobody. How many
    // instances each worker has is up to the host, which may hold one of them back.
    let meeting = Arc::new(Barrier::new(2));
    let body = |subtask| {
        let meeting = Arc::clone(&meeting);
        Box::new(move |_| {
            if (1..=4).contains(&subtask) {
                meeting.wait();
            }
        }) as Closure
    };
    let bodies = vec![(0..6).map(body).collect()];
    let recorded = native::run_recorded(task_set, bodies, setting);
    assert_eq!(recorded.violations, []);
    assert!(recorded.by_worker.iter().all(|&instances| instances > 0));
}

#[test]
#[should_panic(expected = "the third job")]
fn a_panic_ends_the_run_with_its_message() {
    let setting = Setting {
        policy: Policy::StaticPriority,
        workers: 2,
    };
    let task_set = commit(&[spec(2, &chain(2), 10)], setting);
    let bodies: Vec<Vec<Closure>> = vec![vec![
        Box::new(|_| ()),
        Box::new(|job| assert!(job != 2, "the third job")),
    ]];
    native::run(task_set, bodies, setting);
}

#[test]
#[should_panic(expected = "give each one a limit")]
fn a_dag_without_end_is_refused() {
    let setting = Setting {
        policy: Policy::StaticPriority,
        workers: 1,
    };
    let endless = DagSpec {
        jobs: None,
        ..spec(1, &[], 1)
    };
    native::run(
        commit(&[endless], setting),
        vec![vec![Box::new(|_| ())]],
        setting,
    );
}
