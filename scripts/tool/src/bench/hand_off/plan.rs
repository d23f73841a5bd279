//! What is to be measured, and on what: settled before anything is built.

use std::path::PathBuf;

use super::baseline;
use super::figure::Figure;
use super::scale;
use crate::files::{self, Named};
use crate::options::Parsed;
use crate::qemu::{Mode, Qemu};
use crate::system;

/// The baseline that is kept, from the workspace's root.
pub(super) const BASELINE: &str = "tests/baselines/hand-off.json";

/// The options of a baseline: it is of the defaults of these.
const SIZES: &[&str] = &["jobs", "chain", "branches", "layered", "seed", "append"];

/// Returns the memory, in MiB, for DAGs of `subtasks` subtasks: each needs a stack, each
/// core two, and the kernel leaves a quarter of the memory for stacks.
fn memory_mib(subtasks: u64, cores: u64) -> u64 {
    256.max((subtasks + 2 * cores) * 3 / 10)
}

/// Numbers of cores whose figures the baseline keeps, too, where instructions are counted: more
/// than a host is sure to have, so they say nothing of time.
const MANY_CORES: [u64; 2] = [8, 64];

/// What one boot measures.
#[derive(Clone, Debug)]
pub(super) struct Boot {
    pub(super) cores: u64,
    memory_mib: u64,
    words: String,
    /// Whether its trace tells what was measured, rather than its own figures.
    pub(super) is_traced: bool,
    /// Whether it is recorded, for that is what is measured, by a guest of the tests.
    pub(super) is_recorded: bool,
    /// Whether its cores are divided, in which that guest can, too.
    pub(super) is_divided: bool,
}

/// Everything that is to be measured.
#[derive(Debug)]
pub(super) struct Plan {
    /// The one mode to measure in; else instructions and time.
    pub(super) mode: Option<Mode>,
    pub(super) boots: Vec<Boot>,
    /// Numbers of cores and of subtasks to count the cost of, instead.
    pub(super) scale: Option<Scale>,
    /// What to log instead, instruction by instruction, and where to write it.
    pub(super) listing: Option<(Boot, PathBuf)>,
    /// The figures of the baseline, if they are to be compared.
    pub(super) before: Option<Vec<Figure>>,
    pub(super) saves: bool,
    pub(super) baseline: PathBuf,
}

/// Which sizes the cost is to be counted at.
#[derive(Debug)]
pub(super) struct Scale {
    pub(super) cores: Vec<u64>,
    pub(super) subtasks: Vec<u64>,
    pub(super) jobs: u64,
}

impl Scale {
    fn new(options: &Parsed) -> Scale {
        let numbers = |name| {
            let text = options.text(name).unwrap_or_default();
            text.split(',')
                .filter_map(|number| number.parse().ok())
                .collect()
        };
        Scale {
            cores: numbers("cores"),
            subtasks: numbers("subtasks"),
            jobs: options.number("jobs").unwrap_or(2),
        }
    }
}

impl Plan {
    /// Settles the plan.
    ///
    /// # Errors
    ///
    /// What the options ask for cannot be: one line that says why.
    pub(super) fn new(options: &Parsed) -> Result<Plan, String> {
        let mode = options.text("mode").and_then(Mode::from_name);
        let [compares, saves] =
            ["compare", "save-baseline"].map(|name| options.is_given(name).then_some(name));
        options.check_distinct(&["chain", "branches", "layered", "cores", "subtasks"])?;
        if options.is_given("baseline") && compares.or(saves).is_none() {
            let line = "`--baseline` without `--compare` and `--save-baseline`: it has no use; \
                        give one of them, or leave it out";
            return Err(line.into());
        }
        if let Some(name) = compares.or(saves) {
            if let Some(size) = SIZES.iter().find(|size| options.is_given(size)) {
                return Err(format!(
                    "`--{name}` with `--{size}`: the baseline is of the default of `--{size}`; \
                     leave one of them out"
                ));
            }
            if mode.is_some_and(|mode| mode != Mode::Deterministic) {
                return Err(format!(
                    "`--{name}` needs the instructions, which this mode does not count; \
                     leave `--mode` out"
                ));
            }
        }
        let baseline = options
            .path("baseline")
            .map_or_else(|| system::workspace().join(BASELINE), PathBuf::from);
        let listing = options.path("listing").map(PathBuf::from);
        let outputs = [
            ("baseline", saves.map(|_| &baseline)),
            ("listing", listing.as_ref()),
        ];
        for (option, path) in outputs {
            if let Some(path) = path {
                files::check(&[], &[Named { option, path }])?;
            }
        }
        let scale = options.is_given("scale").then(|| Scale::new(options));
        let others = ["compare", "save-baseline", "baseline", "mode"];
        let others = others.iter().chain(SIZES);
        let (idle, reason): (Vec<&str>, _) = if listing.is_some() {
            let others = others.chain(&["scale", "cores", "subtasks"]);
            (
                others.copied().filter(|name| *name != "append").collect(),
                "with `--listing`: it logs a run of its own",
            )
        } else if scale.is_some() {
            (
                others.copied().filter(|name| *name != "jobs").collect(),
                "with `--scale`: it counts instructions at sizes of its own, for no baseline",
            )
        } else {
            (
                vec!["cores", "subtasks"],
                "without `--scale`: these are sizes for it",
            )
        };
        if let Some(name) = idle.iter().find(|name| options.is_given(name)) {
            return Err(format!("`--{name}` {reason}; leave `--{name}` out"));
        }
        Ok(Plan {
            mode,
            scale,
            boots: boots(options),
            listing: listing.map(|file| (Boot::of_listing(options), file)),
            before: match compares {
                Some(_) => Some(baseline::read(&baseline)?),
                None => None,
            },
            saves: saves.is_some(),
            baseline,
        })
    }
}

