//! Federated scheduling: cores of its own for each DAG that needs several.
//!
//! J. Li, J.-J. Chen, K. Agrawal, C. Lu, C. Gill, A. Saifullah, ECRTS 2014,
//! doi:10.1109/ECRTS.2014.23; with `D <= T`: S. Baruah, DATE 2015. A *heavy*
//! DAG (`volume > D`) gets `ceil((volume - length) / (D - length))` dedicated
//! cores, on which Graham's bound is at most `D`. A *light* one is executed
//! sequentially on one of the remaining cores, and a core takes light DAGs while
//! the sum of their densities `volume / D` is at most 1 (partitioned EDF).
//!
//! This is what the literature compares; a commit that makes its own clusters asks `assign`.
//! Assumes `D <= T`.
//!
//! Light DAGs are placed first-fit by descending density, ties by position;
//! another placement may succeed where this one fails.

use alloc::vec;
use alloc::vec::Vec;

use super::ratio::{Ratio, sort_largest_first};
use super::set::constrained;
use super::task::Task;

/// Which DAG gets which cores.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Federation {
    /// The heavy DAGs by position, each with its number of dedicated cores.
    pub heavy: Vec<(usize, u32)>,
    /// The light DAGs of each remaining core, by position; the length is the
    /// number of cores left for light DAGs.
    pub light: Vec<Vec<usize>>,
}

/// Assigns cores by Graham's bound, or returns `None` if that does not succeed
/// or a DAG has `D > T`.
#[must_use]
pub fn federated(tasks: &[&Task], cores: u32) -> Option<Federation> {
    if !constrained(tasks, cores) {
        return None;
    }
    let mut left = cores;
    let mut heavy = Vec::new();
    let mut light = Vec::new();
    for (position, task) in tasks.iter().enumerate() {
        if task.volume_ns() > task.relative_deadline_ns() {
            // Zero slack: then the volume, which exceeds D, exceeds the length.
            let slack = task.relative_deadline_ns().checked_sub(task.length_ns())?;
            let beside = task.volume_ns() - task.length_ns();
            let room = beside.checked_add(slack.checked_sub(1)?)?;
            let count = u32::try_from(room.checked_div(slack)?).ok()?;
            left = left.checked_sub(count)?;
            heavy.push((position, count));
        } else {
            light.push(position);
        }
    }
    let light = place(tasks, light, left)?;
    Some(Federation { heavy, light })
}

fn place(tasks: &[&Task], mut light: Vec<usize>, cores: u32) -> Option<Vec<Vec<usize>>> {
    let cores = usize::try_from(cores).ok()?;
    let density = |position: usize| {
        let task = tasks[position];
        (task.volume_ns(), task.relative_deadline_ns())
    };
    sort_largest_first(&mut light, density);
    let mut placed = vec![Vec::new(); cores];
    for position in light {
        let fits = |there: &&mut Vec<usize>| {
            let all = there.iter().chain([&position]).map(|&dag| density(dag));
            Ratio::sum(all).is_some_and(|sum| sum.at_most(1, 1))
        };
        placed.iter_mut().find(fits)?.push(position);
    }
    Some(placed)
}

#[cfg(test)]
mod tests {
    use super::federated;
    use crate::analysis::Task;

    #[test]
    fn e6_a_heavy_dag_and_two_light_ones() {
        let fork = (1..5).flat_map(|v| [(0, v), (v, 5)]).collect::<Vec<_>>();
        let heavy = Task::new(12, 12, vec![2, 6, 5, 4, 3, 1], &fork).unwrap();
        let one = Task::new(10, 10, vec![2, 3], &[(0, 1)]).unwrap();
        let two = Task::new(10, 8, vec![1, 3], &[(0, 1)]).unwrap();
        let tasks = [&heavy, &one, &two];
        assert_eq!(federated(&tasks, 4), None);
        let five = federated(&tasks, 5).unwrap();
        assert_eq!((five.heavy, five.light), (vec![(0, 4)], vec![vec![1, 2]]));
        let six = federated(&tasks, 6).unwrap();
        assert_eq!((six.heavy, six.light.len()), (vec![(0, 4)], 2));
    }

    #[test]
    fn no_number_of_cores_shortens_the_critical_path() {
        let tight = Task::new(10, 5, vec![5, 1], &[]).unwrap();
        assert_eq!(federated(&[&tight], 64), None);
        let light_but_long = Task::new(10, 10, vec![10], &[]).unwrap();
        assert!(federated(&[&light_but_long], 1).is_some());
        let pipelined = Task::new(10, 11, vec![5], &[]).unwrap();
        assert_eq!(federated(&[&pipelined], 2), None);
    }
}
