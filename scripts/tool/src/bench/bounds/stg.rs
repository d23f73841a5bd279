//! Bounds of Kasahara's task graphs, alone on their cores, over Graham's.

use std::fmt::Write;

use sched_dag::analysis::{Overheads, Settings, Task, fix_orders, multi_path};
use sched_dag::{CommitOptions, ConstructionPolicy, DagSpec, Order, Policy, Preemption, verify};

use crate::dag_file::stg;
use crate::oracle::bounds::older::{graham, long_paths};

const GRAPHS: &str = include_str!("../../../../../apps/dag-file/examples/stg50.json");

/// The mean bounds on some cores, each as a multiple of Graham's.
pub(super) struct Means {
    cores: u32,
    graphs: usize,
    long_paths: f64,
    multi_path: f64,
    /// With the order that a commit fixes.
    fixed: f64,
}

/// Bounds all graphs on 2, 4 and 8 cores.
///
/// # Errors
///
/// In words: a graph that is wrong.
pub(super) fn measure() -> Result<Vec<Means>, String> {
    let file = stg::read(GRAPHS, None, 1).map_err(|malformed| malformed.reason)?;
    let specs: Vec<DagSpec> = (file.sets.into_iter())
        .flat_map(|set| set.dags)
        .map(|dag| dag.spec)
        .collect();
    let of_cores = |cores: u32| {
        let mut sums = [0.0; 3];
        for spec in &specs {
            let free = task(spec, Order::Free, cores)?;
            let fixed = task(spec, Order::Fixed, cores)?;
            let base = graham(&free, cores) as f64;
            let bounds = [
                Some(long_paths(&free, cores)),
                multi_path(&free, cores),
                multi_path(&fixed, cores),
            ];
            for (sum, bound) in sums.iter_mut().zip(bounds) {
                *sum += bound.unwrap_or(u64::MAX) as f64 / base;
            }
        }
        let [long_paths, multi_path, fixed] = sums.map(|sum| sum / specs.len() as f64);
        Ok(Means {
            cores,
            graphs: specs.len(),
            long_paths,
            multi_path,
            fixed,
        })
    };
    [2, 4, 8].into_iter().map(of_cores).collect()
}

fn task(spec: &DagSpec, order: Order, cores: u32) -> Result<Task, String> {
    let spec = DagSpec {
        order,
        period_ns: Some(u64::MAX / 4),
        relative_deadline_ns: Some(u64::MAX / 4),
        ..spec.clone()
    };
    let options =
        CommitOptions::new(Policy::Edf, cores).with_construction(ConstructionPolicy::any_graph());
    let verified = verify(&[spec], &options).map_err(|rejected| rejected.to_string())?;
    let mut task_set = verified.task_set;
    let settings = Settings {
        policy: options.policy,
        preemption: Preemption::Enabled,
        cores,
        overheads: Overheads::default(),
    };
    fix_orders(&mut task_set, &settings);
    Task::from_dag(&task_set.dags()[0], 0).map_err(|error| error.to_string())
}

/// Writes a row a number of cores.
pub(super) fn table(means: &[Means]) -> String {
    let mut text = String::from("task graphs (STG) alone: mean bound over Graham's\n");
    // Writing into a `String` cannot fail.
    let _ = writeln!(
        text,
        "{:>6}{:>8}{:>12}{:>12}{:>14}",
        "cores", "graphs", "long paths", "multi-path", "order fixed"
    );
    for mean in means {
        let _ = writeln!(
            text,
            "{:>6}{:>8}{:>12.3}{:>12.3}{:>14.3}",
            mean.cores, mean.graphs, mean.long_paths, mean.multi_path, mean.fixed
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{measure, table};

    #[test]
    fn a_fixed_order_shortens_the_bounds_by_what_is_claimed() {
        let means = measure().unwrap();
        for (mean, most) in means.iter().zip([0.83, 0.71, 0.73]) {
            let all = table(&means);
            // A bound that rounds up may be above one that rounds down.
            assert!(mean.multi_path <= mean.long_paths + 0.01, "{all}");
            assert!(mean.fixed <= mean.multi_path && mean.fixed <= most, "{all}");
        }
    }
}
