//! The same graph in each cluster: the cost of an instance with more and more clusters.
//!
//! The clusters work one after the other. With counted time all cores share a clock, and computing
//! cores take time slices: if several clusters worked together, waits for slices would be counted,
//! too.

use alloc::format;
use alloc::vec::Vec;
use core::time::Duration;

use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use hand_off::{BodyStamps, Shape, Stamping, Workload, build};
use kernel::{AppError, Machine};

use crate::values::emit;

/// Room for a job.
const PERIOD: Duration = Duration::from_millis(4);

const SUBTASKS: usize = 100;

const WORKLOAD: &str = "layered-100";

/// Layered graphs, one in each cluster: the instructions of all cores from a release to the
/// sink, for each instance.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.offer_clusters()?;
    let jobs = machine.options().number("jobs", 1..=1000, 10)?;
    machine.options().finish(&["test", "clusters", "jobs"])?;
    let count = u32::try_from(machine.clusters().sizes().len()).unwrap_or(u32::MAX);
    let workload = Workload {
        shape: Shape::Layered {
            subtasks: SUBTASKS,
            seed: 1,
        },
        jobs,
        period: PERIOD.saturating_mul(count),
        stamping: Stamping::Ends,
        work: Duration::ZERO,
        wcet: None,
    };
    let dags = (0..count).map(|cluster| {
        let (dag, stamps) = build(&workload);
        dag.name(&format!("layered in cluster {cluster}"))
            .cluster(cluster)
            .offset(PERIOD.saturating_mul(cluster));
        (dag, stamps)
    });
    let (dags, stamps): (Vec<_>, Vec<_>) = dags.unzip();
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())?;
    let run = machine.run()?;
    if let Some(violation) = run.violations().next() {
        return Err(AppError::Failure(format!("{violation}")));
    }
    let period_ns = u64::try_from(PERIOD.as_nanos()).unwrap_or(u64::MAX);
    let of_job = |job| {
        let of_cluster = |(stamps, cluster): (&BodyStamps, u64)| {
            let release_ns = run.epoch_ns() + (job * u64::from(count) + cluster) * period_ns;
            stamps.first(SUBTASKS - 1, job)?.checked_sub(release_ns)
        };
        stamps.iter().zip(0..).filter_map(of_cluster).sum::<u64>()
    };
    let instances = u64::from(count) * SUBTASKS as u64;
    emit(WORKLOAD, "instance", instances, (0..jobs).map(of_job));
    let locks = u64::from(run.lock_acquisitions());
    emit(WORKLOAD, "locks", jobs * instances, [locks]);
    Ok(())
}
