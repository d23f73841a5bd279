//! What is to be measured, and on what: settled before anything is built.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use replay::repeated;

use super::condition::{Condition, Policy};
use crate::files;
use crate::options::Parsed;
use crate::qemu::{Machine, Mode, PROGRAM, Qemu};
use crate::system;

/// Everything that all conditions have in common, and the conditions.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) out: PathBuf,
    pub(super) conditions: Vec<Condition>,
    pub(super) policies: Vec<Policy>,
    pub(super) subtasks: Vec<usize>,
    pub(super) seeds: Vec<u64>,
    pub(super) jobs: u64,
    pub(super) queue: u64,
    pub(super) cores: u64,
    pub(super) memory_mib: u64,
    /// Whether the conditions are programs of this computer.
    pub(super) on_linux: bool,
    /// The mode that was named; which one it is, the built image settles.
    pub(super) named: Option<Mode>,
    pub(super) mode: Mode,
    /// Whether a deterministic condition is booted once only.
    pub(super) once: bool,
}

impl Plan {
    /// Settles the plan.
    ///
    /// # Errors
    ///
    /// What the options ask for cannot be: one line that says why.
    pub(super) fn new(options: &Parsed) -> Result<Plan, String> {
        let number = |name| options.number(name).unwrap_or(1);
        let on_linux = options.text("on") == Some("linux");
        let of_guests = ["mode", "deterministic", "once"].into_iter();
        if let Some(name) = of_guests
            .filter(|_| on_linux)
            .find(|name| options.is_given(name))
        {
            return Err(format!(
                "`--{name}` is for guests; leave it or `--on linux` out"
            ));
        }
        let usual = match on_linux {
            true => "target/join-latency-on-linux",
            false => options.text("out").unwrap_or_default(),
        };
        let out = options.path("out").filter(|_| options.is_given("out"));
        (options.named(&["out"]).iter()).try_for_each(files::check_folder)?;
        let policies = Policy::list(options.text("policies").unwrap_or_default())?;
        let subtasks: Vec<usize> = options.numbers("subtasks");
        if let Some((_, second)) = repeated(&subtasks) {
            let parallel = subtasks[second];
            return Err(format!("`--subtasks`: {parallel} stands twice"));
        }
        let most_parallel = subtasks.iter().max().map_or(1, |most| *most as u64);
        let least_cores = most_parallel + 2;
        let cores = options.number("cores").unwrap_or(least_cores);
        if cores < least_cores {
            return Err(format!(
                "`--cores {cores}`: source, join and {most_parallel} parallel subtasks need \
                 {least_cores}, so that none waits for a core; give more, or fewer subtasks"
            ));
        }
        let seed = number("seed");
        let last_seed = seed.checked_add(number("repeat") - 1);
        let last_seed =
            last_seed.ok_or("`--repeat`: there are not so many seeds after `--seed`")?;
        let seeds: Vec<u64> = (seed..=last_seed).collect();
        let jobs = number("jobs");
        let named = named_mode(options)?;
        let mut conditions = Vec::new();
        for &subtasks in &subtasks {
            for &policy in &policies {
                let with_seed = |&seed| Condition {
                    policy,
                    subtasks,
                    seed,
                };
                conditions.extend(seeds.iter().map(with_seed));
            }
        }
        if options.is_given("once")
            && let Some(mode) = named.filter(|mode| *mode != Mode::Deterministic)
        {
            return Err(format!(
                "`--once` is for deterministic conditions, and the mode is {mode}, in which each \
                 is booted once; leave it out"
            ));
        }
        Ok(Plan {
            out: out.unwrap_or(Path::new(usual)).into(),
            conditions,
            policies,
            subtasks,
            seeds,
            jobs,
            queue: number("queue"),
            cores,
            // The kernel records each instance, and the app its joins: half a KiB.
            memory_mib: 64 + (jobs * least_cores).div_ceil(2048),
            on_linux,
            named,
            mode: named.unwrap_or(Mode::Deterministic),
            once: options.is_given("once"),
        })
    }

    /// Returns the words of a condition's program on Linux.
    pub(super) fn linux_words(&self, condition: &Condition) -> String {
        let words = condition.guest_words(self.jobs, self.queue);
        format!("cores={} share=on {words}", self.cores)
    }

