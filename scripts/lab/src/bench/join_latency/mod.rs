//! The paper's evaluation: join latency by a DAG, by equal and by close stamps.
//!
//! A *condition* is a joining policy, the number N of parallel subtasks, and a seed. Each condition
//! is one boot of the app `join-latency`, which prints the times of all executions and joins. The
//! times are kept in one file for each condition; everything else is computed from the files:
//! samples, summary, pictures, table. So an interruption loses nothing, and a file is not measured
//! again as long as the circumstances stay the same (image, QEMU, all options).
//!
//! - here: the plan, the conditions and their boots;
//! - `figures`: from the guest's lines to figures, and their output.

mod figures;

use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, ExitCode};
use std::time::Duration;

use recording::Crc;
use text::quoted;

use super::frame::{by_plan, draw, judged};
use figures::ConditionFigures;
use tool::files;
use tool::options::{Command, CommandLine, ValueKind, options};
use tool::program::ProgramOrder;
use tool::progress::Progress;
use tool::qemu::{Mode, PROGRAM, Qemu};
use tool::{image, install, outcome, probe, program, system};

/// Runs `bench join-latency` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&TABLE, words, JoinPlan::new, |plan| {
        measure_all(plan).map(|()| true)
    })
}

/// Measures the missing conditions, and writes all results.
fn measure_all(plan: &JoinPlan) -> Result<(), String> {
    let (setting, why) = JoinSetup::new(plan)?;
    let (conditions, jobs, cores) = (plan.conditions.len(), plan.jobs, plan.cores);
    let (mode, version) = (setting.mode_name(), &setting.version);
    println!("{conditions} conditions of {jobs} jobs; mode {mode}, {cores} cores; {version}");
    println!("time: {}", setting.meaning());
    if let Some(why) = why {
        println!("{why}");
    }
    let folder = plan.out.join("conditions");
    let made = fs::create_dir_all(&folder);
    made.map_err(|error| format!("cannot make `{}`: {error}", folder.display()))?;
    let mut progress = Progress::new(conditions as u64, "conditions");
    let mut measured = Vec::new();
    for (condition, over) in plan.conditions.iter().zip(0..) {
        progress.show(over);
        let statement = setting.statement(condition);
        let file = folder.join(format!("{}.csv", condition.file_stem()));
        let read = |text: String| figures::read(&text, &statement, condition.subtasks);
        // A file measured under other circumstances, or a damaged file, counts as missing.
        let samples = match fs::read_to_string(&file).ok().and_then(read) {
            Some(samples) => samples,
            None => {
                let text = setting.measure(condition)?;
                write_whole(&file, &text)?;
                read(text).ok_or_else(|| format!("{condition}: its times are damaged"))?
            }
        };
        measured.push((*condition, ConditionFigures::of(&samples)));
        // After each condition, so an interruption leaves the figures measured so far.
        let summary = figures::summary_json(&setting, &measured);
        write_whole(&plan.out.join("summary.json"), &summary)?;
        write_whole(
            &plan.out.join("samples.csv"),
            &figures::samples_csv(&measured),
        )?;
    }
    progress.wipe();
    if let Err(line) = draw("join_latency.py", &plan.out) {
        eprintln!("{line}");
    }
    print!("{}", figures::table(&measured));
    println!("written: {}", plan.out.display());
    Ok(())
}

/// Writes a file whole or not at all: an interruption leaves the old file.
fn write_whole(path: &Path, text: &str) -> Result<(), String> {
    let unfinished = path.with_extension("unfinished");
    files::write(&unfinished, text)?;
    // A rename within one folder is atomic.
    let renamed = fs::rename(&unfinished, path);
    renamed.map_err(|error| format!("cannot write `{}`: {error}", path.display()))
}

