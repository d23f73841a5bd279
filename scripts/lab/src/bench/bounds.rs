//! Sets of DAGs that methods of analysis accept.
//!
//! First the share of random sets by utilization, for the division of cores that lends them and for
//! other methods (`acceptance`), or of sets that files give. No time is
//! measured, so the tables are the same on every host.
//!
//! Two more tables follow: small sets with short deadlines, where the multi-path bound gains
//! most over Melani's form of it with the width refinement, and bounds of Kasahara's task graphs,
//! alone on their cores, over Graham's.
//!
//! Sizes and cores of small sets are those of the random test that came with the proof of the
//! multi-path bound. It counted 91,351 sets by that bound and 47,638 by Melani's form with the
//! width under fixed priorities, 53,230 and 30,335 under EDF. How it drew WCETs, edges, periods and
//! deadlines is unknown, so the ratios can be compared, but not the counts.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use random::Random;
use sched_dag::analysis::{AnalysisSettings, Overheads, Task, answer, fix_orders, multi_path};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, SubtaskOrder, verify,
};

use super::acceptance::{self, SetFile};
use super::frame::by_plan;
use crate::oracle::older_bounds::{Width, graham, long_paths, melani_edf, melani_fp};
use crate::random::graph;
use tool::dag_file::stg;
use tool::files;
use tool::options::{Command, Parsed, Takes, name, options};
use tool::output::Table;
use tool::progress::Lasting;

static COMMAND: Command = Command {
    invocation: "./scripts/bench bounds",
    about: "Draws by utilization how many random sets of DAGs are accepted by lent cores and by \
            other methods; counts what the multi-path bound proves, and the form before it.",
    positional: Some((
        Takes::File("FILE..."),
        "Count only the sets of these files, as in tests/oracle/lent.txt, with or without answers.",
    )),
    options: options! {
        /// The numbers of cores.
        CORES: Takes::Numbers(1, 64), or "4,8,16";
        /// Random sets for each number of cores, utilization and kind of deadlines.
        SETS: Takes::Number(1, 1_000_000), or "200";
        /// The seed of all random sets.
        SEED: Takes::Number(0, u64::MAX), or "1";
        /// The folder for acceptance.csv and acceptance.svg.
        OUT 'o': Takes::File("DIR"), or "target/bounds";
    },
    notes: "\
A set has as many DAGs as cores, but 8 at least. Methods: graham, federated scheduling; multi_path,
the same by the multi-path bound, or global deadline-monotonic priorities; v_fed, virtually-federated
scheduling; lent, heavy DAGs with a fixed order that lend their idle time; fluid, a density test. The
last one is of a scheduler that no machine has. A small set has 2 to 5 DAGs of 2 to 8 subtasks on 2
to 4 cores, with D from the longest path to T, and is one of 100 for each of --sets.

Exit code: 0 counted; 1 a small set was proven before and is not now; 2 the command line or a file
is refused.
",
};

/// The plan of a measurement.
struct BoundsPlan {
    files: Vec<SetFile>,
    cores: Vec<u32>,
    sets: u64,
    seed: u64,
    out: PathBuf,
}

impl BoundsPlan {
    fn new(options: &Parsed) -> Result<Self, String> {
        options.check_distinct(&[name::CORES])?;
        if options.files().len() > 0 {
            let why = "is for random sets; leave it or the files out";
            options.check_without(&[name::CORES, name::SETS, name::SEED, name::OUT], why)?;
        }
        files::check_once(options.files())?;
        (options.named(&[name::OUT]).iter()).try_for_each(files::check_folder)?;
        Ok(Self {
            files: (options.files().map(SetFile::read)).collect::<Result<_, _>>()?,
            cores: options.numbers(name::CORES),
            sets: options.number(name::SETS).unwrap_or_default(),
            seed: options.number(name::SEED).unwrap_or_default(),
            out: options.path(name::OUT).unwrap_or(Path::new("")).into(),
        })
    }
}

/// Runs `bench bounds` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&COMMAND, words, BoundsPlan::new, measure)
}

/// Counts and prints; an error if a set that was proven before is not now.
fn measure(plan: &BoundsPlan) -> Result<bool, String> {
    if !plan.files.is_empty() {
        let _lasting = Lasting::new("counting sets");
        print!("{}", acceptance::of_files(&plan.files));
        return Ok(true);
    }
    print!(
        "{}",
        acceptance::measure(&plan.cores, plan.sets, plan.seed, &plan.out)?
    );
    println!("written: {}", plan.out.display());
    let _lasting = Lasting::new("counting small sets");
    let small = small(100 * plan.sets, plan.seed);
    print!("{}", small_table(&small));
    print!("{}", graph_table()?);
    match small.iter().map(|proven| proven.lost).sum() {
        0_u64 => Ok(true),
        lost => Err(format!("{lost} sets were proven before and are not now")),
    }
}

/// Returns the options and settings for any graphs.
pub(super) fn terms(policy: Policy, cores: u32) -> (CommitOptions, AnalysisSettings) {
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
    /// By the commit's answer.
    now: u64,
    /// Proven by Melani's form, but not now.
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
        let melani = match policy {
            Policy::StaticPriority => {
                // In the order in which a commit derives priorities: deadline-monotonic, ties by
                // position.
                tasks.sort_by_key(|task| task.relative_deadline_ns());
                melani_fp(&tasks, cores, Width::Used).is_some()
            }
            Policy::Edf => melani_edf(&tasks, cores, Width::Used).is_some(),
        };
        self.melani += u64::from(melani);
        self.now += u64::from(now);
        self.lost += u64::from(melani && !now);
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

/// Analyses `sets` small random sets.
fn small(sets: u64, seed: u64) -> ByPolicy {
    let mut random = Random::new(seed);
    proofs((0..sets).map(|_| {
        let cores = random.within(2..=4);
        (draw_small(&mut random), cores)
    }))
}

/// Returns a table with a row for each policy.
fn small_table(proven: &ByPolicy) -> String {
    let columns = "policy:8|sets:9|Melani:10|now:10|now / Melani:14.2";
    let mut table = Table::new("small sets with short deadlines, proven\n", columns);
    for (of, (_, name)) in proven.iter().zip(POLICIES) {
        let of_melani = of.now as f64 / of.melani.max(1) as f64;
        table.row(&[&name, &of.sets, &of.melani, &of.now, &of_melani]);
    }
    table.text()
}

/// The unit of small sets in nanoseconds: 2, 3 and 4 cores divide it, so that the rounding of the
/// older forms has no effect.
const UNIT_NS: u64 = 12;

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