    /// Names what time means.
    pub(super) fn mode_name(&self) -> &'static str {
        match self.on_linux {
            true => "linux",
            false => self.mode.name(),
        }
    }

    /// Says in one sentence what a time is worth.
    pub(super) fn meaning(&self) -> &'static str {
        match self.on_linux {
            true => "real nanoseconds on real processors, whatever else this computer does",
            false => self.mode.meaning(),
        }
    }

    /// Describes the guest of a condition.
    pub(super) fn qemu(&self, condition: &Condition) -> Qemu {
        let words = condition.guest_words(self.jobs, self.queue);
        Qemu {
            mode: self.mode,
            machine: Machine::Microvm,
            cores: self.cores,
            memory_mib: self.memory_mib,
            guest_words: format!("mode={} {words}", self.mode),
            ..Qemu::default()
        }
    }

    /// Returns where a condition's raw times are kept.
    pub(super) fn file(&self, condition: &Condition) -> PathBuf {
        let name = format!("{}.csv", condition.file_stem());
        self.out.join("conditions").join(name)
    }
}

fn named_mode(options: &Parsed) -> Result<Option<Mode>, String> {
    let named = options.text("mode").and_then(Mode::from_name);
    match (named, options.is_given("deterministic")) {
        (None | Some(Mode::Deterministic), true) => Ok(Some(Mode::Deterministic)),
        (Some(mode), true) => Err(format!(
            "`--mode {mode}` and `--deterministic` exclude each other; give one"
        )),
        (named, false) => Ok(named),
    }
}

/// What is measured with: versions, for the record.
#[derive(Debug)]
pub(super) struct Provenance {
    /// QEMU's version, or Linux's.
    pub(super) qemu: String,
    /// The commit, with a mark if the tree differs from it.
    pub(super) commit: String,
    /// A checksum of the image: other code, other times.
    pub(super) image: String,
}

impl Provenance {
    /// Finds out.
    pub(super) fn of(image: &Path, on_linux: bool) -> Provenance {
        let first_line = |text: String| text.lines().next().unwrap_or("unknown").to_string();
        let version = match on_linux {
            true => output("uname", &["-sr"]),
            false => output(PROGRAM, &["--version"]),
        };
        let qemu = version.map_or("unknown".into(), first_line);
        let commit = output("git", &["rev-parse", "--short=12", "HEAD"]);
        let changes = output("git", &["status", "--porcelain"]);
        let commit = match (commit, changes) {
            (Some(commit), Some(changes)) if changes.is_empty() => commit.trim().to_string(),
            (Some(commit), _) => format!("{} and uncommitted changes", commit.trim()),
            (None, _) => "unknown".into(),
        };
        let bytes = fs::read(image).unwrap_or_default();
        Provenance {
            qemu,
            commit,
            image: format!("{:016x}", checksum(&bytes)),
        }
    }

    /// States everything that a condition's times depend on.
    pub(super) fn statement(&self, plan: &Plan, condition: &Condition) -> String {
        if plan.on_linux {
            let words = plan.linux_words(condition);
            return format!("{}; program {}; {words}", self.qemu, self.image);
        }
        let qemu = plan.qemu(condition);
        format!(
            "{}; image {}; machine {}, {} cores, {} MiB; {}",
            self.qemu, self.image, qemu.machine, qemu.cores, qemu.memory_mib, qemu.guest_words
        )
    }
}

fn output(program: &str, words: &[&str]) -> Option<String> {
    let mut command = Command::new(program);
    let output = command
        .args(words)
        .current_dir(system::workspace())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    output.status.success().then_some(text)
}

/// FNV-1a with 64 bits (Fowler, Noll, Vo; draft-eastlake-fnv).
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::{Path, Plan, checksum};
    use crate::bench::join_latency::table::TABLE;

    fn plan(line: &str) -> Result<Plan, String> {
        Plan::new(&TABLE.right(line))
    }

    #[test]
    fn every_combination_is_a_condition() {
        let plan = plan("--deterministic --repeat 2 --policies fass,exact --seed 5").unwrap();
        assert_eq!(plan.conditions.len(), 3 * 2 * 2);
        assert_eq!((plan.cores, plan.seeds), (8, vec![5, 6]));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refusal = |line: &str| plan(line).unwrap_err();
        assert!(refusal("--cores 7 --deterministic").contains("need 8"));
        assert!(refusal("--subtasks 2,2 --deterministic").contains("twice"));
        assert!(refusal("--mode threads --deterministic").contains("exclude"));
        assert!(refusal("--on linux --once").contains("`--once` is for guests"));
    }

    #[test]
    fn on_linux_results_have_a_folder_of_their_own() {
        let out = |line: &str| plan(line).unwrap().out;
        assert_eq!(out(""), Path::new("target/join-latency"));
        let on_linux = "target/join-latency-on-linux";
        assert_eq!(out("--on linux"), Path::new(on_linux));
        assert_eq!(out("--on linux --out x"), Path::new("x"));
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        assert_eq!(checksum(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(checksum(b"a"), 0xaf63_dc4c_8601_ec8c);
    }
}
