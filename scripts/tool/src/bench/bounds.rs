//! The share of random sets of DAGs that are proven, by load.
//!
//! For each number of cores and each load, from a tenth of the cores to all of them, the same
//! random sets are analysed twice: by the commit's answer, and by the forms that it had before the
//! multi-path bound (those of the oracle, with the width refinement, and the utilisation tests,
//! which both have). No time is measured, so the table is the same on every host.
//!
//! Two more tables follow: small sets with short deadlines, where the multi-path bound gains
//! most, and bounds of Kasahara's task graphs, alone on their cores, over Graham's.
//!
//! Sizes and cores of small sets are those of the random test that came with the proof of the
//! multi-path bound. It counted 91,351 sets by that bound and 47,638 by Melani's form with the
//! width under fixed priorities, 53,230 and 30,335 under EDF. How it drew WCETs, edges, periods and
//! deadlines is unknown, so the ratios can be compared, but not the counts.

use std::ffi::OsString;
use std::process::ExitCode;

use common::random::Random;
use sched_dag::analysis::{
    AnalysisSettings, Overheads, Task, answer, bonifaci_dm, bonifaci_edf, fix_orders,
    gedf_capacity, grm_capacity, multi_path,
};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, SubtaskOrder, verify,
};

use super::frame::by_plan;
use crate::dag_file::stg;
use crate::options::{Command, Parsed, Takes, options};
use crate::oracle::older_bounds::{Width, graham, long_paths, melani_edf, melani_fp};
use crate::output::Table;
use crate::random::graph;

static COMMAND: Command = Command {
    invocation: "./scripts/bench bounds",
    about: "Counts the random sets of DAGs that the analysis proves, with the multi-path bound \
            and by the forms before it.",
    positional: None,
    options: options! {
        /// The numbers of cores.
        "cores": Takes::numbers(1..=64), or "4,8,16";
        /// Random sets for each number of cores and load.
        "sets": Takes::number(1..=1_000_000), or "200";
    },
    notes: "\
A set has 2 to 2 m DAGs of 5 to 20 subtasks with D = T and deadline-monotonic priorities;
its load is the sum of volume / T over the cores. A small set has 2 to 5 DAGs of 2 to 8
subtasks on 2 to 4 cores, with D from the longest path to T, and is one of 100 for each of --sets.

Exit code: 0 counted; 1 a set was proven before and is not now; 2 the command line is refused.
",
};

/// The seed of all random sets.
const SEED: u64 = 1;

/// Runs `bench bounds` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    let plan = |options: &Parsed| {
        options.check_distinct(&["cores"])?;
        let sets = options.number("sets").unwrap_or(200);
        Ok((options.numbers::<u32>("cores"), sets))
    };
    by_plan(&COMMAND, words, plan, |(cores, sets)| measure(cores, *sets))
}

/// Counts and prints; an error if a set that was proven before is not now.
fn measure(cores: &[u32], count: u64) -> Result<bool, String> {
    let of_cores = |&cores: &u32| by_load(cores, count, SEED);
    let points: Vec<Point> = cores.iter().flat_map(of_cores).collect();
    print!("{}", table(&points));
    let small = small(100 * count, SEED);
    print!("{}", small_table(&small));
    print!("{}", graph_table()?);
    match lost(points.iter().map(|point| &point.proven).chain([&small])) {
        0 => Ok(true),
        lost => Err(format!("{lost} sets were proven before and are not now")),
    }
}

/// Returns the options and settings for any graphs.
fn terms(policy: Policy, cores: u32) -> (CommitOptions, AnalysisSettings) {
    let options = CommitOptions::new(policy, cores);
    let settings = AnalysisSettings {
        policy,
        preemption: Preemption::Enabled,
        cores,
        overheads: Overheads::default(),
    };
    (
        options.with_construction(ConstructionPolicy::any_graph()),
        settings,
    )
}

/// The policies, with their usual names.
const POLICIES: [(Policy, &str); 2] = [(Policy::StaticPriority, "G-FP"), (Policy::Edf, "G-EDF")];

/// The number of sets proven under one policy.
#[derive(Clone, Copy, Default)]
struct ProvenSets {
    sets: u64,
    /// By Melani's form with the width refinement alone.
    melani: u64,
    /// By any of the forms before the multi-path bound.
    before: u64,
    /// By the commit's answer.
    now: u64,
    /// Proven before, but not now.
    lost: u64,
}

