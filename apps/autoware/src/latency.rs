//! The latencies from the lidars to their effects, computed from a run's record.

use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

use sched_dag::law::RunRecord;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

/// The latencies of one run, in nanoseconds.
#[derive(Clone, Debug, Default)]
pub struct Latencies {
    /// From the lidars' nominal release to the completion of `ObjectCollisionEstimator`, for each
    /// of the lidars' jobs.
    pub hot_path_ns: Vec<u64>,
    /// From the lidars' nominal release to the completion of `VehicleDBWSystem`, for each job of
    /// the *vehicle* that has acted on a lidar job: the age of the data behind the action.
    pub to_vehicle_ns: Vec<u64>,
    /// The jobs of the vehicle that acted on the same lidar job as the vehicle's job before,
    /// because no newer lidar job was complete.
    pub repeated: u64,
    /// The lidar jobs on which no job of the vehicle has acted.
    pub unused: u64,
}

impl Latencies {
    /// Measures a run of the system.
    pub fn of(task_set: &TaskSet, record: &RunRecord, acted_on: &[AtomicU64]) -> Self {
        let [lidar, behaviour] = ["lidar", "behaviour"].map(|dag| task_set.find(dag));
        let finish_ns = |dag, job, name| {
            let subtask = find(task_set, dag, name)?;
            let instance = Instance { dag, job, subtask };
            record.instance(instance)?.finish_ns
        };
        let release_ns = |job| record.job(lidar, job)?.release_ns;
        let mut latencies = Self::default();
        for (job, _) in record.numbered(lidar) {
            let finish_ns = finish_ns(lidar, job, "ObjectCollisionEstimator");
            let (Some(release_ns), Some(finish_ns)) = (release_ns(job), finish_ns) else {
                continue;
            };
            latencies
                .hot_path_ns
                .push(finish_ns.saturating_sub(release_ns));
        }
        let mut last = None;
        for (job, seen) in (0u64..).zip(acted_on) {
            let seen = seen.load(Ordering::Relaxed);
            let finish_ns = finish_ns(behaviour, job, "VehicleDBWSystem");
            let (Some(release_ns), Some(finish_ns)) = (release_ns(seen), finish_ns) else {
                continue;
            };
            latencies
                .to_vehicle_ns
                .push(finish_ns.saturating_sub(release_ns));
            match last {
                Some(before) if before == seen => latencies.repeated += 1,
                Some(before) => latencies.unused += seen.saturating_sub(before + 1),
                None => latencies.unused += seen,
            }
            last = Some(seen);
        }
        latencies
    }
}

fn find(task_set: &TaskSet, dag: DagId, name: &str) -> Option<SubtaskId> {
    let subtasks = task_set.dags().get(dag.index())?.subtasks();
    let mut ids = (0..).map(SubtaskId).zip(subtasks);
    ids.find(|(_, subtask)| subtask.name() == name)
        .map(|(id, _)| id)
}
