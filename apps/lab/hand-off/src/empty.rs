//! DAGs of empty functions without values, of any shape.

use alloc::boxed::Box;
use alloc::format;
use alloc::vec::Vec;
use core::time::Duration;

use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fass::{SubtaskAttributes, create_dag};

use crate::Shape;

/// A function without values.
pub type Tick = Box<dyn FnMut(u64) + Send>;

/// Makes empty functions for `dags` DAGs, subtask by subtask; the first source calls `source`.
pub fn empty(shape: Shape, dags: u16, mut source: impl FnMut() + Send + 'static) -> Vec<Vec<Tick>> {
    let of_dag = |_| (0..shape.subtasks()).map(|_| Box::new(|_| ()) as Tick);
    let mut all: Vec<Vec<Tick>> = (0..dags).map(|dag| of_dag(dag).collect()).collect();
    all[0][0] = Box::new(move |_| source());
    all
}

/// Commits DAGs of a shape; `clusters` has the functions of each DAG of each cluster.
///
/// # Panics
///
/// If the commit is refused.
pub fn commit(shape: Shape, jobs: u64, period: Duration, clusters: Vec<Vec<Vec<Tick>>>) {
    let is_divided = clusters.len() > 1;
    let mut dags = Vec::new();
    for (cluster, of_dags) in (0..).zip(clusters) {
        let all = of_dags.len() as u64;
        for (number, functions) in (0_u64..).zip(of_dags) {
            let dag = create_dag();
            dag.name(&format!("native{cluster}-{number}"));
            dag.jobs(jobs).in_flight(1).period(period);
            // Deadlines in a shuffled order, no two the same: 617 has no divisor in common with
            // 1,000.
            dag.relative_deadline(period - Duration::from_micros(number * 617 % all));
            if is_divided {
                dag.cluster(cluster);
            }
            let named = |number| SubtaskAttributes::named(&format!("s{number}"));
            let functions = functions.into_iter().enumerate();
            let subtasks: Vec<_> = functions
                .map(|(number, tick)| dag.register_untyped_subtask(tick, named(number)))
                .collect();
            for (earlier, later) in shape.edges() {
                dag.precede(&subtasks[earlier], &subtasks[later]);
            }
            dags.push(dag);
        }
    }
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).expect("the graphs are right");
}
