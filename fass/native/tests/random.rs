//! Random sets on threads, whose jobs overlap, wait, are skipped and aborted.
//!
//! A recorded run's clock goes on by 1 ns at each completion, so short periods make
//! any load one likes. With idle workers serving busy ones, most completions are told
//! by another worker. Half of the sets have their workers divided into clusters.

#[path = "../../../sched-dag/tests/support/random.rs"]
mod random;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use native::{Closure, Setting};
use random::Random;
use sched_dag::{
    ClusterId, Clusters, CommitOptions, ConstructionPolicy, DagSpec, OverrunPolicy, Policy,
    Priority, SubtaskId, SubtaskSpec, TaskSet, verify,
};

fn draw(random: &mut Random) -> DagSpec {
    let subtasks = random.below(9) + 1;
    let density = random.between(10, 60);
    let edges = (0..subtasks).flat_map(|to| (0..to).map(move |from| (from, to)));
    let jobs = 40;
    let subtask = |random: &mut Random| SubtaskSpec {
        priority: Some(Priority(random.between(0, 5).try_into().expect("few"))),
        ..SubtaskSpec::default()
    };
    DagSpec {
        period_ns: Some(random.between(1, 4 * subtasks as u64)),
        relative_deadline_ns: Some(random.between(1, 40)),
        offset_ns: random.between(0, 10),
        jobs: Some(jobs),
        in_flight: Some(random.between(1, 4).try_into().expect("few")),
        overrun: match random.between(0, 2) {
            0 => OverrunPolicy::Queue,
            1 => OverrunPolicy::Skip,
            _ => OverrunPolicy::Abort,
        },
        edges: edges.filter(|_| random.chance(density)).collect(),
        subtasks: (0..subtasks).map(|_| subtask(random)).collect(),
        ..DagSpec::default()
    }
}

/// Bodies that check, of whatever jobs come, that predecessors are as far at least, and
/// that neither they nor a successor have been there before.
fn checking(task_set: &TaskSet) -> Vec<Vec<Closure>> {
    let of_dag = |dag: &sched_dag::Dag| {
        let ids = (0..).map(SubtaskId).take(dag.subtasks().len());
        // One more than the latest job.
        let done: Arc<[AtomicU64]> = ids.clone().map(|_| AtomicU64::new(0)).collect();
        ids.map(|own| {
            let (before, after) = (dag.predecessors(own).to_vec(), dag.successors(own).to_vec());
            let done = Arc::clone(&done);
            Box::new(move |job: u64| {
                let of = |subtask: &SubtaskId| done[subtask.index()].load(Relaxed);
                assert!(before.iter().all(|earlier| of(earlier) > job), "R2");
                assert!(after.iter().all(|later| of(later) <= job), "R3");
                assert!(of(&own) <= job, "one instance after the other");
                done[own.index()].store(job + 1, Relaxed);
            }) as Closure
        })
        .collect()
    };
    task_set.dags().iter().map(of_dag).collect()
}

/// Divides the workers of some sets, and puts each DAG into a cluster.
fn divide(random: &mut Random, workers: u32, specs: &mut [DagSpec]) -> Clusters {
    if random.chance(50) {
        return Clusters::Undivided;
    }
    let mut sizes: Vec<u32> = Vec::new();
    let mut left = workers;
    while left > 0 {
        let size = random.between(1, u64::from(left)).try_into().expect("few");
        sizes.push(size);
        left -= size;
    }
    for spec in specs {
        let cluster = random.below(sizes.len()).try_into().expect("few");
        spec.cluster = Some(ClusterId(cluster));
    }
    Clusters::Of(sizes)
}

#[test]
fn random_sets_obey_r1_to_r5() {
    let mut counts = [0; 4];
    for seed in 0..150 {
        let mut random = Random::new(seed);
        let mut specs: Vec<_> = (0..=random.below(3)).map(|_| draw(&mut random)).collect();
        let setting = Setting {
            policy: match random.chance(50) {
                true => Policy::Edf,
                false => Policy::StaticPriority,
            },
            workers: random.between(1, 4).try_into().expect("few"),
        };
        let clusters = divide(&mut random, setting.workers, &mut specs);
        let options = CommitOptions::new(setting.policy, setting.workers)
            .with_construction(ConstructionPolicy::any_graph())
            .with_clusters(clusters);
        let verified = verify(&specs, &options).expect("the sets are right");
        let bodies = checking(&verified.task_set);
        let recorded = native::run_recorded(verified.task_set, bodies, setting);
        assert_eq!(recorded.violations, [], "seed {seed}");
        for (statistics, spec) in recorded.report.statistics.iter().zip(&specs) {
            let ended = statistics.completed + statistics.skips + statistics.aborts;
            assert_eq!(Some(ended), spec.jobs, "seed {seed}: {statistics:?}");
            let happened = [
                statistics.queued,
                statistics.skips,
                statistics.aborts,
                statistics.misses,
            ];
            for (count, happened) in counts.iter_mut().zip(happened) {
                *count += happened;
            }
        }
    }
    // In queues, by skipping, by aborts and late.
    assert!(counts.iter().all(|&count| count > 500), "{counts:?}");
}
