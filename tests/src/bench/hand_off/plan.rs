//! What is to be measured, and on what: settled before anything is built.

use std::path::{Path, PathBuf};

use crate::options::Parsed;
use crate::probe;
use crate::qemu::{Mode, PROGRAM, Qemu};
use crate::system;

/// The options of a baseline: it is of the defaults of these.
const SIZES: &[&str] = &["jobs", "chain", "branches", "layered", "seed", "append"];

/// Memory for 10,000 subtasks, each of which may need a stack, in MiB.
const SCALE_MIB: u64 = 3000;

/// What one boot measures.
#[derive(Clone, Debug)]
pub(super) struct Boot {
    pub(super) cores: u64,
    memory_mib: u64,
    words: String,
    /// Whether its trace tells what is to be counted, rather than its figures.
    pub(super) counts_wakeups: bool,
}

/// Everything that is to be measured.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) modes: Vec<Mode>,
    pub(super) boots: Vec<Boot>,
    /// Numbers of cores and of subtasks to count the cost of, instead.
    pub(super) scale: Option<Scale>,
    pub(super) compares: bool,
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
        let modes = match options.text("mode").and_then(Mode::from_name) {
            Some(mode) => vec![mode],
            None if probe::kvm(Path::new(PROGRAM)).is_ok() => vec![Mode::Deterministic, Mode::Kvm],
            None => vec![Mode::Deterministic, Mode::Threads],
        };
        let [compares, saves] =
            ["compare", "save-baseline"].map(|name| options.is_given(name).then_some(name));
        if let Some(name) = compares.or(saves) {
            if let Some(size) = SIZES.iter().find(|size| options.is_given(size)) {
                return Err(format!(
                    "`--{name}` with `--{size}`: the baseline is of the default of `--{size}`; \
                     leave one of them out"
                ));
            }
            if !modes.contains(&Mode::Deterministic) {
                return Err(format!(
                    "`--{name}` needs the instructions, which this mode does not count; \
                     leave `--mode` out"
                ));
            }
        }
        let baseline = options.text("baseline").map_or_else(
            || system::workspace().join("tests/baselines/hand-off.json"),
            PathBuf::from,
        );
        let scale = options.is_given("scale").then(|| Scale::new(options));
        let other = ["compare", "save-baseline", "mode"];
        match other.iter().find(|name| options.is_given(name)) {
            Some(other) if scale.is_some() => {
                return Err(format!(
                    "`--scale` with `--{other}`: it counts instructions, for no baseline; leave \
                     one of them out"
                ));
            }
            _ => {}
        }
        Ok(Plan {
            modes,
            scale,
            boots: boots(options),
            compares: compares.is_some(),
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
    let boot = |cores, part: &str, words: String| Boot {
        cores,
        memory_mib: 256,
        words: format!("part={part} {words} {}", text("append")),
        counts_wakeups: part == "workloads",
    };
    // A trace shows what it shows in a few jobs.
    let wakeups = format!("jobs=20 chain=2 layered=3 branches={branches} trace=dump");
    vec![
        boot(1, "hand-off", format!("jobs={jobs} {sizes}")),
        boot(1, "workloads", wakeups),
        boot(2, "elsewhere", format!("jobs={jobs}")),
    ]
}

impl Boot {
    /// Returns a boot that runs the workloads alone, for what their size and the
    /// number of cores cost.
    pub(super) fn of_scale(cores: u64, jobs: u64, sizes: &str) -> Boot {
        Boot {
            cores,
            memory_mib: SCALE_MIB,
            words: format!("part=workloads jobs={jobs} {sizes}"),
            counts_wakeups: false,
        }
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