impl ProvenSets {
    /// Counts a set.
    fn add(&mut self, specs: &[DagSpec], policy: Policy, cores: u32) {
        self.sets += 1;
        let (options, settings) = terms(policy, cores);
        let Ok(verified) = verify(specs, &options) else {
            // It has a WCET beyond the deadline, and counts as not proven by all forms.
            return;
        };
        let now = answer(&verified.task_set, &settings).is_proven();
        let tasks = verified.task_set.dags().iter();
        let tasks: Option<Vec<Task>> = tasks.map(|dag| Task::from_dag(dag, 0).ok()).collect();
        let tasks = tasks.unwrap_or_default();
        let mut tasks: Vec<&Task> = tasks.iter().collect();
        let (melani, others) = match policy {
            Policy::StaticPriority => {
                // In the order in which a commit derives priorities: deadline-monotonic, ties by
                // position.
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
        // Before, the most urgent DAG had to pass the bound by long paths.
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

/// The number of proven sets, by policy.
type ByPolicy = [ProvenSets; POLICIES.len()];

/// Analyses sets, each on its cores.
fn proofs(sets: impl Iterator<Item = (Vec<DagSpec>, u32)>) -> ByPolicy {
    let mut all = ByPolicy::default();
    for (specs, cores) in sets {
        for (proven, (policy, _)) in all.iter_mut().zip(POLICIES) {
            proven.add(&specs, policy, cores);
        }
    }
    all
}

/// Returns the number of sets that were proven before and are not now.
fn lost<'p>(all: impl IntoIterator<Item = &'p ByPolicy>) -> u64 {
    all.into_iter().flatten().map(|proven| proven.lost).sum()
}

/// The proofs at one load on one number of cores.
struct Point {
    cores: u32,
    /// The load in tenths of the cores.
    tenths: u64,
    proven: ByPolicy,
}

/// Analyses `sets` random sets at each load.
fn by_load(cores: u32, sets: u64, seed: u64) -> Vec<Point> {
    let mut random = Random::new(seed);
    let point = |tenths| Point {
        cores,
        tenths,
        proven: proofs((0..sets).map(|_| (draw_set(&mut random, cores, tenths), cores))),
    };
    (1..=10).map(point).collect()
}

/// Analyses `sets` small random sets.
fn small(sets: u64, seed: u64) -> ByPolicy {
    let mut random = Random::new(seed);
    proofs((0..sets).map(|_| {
        let cores = random.within(2..=4);
        (draw_small(&mut random), cores)
    }))
}

/// Returns a table with a row for each load, and the sums for each number of cores.
fn table(points: &[Point]) -> String {
    let columns = "cores:6|load:6.1|sets:8|G-FP before:14.1|now:10.1|G-EDF before:14.1|now:10.1";
    let title = "sets proven, in percent: before and with the multi-path bound\n";
    let mut table = Table::new(title, columns);
    for point in points {
        let percent =
            |of: &ProvenSets| [of.before, of.now].map(|count| 100.0 * ratio(count, of.sets));
        let [[fp, fp_now], [edf, edf_now]] = point.proven.each_ref().map(percent);
        let (load, sets) = (point.tenths as f64 / 10.0, point.proven[0].sets);
        table.row(&[&point.cores, &load, &sets, &fp, &fp_now, &edf, &edf_now]);
    }
    for same in points.chunk_by(|one, other| one.cores == other.cores) {
        for (position, (_, name)) in POLICIES.into_iter().enumerate() {
            let of = |which: fn(&ProvenSets) -> u64| -> u64 {
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

/// Returns a table with a row for each policy.
fn small_table(proven: &ByPolicy) -> String {
    let columns = "policy:8|sets:9|Melani:10|before:10|now:10|now / Melani:14.2|now / before:14.2";
    let mut table = Table::new("small sets with short deadlines, proven\n", columns);
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

/// The unit of small sets in nanoseconds: 2, 3 and 4 cores divide it, so that the rounding of the
/// older forms has no effect.
const UNIT_NS: u64 = 12;

/// Draws a set whose load on `cores` cores is about `tenths` tenths.
///
/// Each DAG gets a random share of the load, and the period that makes its utilisation that
/// share, but never one below its volume on all cores.
fn draw_set(random: &mut Random, cores: u32, tenths: u64) -> Vec<DagSpec> {
    let cores = u64::from(cores);
    let count = random.within(2..=2 * cores);
    let shares: Vec<u64> = (0..count).map(|_| random.within(1..=20)).collect();
    let all: u64 = shares.iter().sum();
    let dags = shares.iter().enumerate().map(|(number, share)| {
        // In units of 1 us, so that the rounding of the older forms has no effect.
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
fn draw_small(random: &mut Random) -> Vec<DagSpec> {
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

const GRAPHS: &str = include_str!("../../../../apps/dag-file/examples/stg50.json");

/// The mean bounds on some cores, each as a multiple of Graham's: by long paths, by the multi-path
/// bound, and by that with the order that a commit fixes.
type Means = (u32, [f64; 3]);

/// Bounds all graphs on 2, 4 and 8 cores, and returns how many there are.
///
/// # Errors
///
/// In words: the fault of a graph.
fn bound_graphs() -> Result<(usize, Vec<Means>), String> {
    let file = stg::read(GRAPHS, None, 1).map_err(|malformed| malformed.reason)?;
    let dags = file.sets.into_iter().flat_map(|set| set.dags);
    let specs: Vec<DagSpec> = dags.map(|dag| dag.spec).collect();
    let of_cores = |cores: u32| {
        let mut sums = [0.0; 3];
        for spec in &specs {
            let free = task(spec, SubtaskOrder::Free, cores)?;
            let fixed = task(spec, SubtaskOrder::Fixed, cores)?;
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

fn task(spec: &DagSpec, order: SubtaskOrder, cores: u32) -> Result<Task, String> {
    let spec = DagSpec {
        order,
        // Far beyond every job, and a quarter of the range, so that sums of times do not overflow.
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

/// Returns a table with a row for each number of cores.
///
/// # Errors
///
/// In words: the fault of a graph.
fn graph_table() -> Result<String, String> {
    let columns = "cores:6|graphs:8|long paths:12.3|multi-path:12.3|order fixed:14.3";
    let title = "task graphs (STG) alone: mean bound over Graham's\n";
    let mut graph_table = Table::new(title, columns);
    let (graphs, means) = bound_graphs()?;
    for (cores, [long_paths, multi_path, fixed]) in means {
        graph_table.row(&[&cores, &graphs, &long_paths, &multi_path, &fixed]);
    }
    Ok(graph_table.text())
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn a_fixed_order_shortens_the_bounds_by_what_is_claimed() {
        let (_, means) = bound_graphs().unwrap();
        for ((_, [long_paths, multi_path, fixed]), most) in means.iter().zip([0.83, 0.71, 0.73]) {
            // A bound that rounds up may be above one that rounds down.
            assert!(*multi_path <= long_paths + 0.01, "{means:?}");
            assert!(fixed <= multi_path && *fixed <= most, "{means:?}");
        }
    }
}
