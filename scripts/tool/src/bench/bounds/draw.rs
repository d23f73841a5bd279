//! Random sets of DAGs of a given load.

use sched_dag::{DagSpec, SubtaskSpec};

use crate::random::Random;

/// Draws a set whose load on `cores` cores is about `tenths` tenths.
///
/// Each DAG gets a random share of the load, and the period that makes its utilisation that
/// share, but never one below its volume on all cores.
pub(super) fn set(random: &mut Random, cores: u32, tenths: u64) -> Vec<DagSpec> {
    let cores = u64::from(cores);
    let count = random.within(2, 2 * cores);
    let shares: Vec<u64> = (0..count).map(|_| random.within(1, 20)).collect();
    let all: u64 = shares.iter().sum();
    let dags = shares.iter().enumerate().map(|(number, share)| {
        let mut spec = dag(random);
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

fn dag(random: &mut Random) -> DagSpec {
    let subtasks = random.within(5, 20);
    let density = random.within(2, 8);
    let mut edges = Vec::new();
    for to in 1..subtasks {
        for from in 0..to {
            if random.within(0, density) == 0 {
                edges.push((from, to));
            }
        }
    }
    let index = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
    DagSpec {
        subtasks: (0..subtasks)
            .map(|_| SubtaskSpec {
                // In us, so that it does not matter that the forms before rounded down.
                wcet_ns: Some(1_000 * random.within(1, 100)),
                ..SubtaskSpec::default()
            })
            .collect(),
        edges: edges
            .iter()
            .map(|&(from, to)| (index(from), index(to)))
            .collect(),
        ..DagSpec::default()
    }
}
