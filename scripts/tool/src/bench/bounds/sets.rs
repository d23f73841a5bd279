//! Proofs of random sets, before and now: by cores and load, and of small ones.
//!
//! Sizes and cores of small sets are those of the random test that came with the proof of the
//! multi-path bound, which counted 91,351 sets by it and 47,638 by Melani's form with the width
//! under fixed priorities, 53,230 and 30,335 under EDF. How that test drew WCETs, edges, periods
//! and deadlines is not known, so the ratios can be compared and the counts cannot.

use common::random::Random;
use sched_dag::analysis::{Task, answer, bonifaci_dm, bonifaci_edf, gedf_capacity, grm_capacity};
use sched_dag::{DagSpec, Policy, verify};

use super::{draw, terms};
use crate::bench::frame::Table;
use crate::oracle::bounds::older::{Width, long_paths, melani_edf, melani_fp};

/// The policies, and what people call them.
const POLICIES: [(Policy, &str); 2] = [(Policy::StaticPriority, "G-FP"), (Policy::Edf, "G-EDF")];

/// How many of some sets are proven under one policy.
#[derive(Clone, Copy, Default)]
pub(super) struct Proven {
    sets: u64,
    /// By Melani's form with the width refinement alone.
    melani: u64,
    /// By one of the forms before the multi-path bound.
    before: u64,
    /// By the commit's answer.
    now: u64,
    /// Before, and not now.
    lost: u64,
}

impl Proven {
    /// Counts a set.
    fn add(&mut self, specs: &[DagSpec], policy: Policy, cores: u32) {
        self.sets += 1;
        let (options, settings) = terms(policy, cores);
        let Ok(verified) = verify(specs, &options) else {
            // A WCET beyond the deadline.
            return;
        };
        let now = answer(&verified.task_set, &settings).is_proven();
        let tasks = verified.task_set.dags().iter();
        let tasks: Option<Vec<Task>> = tasks.map(|dag| Task::from_dag(dag, 0).ok()).collect();
        let tasks = tasks.unwrap_or_default();
        let mut tasks: Vec<&Task> = tasks.iter().collect();
        let (melani, others) = match policy {
            Policy::StaticPriority => {
                // As a commit derives priorities: deadline-monotonic, equal ones in order.
                tasks.sort_by_key(|task| task.relative_deadline_ns());
                let others =
                    grm_capacity(&tasks, cores) == Some(true) || bonifaci_dm(&tasks, cores);
                (melani_fp(&tasks, cores, Width::Used).is_some(), others)
            }
            Policy::Edf => {
                let others =
                    gedf_capacity(&tasks, cores) == Some(true) || bonifaci_edf(&tasks, cores);
                (melani_edf(&tasks, cores, Width::Used).is_some(), others)
            }
        };
        // The most urgent DAG had the bound of long paths.
        let first = tasks.first().is_none_or(|task| {
            policy == Policy::Edf || long_paths(task, cores) <= task.relative_deadline_ns()
        });
        let before = (melani || others) && first;
        self.melani += u64::from(melani);
        self.before += u64::from(before);
        self.now += u64::from(now);
        self.lost += u64::from(before && !now);
    }
}

/// How many sets are proven, by policy.
type ByPolicy = [Proven; POLICIES.len()];

fn add(all: &mut ByPolicy, specs: &[DagSpec], cores: u32) {
    for (proven, (policy, _)) in all.iter_mut().zip(POLICIES) {
        proven.add(specs, policy, cores);
    }
}

/// Returns how many sets were proven before and are not now.
pub(super) fn lost<'p>(all: impl IntoIterator<Item = &'p ByPolicy>) -> u64 {
    all.into_iter().flatten().map(|proven| proven.lost).sum()
}

/// The proofs at one load on one number of cores.
pub(super) struct Point {
    cores: u32,
    /// The load in tenths of the cores.
    tenths: u64,
    pub(super) proven: ByPolicy,
}

