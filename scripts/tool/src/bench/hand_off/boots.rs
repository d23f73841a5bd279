//! The boots that measure: which app on how many cores, and what tells its figures.

use std::path::Path;
use std::time::Duration;

use crate::bench::frame::{Figure, judged};
use crate::image;
use crate::json::Object;
use crate::outcome::boot;
use crate::qemu::{Mode, Qemu};

/// How long a boot may take in wall time.
pub(super) const LIMIT: Duration = Duration::from_secs(300);

/// The workloads when the cores vary, and the most subtasks among them.
pub(super) const WORKLOADS: &str = "part=workloads chain=64 branches=16 layered=1000";
pub(super) const MOST_SUBTASKS: u64 = 1000;

/// More cores than a host is sure to have: figures of so many say nothing of time.
const MANY: u64 = 8;

/// Which guest measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The app.
    Figures,
    /// A guest of the tests, which is recorded, for that is what is measured.
    Recorded,
    /// The same guest, whose cores are divided.
    Divided,
}

/// One boot, and its part of the measurement.
#[derive(Clone, Debug)]
pub(super) struct Boot {
    kind: Kind,
    pub(super) cores: u64,
    memory_mib: u64,
    words: String,
}

/// Returns the boots that measure everything in a mode.
pub(super) fn of_mode(mode: Mode) -> Vec<Boot> {
    let all = [
        (Kind::Figures, 1, "part=hand-off"),
        (Kind::Recorded, 1, "test=values record=1024"),
        (Kind::Figures, 2, "part=elsewhere"),
        (Kind::Figures, MANY, WORKLOADS),
        (Kind::Figures, 64, WORKLOADS),
    ];
    let is_counted = mode == Mode::Deterministic;
    let boots = all.into_iter();
    let boots = boots.filter(|&(_, cores, _)| is_counted || cores < MANY);
    boots
        .map(|(kind, cores, words)| Boot::new(kind, cores, MOST_SUBTASKS, words))
        .collect()
}

/// Returns the machine line that the tool prints.
pub(super) fn machine_line(figure: &Figure, mode: Mode) -> String {
    let begun = Object::new().text("kind", "hand_off");
    figure.json(begun.text("mode", mode.name()))
}

impl Boot {
    /// Describes a boot with DAGs of up to so many subtasks: each needs a stack, each core two,
    /// and the kernel leaves a quarter of the memory for stacks.
    pub(super) fn new(kind: Kind, cores: u64, subtasks: u64, words: impl Into<String>) -> Self {
        Self {
            kind,
            cores,
            memory_mib: 256.max((subtasks + 2 * cores) * 3 / 10),
            words: words.into(),
        }
    }

    /// Returns the machine for this boot.
    pub(super) fn qemu(&self, mode: Mode) -> Qemu {
        Qemu {
            mode,
            cores: self.cores,
            memory_mib: self.memory_mib,
            guest_words: format!("mode={mode} {}", self.words),
            // Only what recording costs is wanted.
            records: (self.kind == Kind::Recorded).then(|| "/dev/null".into()),
            ..Qemu::default()
        }
    }

    /// Boots once and reads the figures.
    pub(super) fn measure(&self, mode: Mode, image: &Path) -> Result<Vec<Figure>, String> {
        let cores = self.cores;
        let image = match self.kind {
            Kind::Figures => image.to_path_buf(),
            Kind::Recorded | Kind::Divided => image::build("guest-tests")?.path,
        };
        judged(
            format_args!("the guest on {cores} cores, mode {mode},"),
            "hand-off",
            |log| boot(&self.qemu(mode), &image, log, LIMIT, |_| {}),
            |outcome| match Figure::read_all(&outcome.transcript, cores)? {
                figures if figures.is_empty() => Err("it printed no figures".into()),
                figures => Ok(figures),
            },
        )
    }
}
