//! Bounds of Kasahara's task graphs, alone on their cores, over Graham's.

use sched_dag::analysis::{Task, fix_orders, multi_path};
use sched_dag::{DagSpec, Order, Policy, verify};

use super::terms;
use crate::bench::frame::Table;
use crate::dag_file::stg;
use crate::oracle::bounds::older::{graham, long_paths};

const GRAPHS: &str = include_str!("../../../../../apps/dag-file/examples/stg50.json");

/// The mean bounds on some cores, each as a multiple of Graham's: by long paths, by the multi-path
/// bound, and by that with the order that a commit fixes.
type Means = (u32, [f64; 3]);

/// Bounds all graphs on 2, 4 and 8 cores, and returns how many there are.
///
/// # Errors
///
/// In words: a graph that is wrong.
fn measure() -> Result<(usize, Vec<Means>), String> {
    let file = stg::read(GRAPHS, None, 1).map_err(|malformed| malformed.reason)?;
    let dags = file.sets.into_iter().flat_map(|set| set.dags);
    let specs: Vec<DagSpec> = dags.map(|dag| dag.spec).collect();
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
        Ok((cores, sums.map(|sum| sum / specs.len() as f64)))
    };
    let means: Result<_, String> = [2, 4, 8].into_iter().map(of_cores).collect();
    Ok((specs.len(), means?))
}

fn task(spec: &DagSpec, order: Order, cores: u32) -> Result<Task, String> {
    let spec = DagSpec {
        order,
        period_ns: Some(u64::MAX / 4),
        relative_deadline_ns: Some(u64::MAX / 4),
        ..spec.clone()
    };
    let (options, settings) = terms(Policy::Edf, cores);
    let verified = verify(&[spec], &options).map_err(|rejected| rejected.to_string())?;
    let mut task_set = verified.task_set;
    fix_orders(&mut task_set, &settings);
    Task::from_dag(&task_set.dags()[0], 0).map_err(|error| error.to_string())
}

/// Returns a row a number of cores.
///
/// # Errors
///
/// In words: a graph that is wrong.
pub(super) fn table() -> Result<String, String> {
    let columns = [
        ("cores", 6, 0),
        ("graphs", 8, 0),
        ("long paths", 12, 3),
        ("multi-path", 12, 3),
        ("order fixed", 14, 3),
    ];
    let title = "task graphs (STG) alone: mean bound over Graham's\n";
    let mut table = Table::new(title, &columns);
    let (graphs, means) = measure()?;
    for (cores, [long_paths, multi_path, fixed]) in means {
        table.row(&[&cores, &graphs, &long_paths, &multi_path, &fixed]);
    }
    Ok(table.text())
}

#[cfg(test)]
mod tests {
    use super::measure;

    #[test]
    fn a_fixed_order_shortens_the_bounds_by_what_is_claimed() {
        let (_, means) = measure().unwrap();
        for ((_, [long_paths, multi_path, fixed]), most) in means.iter().zip([0.83, 0.71, 0.73]) {
            // A bound that rounds up may be above one that rounds down.
            assert!(*multi_path <= long_paths + 0.01, "{means:?}");
            assert!(fixed <= multi_path && *fixed <= most, "{means:?}");
        }
    }
}
