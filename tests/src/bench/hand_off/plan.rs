//! What is to be measured, and on what: settled before anything is built.

use std::path::{Path, PathBuf};

use crate::options::Parsed;
use crate::probe;
use crate::qemu::{Mode, PROGRAM, Qemu};
use crate::system;

/// The options of a baseline: it is of the defaults of these.
const SIZES: &[&str] = &["jobs", "chain", "branches", "layered", "seed", "append"];

/// What one boot measures.
#[derive(Clone, Debug)]
pub(super) struct Boot {
    pub(super) cores: u64,
    memory_mib: u64,
    words: String,
}

/// Everything that is to be measured.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) modes: Vec<Mode>,
    pub(super) boots: Vec<Boot>,
    pub(super) compares: bool,
    pub(super) saves: bool,
    pub(super) baseline: PathBuf,
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
        Ok(Plan {
            modes,
            boots: boots(options),
            compares: compares.is_some(),
            saves: saves.is_some(),
            baseline,
        })
    }
}

fn boots(options: &Parsed) -> Vec<Boot> {
    let text = |name| options.text(name).unwrap_or_default();
    let sizes = ["jobs", "chain", "branches", "layered", "seed"];
    let words = sizes.map(|name| format!("{name}={}", text(name)));
    let words = format!("{} {}", words.join(" "), text("append"));
    vec![Boot {
        cores: 1,
        memory_mib: 256,
        words,
    }]
}

impl Boot {
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
