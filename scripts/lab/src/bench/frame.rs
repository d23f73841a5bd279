//! The framework shared by all measurements.
//!
//! - [`by_plan`]: from a command line to an exit code;
//! - [`judged`]: a run of a guest or a program, with its lines read after success;
//! - [`Figure`]: a measured quantity, as printed by a guest and as kept by a baseline;
//! - [`draw`]: pictures, by the Python scripts of `scripts/plot`, where Python has matplotlib.

use std::ffi::OsString;
use std::fmt::Display;
use std::fs;
use std::path::Path;
use std::process::{self, ExitCode, Stdio};

use sched_dag::law::Distribution;

use tool::options::{Command, CommandLine, Refusal};
use tool::outcome::Outcome;
use tool::system;
use views::json::{Object, Value};
use views::protocol::Transcript;

/// Runs a measurement: `plan` turns the options into a plan, and `measure` returns whether all
/// limits hold.
pub(super) fn by_plan<Plan>(
    table: &Command,
    words: &[OsString],
    plan: impl Fn(&CommandLine) -> Result<Plan, String>,
    measure: impl Fn(&Plan) -> Result<bool, String>,
) -> ExitCode {
    table.carry_out(words, |options| {
        let plan = plan(options).map_err(Refusal::Usage)?;
        let is_good = measure(&plan)?;
        Ok(ExitCode::from(u8::from(!is_good)))
    })
}

/// Runs a measurement with a new log, and returns the result of `read` on the outcome. `what` names
/// the measurement in errors.
///
/// # Errors
///
/// In words: the measurement could not be run, has failed, or printed malformed lines; then the log
/// stays.
pub(super) fn judged<T>(
    what: impl Display,
    name: &str,
    run: impl FnOnce(&Path) -> Result<Outcome, String>,
    read: impl FnOnce(&Outcome) -> Result<T, String>,
) -> Result<T, String> {
    let log = system::new_log(name)?;
    let outcome = run(&log)?;
    let judgement = outcome.judge().map_err(|fault| fault.reason);
    let found = judgement.and_then(|()| read(&outcome));
    let found = found.map_err(|why| format!("{what} failed: {why}\n{}", outcome.tail()))?;
    // Failing to remove our own log harms nothing.
    let _ = fs::remove_file(&log);
    Ok(found)
}

/// A measured quantity of one workload on a number of cores.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Figure {
    pub(super) cores: u64,
    pub(super) workload: String,
    pub(super) figure: String,
    /// The number of steps covered by each of the numbers below.
    pub(super) per: u64,
    pub(super) median: u64,
    pub(super) p99: u64,
    pub(super) max: u64,
    /// The least sample; baselines do not keep it.
    pub(super) min: u64,
    /// The number of samples; baselines do not keep it.
    pub(super) samples: u64,
}

impl Figure {
    /// Makes a figure from samples of `per` steps each.
    pub(super) fn new(
        (cores, workload, figure): (u64, impl ToString, &str),
        per: u64,
        samples: impl IntoIterator<Item = u64>,
    ) -> Self {
        let of = Distribution::new(samples);
        Self {
            cores,
            workload: workload.to_string(),
            figure: figure.into(),
            per,
            median: of.median(),
            p99: of.p99(),
            max: of.max(),
            min: of.min(),
            samples: of.count(),
        }
    }

    /// Reads all figures of a boot.
    pub(super) fn read_all(transcript: &Transcript, cores: u64) -> Result<Vec<Self>, String> {
        let lines = transcript.of_kind("hand_off");
        let figures = lines.map(|line| {
            let value = &line.value;
            Self::read(value, cores, value.get("value").unwrap_or(value))
                .ok_or_else(|| format!("serial line {}: a figure lacks a member", line.number))
        });
        figures.collect()
    }

    /// Reads a figure written by [`json`](Self::json).
    pub(super) fn from_json(value: &Value) -> Option<Self> {
        Self::read(value, value.get("cores")?.as_u64()?, value)
    }

    /// Reads a figure; `numbers` is the object with the figure's numbers: a member of `value`, or
    /// `value` itself.
    fn read(value: &Value, cores: u64, numbers: &Value) -> Option<Self> {
        let text = |name| value.get(name)?.as_text().map(String::from);
        let number = |name| numbers.get(name)?.as_u64();
        Some(Self {
            cores,
            workload: text("workload")?,
            figure: text("figure")?,
            // A figure per 0 steps could not be divided.
            per: value.get("per")?.as_u64().filter(|per| *per > 0)?,
            median: number("median")?,
            p99: number("p99")?,
            max: number("max")?,
            ..Self::default()
        })
    }

    /// Adds the members of the figure to an object, and returns the object's text.
    pub(super) fn json(&self, begun: Object) -> String {
        begun
            .number("cores", self.cores)
            .text("workload", &self.workload)
            .text("figure", &self.figure)
            .number("per", self.per)
            .number("median", self.median)
            .number("p99", self.p99)
            .number("max", self.max)
            .into_text()
    }

    /// Returns whether two figures are of the same quantity.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        (self.cores, &self.workload, &self.figure) == (other.cores, &other.workload, &other.figure)
    }

    /// Returns whether the figure counts something other than time or instructions.
    pub(super) fn is_count(&self) -> bool {
        matches!(&*self.figure, "allocations" | "locks" | "sink_wakeups")
    }

    /// Returns one of the figure's numbers per step.
    pub(super) fn of_step(&self, number: u64) -> f64 {
        number as f64 / self.per as f64
    }

    /// Returns one of the figure's numbers per step, as text.
    pub(super) fn one(&self, number: u64) -> String {
        let decimals = match (self.per, self.is_count()) {
            (1, _) => 0,
            (_, true) => 2,
            (_, false) => 1,
        };
        format!("{:.decimals$}", self.of_step(number))
    }
}

/// Runs a script of `scripts/plot` on the results in `out`. The pictures go into a folder `plots`
/// there.
///
/// # Errors
///
/// One line: the missing program or package, or the error.
pub(super) fn draw(script: &str, out: &Path) -> Result<(), String> {
    let before = fs::read_dir(out.join("plots"));
    for picture in before.into_iter().flatten().flatten() {
        let path = picture.path();
        if path.extension().is_some_and(|ending| ending == "svg") {
            // Drawing may fail, and a picture of earlier figures would then be wrong.
            let _ = fs::remove_file(path);
        }
    }
    let script = system::workspace().join("scripts/plot").join(script);
    let mut complaint = String::new();
    // A person's own Python may hide the system's, for which the package manager installs
    // matplotlib.
    for program in ["python3", "/usr/bin/python3"] {
        let mut command = process::Command::new(program);
        match command.args([&script, out]).stdin(Stdio::null()).output() {
            Ok(output) if output.status.success() => return Ok(()),
            Ok(output) => complaint = String::from_utf8_lossy(&output.stderr).into_owned(),
            Err(error) => complaint = format!("cannot start {program}: {error}"),
        }
    }
    let last = complaint.lines().last().unwrap_or_default();
    Err(format!(
        "no plots: {last}; they need python3 with matplotlib: install it (Debian, Ubuntu: \
         apt-get install python3-matplotlib; else: pip install matplotlib) and run this again, \
         nothing is measured twice"
    ))
}
