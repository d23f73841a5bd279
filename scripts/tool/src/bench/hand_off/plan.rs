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

/// Numbers of cores whose figures the baseline keeps, too, where instructions are counted: more
/// than a host is sure to have, so they say nothing of time.
const MANY_CORES: [u64; 2] = [8, 64];

/// What tells what a boot has measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Its own figures.
    Figures,
    /// Its trace.
    Trace,
    /// Its own figures; it is recorded, for that is what is measured, by a guest of the tests.
    Recorded,
    /// Its own figures; its cores are divided, in which that guest can, too.
    Divided,
}

/// What one boot measures.
#[derive(Clone, Debug)]
pub(super) struct Boot {
    pub(super) kind: Kind,
    pub(super) cores: u64,
    memory_mib: u64,
    words: String,
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
        Scale {
            cores: options.numbers("cores"),
            subtasks: options.numbers("subtasks"),
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
    let numbers = ["chain", "layered"].map(|name| options.numbers(name));
    let largest = numbers.into_iter().flatten().max().unwrap_or(0);
    let boot = |kind, cores, words: String| {
        let words = format!("{words} {}", text("append"));
        Boot::new(kind, cores, largest, words)
    };
    // A trace shows what it shows in a few jobs.
    let traced = |cores| {
        let words = format!("part=traced jobs=20 branches={branches} events=on");
        boot(Kind::Trace, cores, words)
    };
    let many = MANY_CORES.map(|cores| {
        let words = format!("part=workloads jobs={jobs} {}", scale::SIZES);
        boot(Kind::Figures, cores, words)
    });
    let recorded = format!("test=values jobs={jobs} record=1024");
    let few = [
        boot(
            Kind::Figures,
            1,
            format!("part=hand-off jobs={jobs} {sizes}"),
        ),
        traced(1),
        boot(Kind::Recorded, 1, recorded),
        boot(Kind::Figures, 2, format!("part=elsewhere jobs={jobs}")),
        traced(2),
    ];
    few.into_iter().chain(many).collect()
}

impl Boot {
    /// Describes a boot with DAGs of up to so many subtasks: each needs a stack, each core two,
    /// and the kernel leaves a quarter of the memory for stacks.
    fn new(kind: Kind, cores: u64, subtasks: u64, words: String) -> Boot {
        Boot {
            kind,
            cores,
            memory_mib: 256.max((subtasks + 2 * cores) * 3 / 10),
            words,
        }
    }

    /// Reports whether it measures something in this mode.
    pub(super) fn is_for(&self, mode: Mode) -> bool {
        mode == Mode::Deterministic || !MANY_CORES.contains(&self.cores)
    }

    /// Returns a boot that runs the workloads alone, for what their size and the
    /// number of cores cost; `largest` is the most subtasks of a DAG among them.
    pub(super) fn of_scale(cores: u64, jobs: u64, largest: u64, sizes: &str) -> Boot {
        let words = format!("part=workloads jobs={jobs} {sizes}");
        Boot::new(Kind::Figures, cores, largest, words)
    }

    /// Returns a boot that runs a layered graph in each of so many clusters.
    pub(super) fn of_clusters(clusters: u64, jobs: u64) -> Boot {
        let each = scale::CORES_OF_A_CLUSTER;
        let sizes: Vec<String> = (0..clusters).map(|_| each.to_string()).collect();
        let sizes = sizes.join(",");
        let words = format!("test=cluster_scale jobs={jobs} clusters={sizes}");
        let subtasks = clusters * scale::OF_A_CLUSTER;
        Boot::new(Kind::Divided, clusters * each, subtasks, words)
    }

    /// Returns the boot whose hops are logged: a chain, and few jobs, as a log is long.
    fn of_listing(options: &Parsed) -> Boot {
        let append = options.text("append").unwrap_or_default();
        let sizes = format!("chain=64 branches=1 layered=3 {append}");
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

    /// Command lines, and what is said of them. More are in `tests/commands/files.rs`.
    const REFUSED: &str = "--compare --jobs 5 | the default of `--jobs`
--compare --mode threads | leave `--mode` out
--save-baseline --mode threads | `--save-baseline`
--scale --compare | leave `--compare` out
--scale --chain 5 | leave `--chain` out
--cores 5 | without `--scale`
--listing x --chain 5 | leave `--chain` out
--listing x --scale | a run of its own
--listing /none/x | cannot be written
--scale --cores 2,2 | `2` stands twice
--baseline x | without `--compare`
--compare --baseline /none/x --mode deterministic | the baseline `/none/x`: ";

    #[test]
    fn what_cannot_be_is_refused() {
        for row in REFUSED.lines() {
            let (line, words) = row.split_once(" | ").expect(row);
            let refused = plan(line).expect_err(line);
            assert!(refused.contains(words), "{refused}");
        }
        assert!(plan("--scale --cores 5 --jobs 9").is_ok());
        assert!(plan("--listing /dev/null --append trace_events=0").is_ok());
    }
}
