//! Sets of DAGs that are drawn, to be analysed.

use std::ops::RangeInclusive;

use common::random::Random;
use sched_dag::{DagSpec, Priority, SubtaskSpec};

/// Draws up to 4 DAGs for clusters of so many cores, which they take in turn, at least one for
/// each: from light to full load, deadlines below, at and beyond the period, priorities by DAG or
/// by subtask.
pub(crate) fn set(random: &mut Random, unit_ns: u64, clusters: &[u32]) -> Vec<DagSpec> {
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

/// Draws a DAG of up to 8 subtasks, which take 1 to 9 units or 6 times as long. Its period is
/// that in which `cores` cores do `share` quarters of its work, or a longer one; its deadline is
/// at most the period, or beyond it if jobs may overlap.
fn dag(random: &mut Random, unit_ns: u64, cores: u64, share: u64, overlaps: bool) -> DagSpec {
    // Some DAGs have longer subtasks, which others may have to wait for.
    let factor = random.one_of(&[1, 1, 6]);
    let spec = graph(random, 1..=8, 2..=7, unit_ns..=9 * unit_ns, factor);
    let wcets_ns = || spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
    let (volume_ns, longest_ns): (u64, _) = (wcets_ns().sum(), wcets_ns().max().unwrap_or(1));
    let period_ns = (volume_ns * share).div_ceil(cores * 4) + random.within(0..=10 * unit_ns);
    let (period_ns, deadline_ns) = if overlaps {
        let period_ns = period_ns.max(longest_ns);
        let more_ns = random.within(0..=period_ns);
        (period_ns, period_ns * random.within(1..=4) + more_ns)
    } else {
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

/// Draws a graph of so many subtasks, whose WCETs are so many units, and edges from subtasks to
/// later ones, of which once in `once_in` times one is there.
pub(crate) fn graph(
    random: &mut Random,
    subtasks: RangeInclusive<usize>,
    once_in: RangeInclusive<u64>,
    units: RangeInclusive<u64>,
    unit_ns: u64,
) -> DagSpec {
    let (subtasks, percent) = (random.within(subtasks), 100 / random.within(once_in));
    let edges = random.edges(subtasks, percent).collect();
    let subtask = |_| SubtaskSpec {
        wcet_ns: Some(unit_ns * random.within(units.clone())),
        ..SubtaskSpec::default()
    };
    DagSpec {
        subtasks: (0..subtasks).map(subtask).collect(),
        edges,
        ..DagSpec::default()
    }
}