/// The options and the help text of `bench join-latency`.
static TABLE: Command = Command {
    invocation: "./scripts/bench join-latency",
    about: "Reproduces the paper's evaluation: joins by a DAG, by equal and by close stamps.",
    positional: None,
    options: OPTIONS,
    notes: "\
writes into DIR:
  summary.json        counts, median, mean, p99, max of each condition
  samples.csv         each sample of each metric
  conditions/*.csv    each condition's raw times, written when it is complete
  plots/*.svg         if python3 has matplotlib

Interrupted, it keeps the conditions that are complete; run again with the same
options, it measures the others only. docs/paper.md explains the metrics.

exit codes: 0 all conditions are measured; 1 one failed; 2 a refused command line
",
};

options! {
    /// The folder for all results; what is there already is not measured again. If not given,
    /// target/join-latency, or target/join-latency-on-linux.
    OUT 'o': ValueKind::File("DIR");
    /// Jobs of each condition.
    JOBS: ValueKind::Number(1, 100_000), or "2000";
    /// Parallel subtasks N; a condition has two processors more than the largest.
    SUBTASKS: ValueKind::Numbers(1, 16), or "2,4,6";
    /// The policies: fass, exact, approximate-MS with the longest interval.
    POLICIES: ValueKind::Text("LIST"), or "fass,exact,approximate-10,approximate-30,approximate-50";
    /// Runs of each condition, with the seeds from 1 on of the execution times, the same for
    /// every policy.
    REPEAT: ValueKind::Number(1, 1000), or "1";
    /// Where: on the machine in QEMU, or on this computer's processors, which cores share if
    /// there are fewer.
    ON: ValueKind::OneOf(&["machine", "linux"]), or "machine";
    /// Queue size of the synchronizers.
    QUEUE: ValueKind::Number(1, 100_000), or "1000";
    /// The meaning of time, see ./scripts/run --help; kvm where it works, else deterministic.
    MODE: ValueKind::OneOf(Mode::NAMES);
}

/// The settings that all conditions share, and the conditions.
#[derive(Clone, Debug)]
struct JoinPlan {
    out: PathBuf,
    /// For each N all policies, for each policy all seeds.
    conditions: Vec<JoinCondition>,
    seeds: Vec<u64>,
    jobs: u64,
    queue: u64,
    cores: u64,
    memory_mib: u64,
    /// Whether the conditions run as programs on this computer.
    on_linux: bool,
    /// The named mode; `None`: the built image decides.
    named: Option<Mode>,
}

impl JoinPlan {
    /// Makes the plan from the options.
    ///
    /// # Errors
    ///
    /// One line with the reason: the options contradict each other.
    fn new(options: &CommandLine) -> Result<JoinPlan, String> {
        let on_linux = options.text(name::ON) == Some("linux");
        if on_linux {
            let why = "is for guests; leave it or `--on linux` out";
            options.check_without(&[name::MODE], why)?;
        }
        (options.named(&[name::OUT]).iter()).try_for_each(files::check_folder)?;
        options.check_distinct(&[name::POLICIES, name::SUBTASKS])?;
        let policies = Policy::list(options.text(name::POLICIES).unwrap_or_default())?;
        let number = |name| options.number(name).unwrap_or(1);
        let subtasks: Vec<usize> = options.numbers(name::SUBTASKS);
        let seeds: Vec<u64> = (1..=number(name::REPEAT)).collect();
        let of_size = |&subtasks: &usize| {
            let seeds = &seeds;
            let of_policy = move |&policy: &Policy| {
                seeds.iter().map(move |&seed| JoinCondition {
                    policy,
                    subtasks,
                    seed,
                })
            };
            policies.iter().flat_map(of_policy)
        };
        let conditions = subtasks.iter().flat_map(of_size).collect();
        // A core each for source, join and parallel subtasks, so no subtask waits for a core.
        let cores = subtasks.iter().max().map_or(1, |most| *most as u64) + 2;
        let folder = match on_linux {
            true => "target/join-latency-on-linux",
            false => "target/join-latency",
        };
        let jobs = number(name::JOBS);
        Ok(JoinPlan {
            out: options.path(name::OUT).unwrap_or(Path::new(folder)).into(),
            conditions,
            seeds,
            jobs,
            queue: number(name::QUEUE),
            cores,
            // The kernel records each instance, and the app its joins: half a KiB per job and core.
            memory_mib: 64 + (jobs * cores).div_ceil(2048),
            on_linux,
            named: options.text(name::MODE).and_then(Mode::from_name),
        })
    }
}

/// The joining policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Policy {
    /// The scheduler of the DAG.
    Fass,
    /// Equal stamps.
    Exact,
    /// Stamps at most this many milliseconds apart.
    Approximate(u64),
}

impl Policy {
    /// Reads a list of names separated by commas.
    fn list(text: &str) -> Result<Vec<Policy>, String> {
        let policy = |name| {
            Policy::from_name(name).ok_or_else(|| {
                format!(
                    "`--policies`: {} is none; there are fass, exact, and approximate-MS with 1 \
                     to 1000000 ms",
                    quoted(name)
                )
            })
        };
        text.split(',').map(policy).collect()
    }

    fn from_name(name: &str) -> Option<Policy> {
        let number = name.strip_prefix("approximate-");
        let max_interval_ms = number.and_then(|number| number.parse().ok());
        let close = max_interval_ms.filter(|ms| (1..=1_000_000).contains(ms));
        let close = close.map(Policy::Approximate);
        let mut all = [Policy::Fass, Policy::Exact].into_iter().chain(close);
        // `+7` parses, too, and would be a second name for the same policy.
        all.find(|policy| policy.to_string() == name)
    }

    /// Returns the policy's name for people.
    fn title(self) -> String {
        match self {
            Policy::Fass => "FasS (DAG)".into(),
            Policy::Exact => "ExactTime".into(),
            Policy::Approximate(ms) => format!("ApproximateTime {ms} ms"),
        }
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Policy::Fass => f.write_str("fass"),
            Policy::Exact => f.write_str("exact"),
            Policy::Approximate(ms) => write!(f, "approximate-{ms}"),
        }
    }
}

/// The measurement of one boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct JoinCondition {
    policy: Policy,
    subtasks: usize,
    seed: u64,
}

impl JoinCondition {
    /// Returns the name of the condition's file, without the ending.
    fn file_stem(&self) -> String {
        format!("{}-n{}-seed{}", self.policy, self.subtasks, self.seed)
    }

    /// Returns the condition's words for the guest.
    fn guest_words(&self, jobs: u64, queue: u64) -> String {
        // Inputs of the parallel subtasks must hold their backlog, which grows more slowly than the
        // jobs.
        let depth = jobs.clamp(1000, 100_000);
        let of_queues = format!("queue={queue} depth={depth}");
        let policy = match self.policy {
            Policy::Approximate(ms) => format!("approximate max_interval_ms={ms} {of_queues}"),
            Policy::Exact => format!("exact {of_queues}"),
            Policy::Fass => "fass".into(),
        };
        let (subtasks, seed) = (self.subtasks, self.seed);
        format!("policy_under_test={policy} subtasks={subtasks} jobs={jobs} seed={seed}")
    }
}

impl fmt::Display for JoinCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (policy, subtasks) = (self.policy.title(), self.subtasks);
        write!(f, "{policy}, N = {subtasks}, seed {}", self.seed)
    }
}

/// The most boots of a condition in deterministic mode.
const MOST_BOOTS: usize = 6;

/// The machine for all conditions, and its versions, for the summary.
struct JoinSetup<'p> {
    plan: &'p JoinPlan,
    /// The mode of the guests; `None`: programs of this computer.
    mode: Option<Mode>,
    image: PathBuf,
    /// A checksum of the image: other code gives other times.
    checksum: String,
    /// QEMU's version, or Linux's.
    version: String,
    /// The commit, marked if the tree differs from it.
    commit: String,
}

impl<'p> JoinSetup<'p> {
    /// Builds the program, settles the mode, and returns the reason for the mode.
    ///
    /// # Errors
    ///
    /// In words: the program cannot be built, or the named mode does not work.
    fn new(plan: &'p JoinPlan) -> Result<(Self, Option<String>), String> {
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
            setting.image = image::build_linux("join-latency", None)?;
            setting.version = first_line("uname", &["-sr"]);
        } else {
            install::ensure_qemu()?;
            setting.image = image::build("join-latency")?;
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

    /// Returns the name of the meaning of time.
    fn mode_name(&self) -> &'static str {
        self.mode.map_or("linux", Mode::name)
    }

    /// Returns a sentence on how far the times can be trusted.
    fn meaning(&self) -> &'static str {
        let on_linux = "real nanoseconds on real processors, whatever else this computer does";
        self.mode.map_or(on_linux, Mode::meaning)
    }

    /// Returns a statement of all circumstances that a condition's times depend on.
    fn statement(&self, condition: &JoinCondition) -> String {
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
    fn linux_words(&self, condition: &JoinCondition) -> String {
        let words = condition.guest_words(self.plan.jobs, self.plan.queue);
        format!("cores={} share=on {words}", self.plan.cores)
    }

    /// Describes the guest of a condition.
    fn qemu(&self, condition: &JoinCondition, mode: Mode) -> Qemu {
        let words = condition.guest_words(self.plan.jobs, self.plan.queue);
        Qemu {
            mode,
            cores: self.plan.cores,
            memory_mib: self.plan.memory_mib,
            guest_words: format!("mode={mode} {words}"),
            ..Qemu::default()
        }
    }

    /// Measures a condition, and returns its times. In deterministic mode, boots until two boots
    /// agree. After [`MOST_BOOTS`] boots without agreement, says so and returns the first boot's
    /// times.
    ///
    /// Boots agree because the kernel removes the host's influence from counted time (its
    /// `machine::counted_time`). The removal depends on the implementation of QEMU 7.2, so
    /// agreement is checked wherever figures are made.
    fn measure(&self, condition: &JoinCondition) -> Result<String, String> {
        // Real times never repeat, so a second boot could not confirm them.
        let is_sure = self.mode != Some(Mode::Deterministic);
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

    fn boot_once(&self, condition: &JoinCondition) -> Result<String, String> {
        let jobs = self.plan.jobs;
        let limit = Duration::from_secs(120 + jobs);
        let run = |log: &Path| {
            if let Some(mode) = self.mode {
                let qemu = self.qemu(condition, mode);
                return outcome::boot(&qemu, &self.image, log, limit, |_| {});
            }
            let words = self.linux_words(condition);
            let words: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            let order = ProgramOrder {
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
            figures::write(&outcome.transcript, &statement, condition.subtasks, jobs)
        })
    }
}

/// Returns the first line of a program's output; `unknown` if it fails.
fn first_line(program: &str, words: &[&str]) -> String {
    let mut command = process::Command::new(program);
    let said = system::run(command.args(words).current_dir(system::workspace()));
    let said = said.unwrap_or_default();
    said.lines().next().unwrap_or("unknown").into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::right;

    fn plan(line: &str) -> Result<JoinPlan, String> {
        JoinPlan::new(&right(&TABLE, line))
    }

    #[test]
    fn every_combination_is_a_condition() {
        let plan = plan("--mode deterministic --repeat 2 --policies fass,exact").unwrap();
        assert_eq!(plan.conditions.len(), 3 * 2 * 2);
        assert_eq!((plan.cores, plan.seeds), (8, vec![1, 2]));
    }

    #[test]
    fn policies_are_read_back_and_a_wrong_one_is_named() {
        let text = "fass,exact,approximate-10";
        let names = Policy::list(text).map(|all| all.iter().map(Policy::to_string).collect());
        assert_eq!(names.map(|all: Vec<_>| all.join(",")), Ok(text.into()));
        for wrong in "fas approximate approximate-0 approximate-+7 approximate- ".split(' ') {
            let message = Policy::list(&format!("fass,{wrong}")).unwrap_err();
            assert!(message.contains(&format!("`{wrong}` is none")), "{message}");
        }
    }
}