/// Returns the boots that measure everything at these sizes.
fn boots(options: &Parsed) -> Vec<Boot> {
    let text = |name| options.text(name).unwrap_or_default();
    let [jobs, chain, branches, layered, seed] =
        ["jobs", "chain", "branches", "layered", "seed"].map(text);
    let sizes = format!("chain={chain} branches={branches} layered={layered} seed={seed}");
    let numbers = [chain, layered].map(|sizes| sizes.split(','));
    let numbers = numbers.into_iter().flatten().map(str::parse);
    let largest = numbers.filter_map(Result::ok).max().unwrap_or(0);
    let boot = |cores, part: &str, words: String| Boot {
        cores,
        memory_mib: memory_mib(largest, cores),
        words: format!("part={part} {words} {}", text("append")),
        is_traced: part == "traced",
        is_recorded: false,
        is_divided: false,
    };
    // A trace shows what it shows in a few jobs.
    let traced = format!("jobs=20 branches={branches} trace=dump");
    let many =
        MANY_CORES.map(|cores| boot(cores, "workloads", format!("jobs={jobs} {}", scale::SIZES)));
    let few = [
        boot(1, "hand-off", format!("jobs={jobs} {sizes}")),
        boot(1, "traced", traced.clone()),
        Boot {
            cores: 1,
            memory_mib: memory_mib(0, 1),
            words: format!("test=values jobs={jobs} record=1024 {}", text("append")),
            is_traced: false,
            is_recorded: true,
            is_divided: false,
        },
        boot(2, "elsewhere", format!("jobs={jobs}")),
        boot(2, "traced", traced),
    ];
    few.into_iter().chain(many).collect()
}

impl Boot {
    /// Reports whether it measures something in this mode.
    pub(super) fn is_for(&self, mode: Mode) -> bool {
        mode == Mode::Deterministic || !MANY_CORES.contains(&self.cores)
    }

    /// Returns a boot that runs the workloads alone, for what their size and the
    /// number of cores cost; `largest` is the most subtasks of a DAG among them.
    pub(super) fn of_scale(cores: u64, jobs: u64, largest: u64, sizes: &str) -> Boot {
        Boot {
            cores,
            memory_mib: memory_mib(largest, cores),
            words: format!("part=workloads jobs={jobs} {sizes}"),
            is_traced: false,
            is_recorded: false,
            is_divided: false,
        }
    }

    /// Returns a boot that runs a layered graph in each of so many clusters.
    pub(super) fn of_clusters(clusters: u64, jobs: u64) -> Boot {
        let cores = clusters * scale::CORES_OF_A_CLUSTER;
        let sizes = (0..clusters).map(|_| scale::CORES_OF_A_CLUSTER.to_string());
        let sizes: Vec<String> = sizes.collect();
        Boot {
            cores,
            memory_mib: memory_mib(clusters * scale::OF_A_CLUSTER, cores),
            words: format!(
                "test=cluster_scale jobs={jobs} clusters={}",
                sizes.join(",")
            ),
            is_traced: false,
            is_recorded: false,
            is_divided: true,
        }
    }

    /// Returns the boot whose hops are logged: a chain, and few jobs, as a log is long.
    fn of_listing(options: &Parsed) -> Boot {
        let sizes = format!(
            "chain=64 branches=1 layered=3 {}",
            options.text("append").unwrap_or_default()
        );
        Boot::of_scale(1, 5, 64, &sizes)
    }

    /// Returns the machine for this boot.
    pub(super) fn qemu(&self, mode: Mode) -> Qemu {
        Qemu {
            mode,
            cores: self.cores,
            memory_mib: self.memory_mib,
            guest_words: format!("mode={mode} {}", self.words),
            ..Qemu::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Plan;
    use crate::bench::hand_off::table::TABLE;

    fn plan(line: &str) -> Result<Plan, String> {
        Plan::new(&TABLE.right(line))
    }

    #[test]
    fn sizes_become_words_of_the_guest() {
        let plan = plan("--mode deterministic --branches 3,5 --jobs 7").unwrap();
        let words = &plan.boots[0].words;
        assert!(words.contains("part=hand-off jobs=7 chain=64 branches=3,5 layered=1000 seed=1"));
        assert!(plan.boots.iter().any(|boot| boot.cores == 2));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refused = |line| plan(line).unwrap_err();
        assert!(refused("--compare --jobs 5").contains("the default of `--jobs`"));
        assert!(refused("--compare --mode threads").contains("leave `--mode` out"));
        assert!(refused("--save-baseline --mode threads").contains("`--save-baseline`"));
        assert!(refused("--scale --compare").contains("leave `--compare` out"));
        assert!(refused("--scale --chain 5").contains("leave `--chain` out"));
        assert!(refused("--cores 5").contains("without `--scale`"));
        assert!(refused("--listing x --chain 5").contains("leave `--chain` out"));
        assert!(refused("--listing x --scale").contains("a run of its own"));
        assert!(refused("--listing /none/x").contains("cannot be written"));
        assert!(refused("--scale --cores 2,2").contains("`2` stands twice"));
        assert!(refused("--baseline x").contains("without `--compare`"));
        let missing = refused("--compare --baseline /none/x --mode deterministic");
        assert!(missing.starts_with("the baseline `/none/x`: "), "{missing}");
        let unwritable = refused("--save-baseline --baseline /none/x --mode deterministic");
        assert!(unwritable.contains("cannot be written"), "{unwritable}");
        assert!(plan("--scale --cores 5 --jobs 9").is_ok());
        assert!(plan("--listing /dev/null --append trace_events=0").is_ok());
    }
}
