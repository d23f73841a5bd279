//! Random sets of DAGs for the analysis.

use alloc::format;
use alloc::vec::Vec;

use sched_dag::{DagSpec, Priority, SubtaskSpec};

use crate::Random;

/// Draws up to 4 DAGs for clusters with `clusters` cores. The DAGs take the clusters in turn, and
/// each cluster gets at least one. The load is light to full, deadlines lie below, at and beyond
/// the period, and priorities go by DAG or by subtask.
#[must_use]
pub fn set(random: &mut Random, unit_ns: u64, clusters: &[u32]) -> Vec<DagSpec> {
    let count = random.within(clusters.len()..=4);
    let (overlaps, by_subtask) = (random.once_in(3), random.once_in(4));
    let share = count as u64 * random.within(1..=8);
    let dags = clusters.iter().cycle().take(count).zip(0..);
    let dags = dags.map(|(&cores, number)| {
        let mut spec = dag(random, unit_ns, cores.into(), share, overlaps);
        spec.name = format!("{number} of {count}");
        let levels = random.within(1..=6);
        for subtask in &mut spec.subtasks {
            let level = by_subtask.then(|| random.within(0..=levels));
            subtask.priority = Some(Priority(level.unwrap_or(number)));
        }
        spec
    });
    dags.collect()
}

/// Draws a DAG of up to 8 subtasks of 1 to 9 units, or 6 times as long. In its shortest period
/// `cores` cores do `share` quarters of its work; its deadline is at most the period, or may exceed
/// it if jobs overlap.
fn dag(random: &mut Random, unit_ns: u64, cores: u64, share: u64, overlaps: bool) -> DagSpec {
    // Some DAGs have long subtasks, which block others.
    let factor = random.one_of(&[1, 1, 6]);
    let spec = graph(random, unit_ns, factor);
    let wcets_ns = || spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
    let (volume_ns, longest_ns): (u64, _) = (wcets_ns().sum(), wcets_ns().max().unwrap_or(1));
    let period_ns = (volume_ns * share).div_ceil(cores * 4) + random.within(0..=10 * unit_ns);
    let (period_ns, deadline_ns) = if overlaps {
        // With overlapping jobs the period may be shorter than a job, but not shorter than the
        // job's longest subtask.
        let period_ns = period_ns.max(longest_ns);
        let more_ns = random.within(0..=period_ns);
        (period_ns, period_ns * random.within(1..=4) + more_ns)
    } else {
        // Without overlap a job needs room for its share of the work and its longest subtask.
        let period_ns = period_ns.max(volume_ns / cores + longest_ns);
        (period_ns, period_ns - random.within(0..=period_ns / 4))
    };
    DagSpec {
        period_ns: Some(period_ns),
        relative_deadline_ns: Some(deadline_ns),
        offset_ns: random.within(0..=2) * random.within(0..=period_ns),
        ..spec
    }
}

/// Draws a graph of up to 8 subtasks of 1 to 9 units, or `factor` times as long. An edge leads from
/// a subtask to a later one with probability 1/2 to 1/7.
fn graph(random: &mut Random, unit_ns: u64, factor: u64) -> DagSpec {
    let (subtasks, percent) = (random.within(1..=8), 100 / random.within(2..=7));
    let edges = random.edges(subtasks, percent).collect();
    let subtask = |_| SubtaskSpec {
        wcet_ns: Some(factor * random.within(unit_ns..=9 * unit_ns)),
        ..SubtaskSpec::default()
    };
    DagSpec {
        subtasks: (0..subtasks).map(subtask).collect(),
        edges,
        ..DagSpec::default()
    }
}
