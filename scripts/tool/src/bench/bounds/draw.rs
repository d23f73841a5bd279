//! Random sets of DAGs: of a given load, or small ones.

use common::random::Random;
use sched_dag::DagSpec;
use sched_dag::analysis::Task;

use crate::random::graph;

/// The unit of small sets: 2 to 4 cores divide it, so that it does not matter that the forms
/// before rounded down.
const UNIT_NS: u64 = 12;

/// Draws a set whose load on `cores` cores is about `tenths` tenths.
///
/// Each DAG gets a random share of the load, and the period that makes its utilisation that
/// share, but never one below its volume on all cores.
pub(super) fn set(random: &mut Random, cores: u32, tenths: u64) -> Vec<DagSpec> {
    let cores = u64::from(cores);
    let count = random.within(2..=2 * cores);
    let shares: Vec<u64> = (0..count).map(|_| random.within(1..=20)).collect();
    let all: u64 = shares.iter().sum();
    let dags = shares.iter().enumerate().map(|(number, share)| {
        // In us, so that it does not matter that the forms before rounded down.
        let mut spec = graph(random, 5..=20, 3..=9, 1..=100, 1_000);
        let wcets = spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
        let volume: u64 = wcets.sum();
        // T = volume / (share of the load), the load being `tenths * cores / 10`.
        let period = (10 * volume * all).div_ceil(tenths * cores * share);
        spec.name = format!("dag {number}");
        spec.period_ns = Some(period.max(volume.div_ceil(cores)));
        spec.relative_deadline_ns = spec.period_ns;
        spec
    });
    dags.collect()
}

/// Draws a small set with short deadlines: of 2 to 5 DAGs of 2 to 8 subtasks, which take up to
/// 20 units. A DAG's period lies between its longest path, or a quarter of its volume, and three
/// times its volume; its deadline between the longest path and the period.
pub(super) fn small(random: &mut Random) -> Vec<DagSpec> {
    let dags = 0..random.within(2..=5);
    let dags = dags.map(|number| {
        let mut spec = graph(random, 2..=8, 2..=5, 1..=20, UNIT_NS);
        let wcets = spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
        let task = Task::new(1, 1, wcets.collect(), &spec.edges);
        let task = task.expect("its WCETs are above 0 and its edges lead to larger numbers");
        let (volume, length) = (task.volume_ns(), task.length_ns());
        let period = random.within(length.max(volume / 4) / UNIT_NS..=3 * volume / UNIT_NS);
        let deadline = random.within(length / UNIT_NS..=period);
        spec.name = format!("dag {number}");
        spec.period_ns = Some(UNIT_NS * period);
        spec.relative_deadline_ns = Some(UNIT_NS * deadline);
        spec
    });
    dags.collect()
}
