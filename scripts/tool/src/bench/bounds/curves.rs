//! What is proven of random sets, before and now, by cores and load.

use std::fmt::Write;

use sched_dag::analysis::{
    Overheads, Settings, Task, answer, bonifaci_dm, bonifaci_edf, gedf_capacity, grm_capacity,
};
use sched_dag::{CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, verify};

use super::draw::set;
use crate::oracle::bounds::older::{Width, long_paths, melani_edf, melani_fp};
use crate::random::Random;

/// The policies, in the order of [`Point::proven`].
pub(super) const POLICIES: [Policy; 2] = [Policy::StaticPriority, Policy::Edf];

/// What is proven at one load on one number of cores.
pub(super) struct Point {
    cores: u32,
    /// The load in tenths of the cores.
    tenths: u64,
    sets: u64,
    /// By policy the sets proven before, and now.
    proven: [[u64; 2]; 2],
    /// The sets that were proven before and are not now.
    pub(super) lost: u64,
}

/// Analyses `sets` sets at each load.
pub(super) fn measure(cores: u32, sets: u64, seed: u64) -> Vec<Point> {
    let mut random = Random::new(seed);
    let loads = 1..=10;
    loads
        .map(|tenths| {
            let mut point = Point {
                cores,
                tenths,
                sets,
                proven: [[0; 2]; 2],
                lost: 0,
            };
            for _ in 0..sets {
                let specs = set(&mut random, cores, tenths);
                for (policy, proven) in POLICIES.into_iter().zip(&mut point.proven) {
                    let found = verdicts(&specs, policy, cores);
                    proven[0] += u64::from(found.before);
                    proven[1] += u64::from(found.now);
                    point.lost += u64::from(found.is_lost());
                }
            }
            point
        })
        .collect()
}

/// By what a set is proven.
#[derive(Clone, Copy, Default)]
pub(super) struct Verdicts {
    /// By Melani's form with the width refinement alone.
    pub(super) melani: bool,
    /// By one of the forms before the multi-path bound.
    pub(super) before: bool,
    /// By the commit's answer.
    pub(super) now: bool,
}

impl Verdicts {
    /// Reports whether the set was proven before and is not now.
    pub(super) const fn is_lost(self) -> bool {
        self.before && !self.now
    }
}

/// Finds by what a set is proven.
pub(super) fn verdicts(specs: &[DagSpec], policy: Policy, cores: u32) -> Verdicts {
    let options =
        CommitOptions::new(policy, cores).with_construction(ConstructionPolicy::any_graph());
    let Ok(verified) = verify(specs, &options) else {
        // A WCET beyond the deadline.
        return Verdicts::default();
    };
    let settings = Settings {
        policy,
        preemption: Preemption::Enabled,
        cores,
        overheads: Overheads::default(),
    };
    let now = answer(&verified.task_set, &settings).is_proven();
    let tasks = verified.task_set.dags().iter();
    let tasks: Option<Vec<Task>> = tasks.map(|dag| Task::from_dag(dag, 0).ok()).collect();
    let tasks = tasks.unwrap_or_default();
    let mut tasks: Vec<&Task> = tasks.iter().collect();
    let (melani, before) = match policy {
        Policy::StaticPriority => {
            // As a commit derives priorities: deadline-monotonic, equal ones in order.
            tasks.sort_by_key(|task| task.relative_deadline_ns());
            let others = grm_capacity(&tasks, cores) == Some(true) || bonifaci_dm(&tasks, cores);
            (melani_fp(&tasks, cores, Width::Used).is_some(), others)
        }
        Policy::Edf => {
            let others = gedf_capacity(&tasks, cores) == Some(true) || bonifaci_edf(&tasks, cores);
            (melani_edf(&tasks, cores, Width::Used).is_some(), others)
        }
    };
    // The most urgent DAG had the bound of long paths.
    let first = tasks.first().is_none_or(|task| {
        policy == Policy::Edf || long_paths(task, cores) <= task.relative_deadline_ns()
    });
    Verdicts {
        melani,
        before: (melani || before) && first,
        now,
    }
}

/// Writes a row a load, and the sums for each number of cores.
pub(super) fn table(points: &[Point]) -> String {
    // Writing into a `String` cannot fail.
    let mut text = String::from("sets proven, in percent: before and with the multi-path bound\n");
    let _ = writeln!(
        text,
        "{:>6}{:>6}{:>8}{:>14}{:>10}{:>14}{:>10}",
        "cores", "load", "sets", "G-FP before", "now", "G-EDF before", "now"
    );
    let percent = |count: u64, sets: u64| 100.0 * count as f64 / sets as f64;
    for point in points {
        let [[fp, fp_now], [edf, edf_now]] = point
            .proven
            .map(|pair| pair.map(|count| percent(count, point.sets)));
        let load = point.tenths as f64 / 10.0;
        let _ = writeln!(
            text,
            "{:>6}{load:>6.1}{:>8}{fp:>14.1}{fp_now:>10.1}{edf:>14.1}{edf_now:>10.1}",
            point.cores, point.sets
        );
    }
    for same in points.chunk_by(|one, other| one.cores == other.cores) {
        let sum = |policy: usize, which: usize| -> u64 {
            same.iter().map(|point| point.proven[policy][which]).sum()
        };
        for (policy, name) in ["G-FP", "G-EDF"].into_iter().enumerate() {
            let (before, now) = (sum(policy, 0), sum(policy, 1));
            let times = now as f64 / before.max(1) as f64;
            let cores = same[0].cores;
            let _ = writeln!(
                text,
                "{name} on {cores} cores: {now} sets now, {before} before: {times:.2} times as many"
            );
        }
    }
    text
}

/// Writes the counts with a header.
pub(super) fn csv(points: &[Point]) -> String {
    let mut text = String::from("cores,load,sets,gfp_before,gfp_now,gedf_before,gedf_now\n");
    for point in points {
        let [[fp, fp_now], [edf, edf_now]] = point.proven;
        let (cores, load, sets) = (point.cores, point.tenths as f64 / 10.0, point.sets);
        let _ = writeln!(
            text,
            "{cores},{load:.1},{sets},{fp},{fp_now},{edf},{edf_now}"
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{csv, measure};

    #[test]
    fn what_was_proven_still_is_and_light_sets_are() {
        let points = measure(4, 12, 7);
        assert_eq!(points.len(), 10);
        assert!(points.iter().all(|point| point.lost == 0));
        let sum = |which: usize| -> u64 {
            let counts = points.iter().flat_map(|point| point.proven);
            counts.map(|pair| pair[which]).sum()
        };
        assert!(sum(1) > sum(0), "{}", csv(&points));
    }
}
