//! How the conditions of a plan are measured: with which image or program, and in which mode.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use recording::Crc;

use super::condition::Condition;
use super::plan::Plan;
use super::times;
use crate::bench::frame::judged;
use crate::program::Order;
use crate::qemu::{Mode, PROGRAM, Qemu};
use crate::{image, install, outcome, probe, program, system};

/// How often a condition is booted at most in deterministic mode.
const MOST_BOOTS: usize = 6;

/// The machine that conditions are measured with, and versions of that, for the record.
#[derive(Debug)]
pub(super) struct Setting<'p> {
    pub(super) plan: &'p Plan,
    /// The mode of the guests; `None`: programs of this computer.
    mode: Option<Mode>,
    image: PathBuf,
    /// A checksum of the image: other code, other times.
    pub(super) checksum: String,
    /// QEMU's version, or Linux's.
    pub(super) version: String,
    /// The commit, with a mark if the tree differs from it.
    pub(super) commit: String,
}

impl<'p> Setting<'p> {
    /// Builds what is to be run, settles the mode, and returns why it is that one.
    ///
    /// # Errors
    ///
    /// In words: it cannot be built, or the mode that is named is of no use.
    pub(super) fn new(plan: &'p Plan) -> Result<(Self, Option<String>), String> {
        let mut setting = Self {
            plan,
            mode: None,
            image: PathBuf::new(),
            checksum: String::new(),
            version: String::new(),
            commit: first_line("git", &["describe", "--always", "--abbrev=12", "--dirty"]),
        };
        let mut why = None;
        if plan.on_linux {
            setting.image = image::build_linux("join-latency", None)?.path;
            setting.version = first_line("uname", &["-sr"]);
        } else {
            install::ensure_qemu()?;
            setting.image = image::build("join-latency")?.path;
            setting.version = first_line(PROGRAM, &["--version"]);
            let machine = setting.qemu(&plan.conditions[0], Mode::Deterministic);
            let (mode, reason) =
                probe::choose(plan.named, Mode::Deterministic, &machine, &setting.image)?;
            setting.mode = Some(mode);
            why = reason.map(|why| format!("mode {mode} because {why}"));
        }
        let mut checksum = Crc::new();
        checksum.update(&fs::read(&setting.image).unwrap_or_default());
        setting.checksum = format!("{:08x}", checksum.value());
        Ok((setting, why))
    }

    /// Names what time means.
    pub(super) fn mode_name(&self) -> &'static str {
        self.mode.map_or("linux", Mode::name)
    }

    /// Says in one sentence what a time is worth.
    pub(super) fn meaning(&self) -> &'static str {
        let on_linux = "real nanoseconds on real processors, whatever else this computer does";
        self.mode.map_or(on_linux, Mode::meaning)
    }

    /// States everything that a condition's times depend on.
    pub(super) fn statement(&self, condition: &Condition) -> String {
        let (version, checksum) = (&self.version, &self.checksum);
        let Some(mode) = self.mode else {
            let words = self.linux_words(condition);
            return format!("{version}; program {checksum}; {words}");
        };
        let qemu = self.qemu(condition, mode);
        format!(
            "{version}; image {checksum}; machine {}, {} cores, {} MiB; {}",
            qemu.machine, qemu.cores, qemu.memory_mib, qemu.guest_words
        )
    }

    /// Returns the words of a condition's program on Linux.
    fn linux_words(&self, condition: &Condition) -> String {
        let words = condition.guest_words(self.plan.jobs, self.plan.queue);
        format!("cores={} share=on {words}", self.plan.cores)
    }

    /// Describes the guest of a condition.
    fn qemu(&self, condition: &Condition, mode: Mode) -> Qemu {
        let words = condition.guest_words(self.plan.jobs, self.plan.queue);
        Qemu {
            mode,
            cores: self.plan.cores,
            memory_mib: self.plan.memory_mib,
            guest_words: format!("mode={mode} {words}"),
            ..Qemu::default()
        }
    }

    /// Measures one condition, and returns its times: in deterministic mode until two boots agree,
    /// or [`MOST_BOOTS`] have been tried; then it says so and returns those of the first.
    ///
    /// Two boots agree as the kernel removes from counted time what depends on the host
    /// (its `machine::counted_time`). That rests on how QEMU 7.2 works, so it is checked
    /// wherever figures are made.
    pub(super) fn measure(&self, condition: &Condition) -> Result<String, String> {
        let is_sure = self.plan.once || self.mode != Some(Mode::Deterministic);
        let mut seen = Vec::new();
        while seen.len() < MOST_BOOTS {
            let times = self.boot_once(condition)?;
            if is_sure || seen.contains(&times) {
                if seen.len() > 1 {
                    eprintln!("{condition}: {} boots until two agreed", seen.len() + 1);
                }
                return Ok(times);
            }
            seen.push(times);
        }
        eprintln!(
            "{condition}: no two of {MOST_BOOTS} boots agree to the last nanosecond; the first is \
             kept"
        );
        Ok(seen.swap_remove(0))
    }

    fn boot_once(&self, condition: &Condition) -> Result<String, String> {
        let jobs = self.plan.jobs;
        let limit = Duration::from_secs(120 + jobs);
        let run = |log: &Path| {
            if let Some(mode) = self.mode {
                let qemu = self.qemu(condition, mode);
                return outcome::boot(&qemu, &self.image, log, limit, |_| {});
            }
            let words = self.linux_words(condition);
            let words: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            let order = Order {
                program: &self.image,
                words: &words,
                is_live: false,
                stops: false,
                log,
                limit,
            };
            program::run(&order, &mut |_| {})
        };
        judged(condition, "join-latency", run, |outcome| {
            let statement = self.statement(condition);
            times::write(&outcome.transcript, &statement, condition.subtasks, jobs)
        })
    }
}

/// Returns the first line that a program says, if it is there and content.
fn first_line(program: &str, words: &[&str]) -> String {
    let mut command = Command::new(program);
    let output = command
        .args(words)
        .current_dir(system::workspace())
        .output();
    let output = output.ok().filter(|output| output.status.success());
    let said = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    let line = said.as_deref().and_then(|said| said.lines().next());
    line.unwrap_or("unknown").into()
}