/// Analyses `sets` sets at each load.
pub(super) fn by_load(cores: u32, sets: u64, seed: u64) -> Vec<Point> {
    let mut random = Random::new(seed);
    let point = |tenths| {
        let mut proven = ByPolicy::default();
        for _ in 0..sets {
            add(&mut proven, &draw::set(&mut random, cores, tenths), cores);
        }
        Point {
            cores,
            tenths,
            proven,
        }
    };
    (1..=10).map(point).collect()
}

/// Analyses `sets` small sets.
pub(super) fn small(sets: u64, seed: u64) -> ByPolicy {
    let mut random = Random::new(seed);
    let mut proven = ByPolicy::default();
    for _ in 0..sets {
        let cores = random.within(2..=4);
        add(&mut proven, &draw::small(&mut random), cores);
    }
    proven
}

/// Returns a row a load, and the sums for each number of cores.
pub(super) fn table(points: &[Point]) -> String {
    let columns = [
        ("cores", 6, 0),
        ("load", 6, 1),
        ("sets", 8, 0),
        ("G-FP before", 14, 1),
        ("now", 10, 1),
        ("G-EDF before", 14, 1),
        ("now", 10, 1),
    ];
    let title = "sets proven, in percent: before and with the multi-path bound\n";
    let mut table = Table::new(title, &columns);
    for point in points {
        let percent = |of: &Proven| [of.before, of.now].map(|count| 100.0 * ratio(count, of.sets));
        let [[fp, fp_now], [edf, edf_now]] = point.proven.each_ref().map(percent);
        let (load, sets) = (point.tenths as f64 / 10.0, point.proven[0].sets);
        table.row(&[&point.cores, &load, &sets, &fp, &fp_now, &edf, &edf_now]);
    }
    for same in points.chunk_by(|one, other| one.cores == other.cores) {
        for (position, (_, name)) in POLICIES.into_iter().enumerate() {
            let of = |which: fn(&Proven) -> u64| -> u64 {
                same.iter()
                    .map(|point| which(&point.proven[position]))
                    .sum()
            };
            let (before, now, cores) = (of(|of| of.before), of(|of| of.now), same[0].cores);
            let times = ratio(now, before);
            table.line(&format!(
                "{name} on {cores} cores: {now} sets now, {before} before: {times:.2} times as many"
            ));
        }
    }
    table.text()
}

/// Returns a row a policy.
pub(super) fn small_table(proven: &ByPolicy) -> String {
    let columns = [
        ("policy", 8, 0),
        ("sets", 9, 0),
        ("Melani", 10, 0),
        ("before", 10, 0),
        ("now", 10, 0),
        ("now / Melani", 14, 2),
        ("now / before", 14, 2),
    ];
    let mut table = Table::new("small sets with short deadlines, proven\n", &columns);
    for (of, (_, name)) in proven.iter().zip(POLICIES) {
        let [of_melani, of_before] = [of.melani, of.before].map(|other| ratio(of.now, other));
        table.row(&[
            &name, &of.sets, &of.melani, &of.before, &of.now, &of_melani, &of_before,
        ]);
    }
    table.text()
}

fn ratio(count: u64, of: u64) -> f64 {
    count as f64 / of.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::{by_load, lost, small, small_table, table};

    #[test]
    fn what_was_proven_still_is_and_light_sets_are() {
        let points = by_load(4, 12, 7);
        assert_eq!(points.len(), 10);
        assert_eq!(lost(points.iter().map(|point| &point.proven)), 0);
        let all = points.iter().flat_map(|point| point.proven);
        let [before, now] = all.fold([0, 0], |sum, of| [sum[0] + of.before, sum[1] + of.now]);
        assert!(now > before, "{}", table(&points));
    }

    #[test]
    fn of_small_sets_more_are_proven_than_before() {
        let proven = small(2_000, 7);
        for of in &proven {
            assert_eq!(of.lost, 0, "{}", small_table(&proven));
            assert!(4 * of.now > 5 * of.melani, "{}", small_table(&proven));
        }
    }
}
