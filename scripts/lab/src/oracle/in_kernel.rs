//! Reference schedules on the bare machine: the kernel against the oracle.
//!
//! Each case becomes a set of a DAG file, with the execution times as samples. Cases for the same
//! machine run in one boot of the app `dag-file`; their traces are compared here. For every
//! instance, start and finish must be near the reference, and the number of preemptions equal. For
//! every job, the release and the miss must be equal, and the finish near. *Near* is within a
//! tolerance, a fraction of a unit below a half: so the order of events a unit apart in the
//! reference is compared, too.
//!
//! The differences between the model and a machine, and the measures against them:
//!
//! - *The kernel takes time*: microseconds for every decision and switch, more with more cores. The
//!   delay shifts starts, and is most of the tolerance. To keep delays from adding up along chains
//!   of instances, execution times include them: a segment counts from the latest unit of time on
//!   (the app's word `grid_us`).
//! - *Simultaneous events* of the model come one after the other on a machine, in an arbitrary
//!   order. A decision between two of them is right by the rules, but not the reference's: it would
//!   start a different instance, and without preemption that instance keeps its core. The kernel
//!   therefore treats events less than a *window* apart as one instant
//!   (`Machine::set_coincidence`). Every decision then comes later by the window, which is the
//!   other part of the tolerance. With a window of 0 the kernel decides at once, as in apps; cases
//!   without simultaneous events pass that way too.
//! - *Completions come before releases* of the same instant, and a finish at the deadline is no
//!   miss. For both, execution ends a *guard* before the end of the unit of time.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use fass_dag_file::{DagFile, Set};
use sched_dag::Preemption;
use sched_dag::law::RunRecord;

use super::schedules::{Case, Deviation, TimeScale, compare, compare_turns};
use super::{Parse, equal, read};
use tool::options::{Command, CommandLine, Refusal, ValueKind, options};
use tool::outcome::{Outcome, boot};
use tool::progress::Progress;
use tool::qemu::{MOST_CORES, Machine, Mode, Qemu};
use tool::{files, image, install, probe, system, trace};
use views::protocol::MachineLine;
use views::record::Run;

static IN_KERNEL: Command = Command {
    invocation: "./scripts/oracle schedules --in-kernel",
    about: "Runs reference schedules on the bare machine in QEMU and compares.",
    positional: Some((
        ValueKind::File("FILE..."),
        "Reference schedules, as in tests/oracle.",
    )),
    options: OPTIONS,
    notes: "\
Each case runs with its number of cores, its policy, and preemption as it says.
Compared are start, finish and preemptions of every instance, and release, finish
and miss of every job. Printed are the first difference of each failing case, a
line for each number of cores, and `N passed, M failed`.

A machine takes time, and its events come one after the other, where the reference
has them at one instant. So those less than a 100th of a unit apart count as one
instant, and starts and finishes may be 2 percent of a unit from the reference;
with --work compute these are a 40th and 5 percent. In the modes threads and kvm a
unit takes its real time, and has to be far longer than the host's noise.

Exit code: 0 none failed, 1 some failed, 2 a file or the command line is refused.
",
};

options! {
    /// On the machine, not in virtual time on the host.
    IN_KERNEL: ValueKind::Nothing;
    /// Leave out the cases for more cores.
    CORES_UP_TO: ValueKind::Number(1, MOST_CORES), or "64";
    /// The length of a unit of time in microseconds.
    UNIT_US: ValueKind::Number(100, 10_000_000), or "10000";
    /// Whether execution is simulated, or cores compute all the time.
    WORK: ValueKind::OneOf(&["simulate", "compute"]), or "simulate";
    /// The meaning of time; see ./scripts/run --help.
    MODE: ValueKind::OneOf(Mode::NAMES), or "deterministic";
    /// The board that QEMU imitates.
    MACHINE: ValueKind::OneOf(Machine::NAMES), or "microvm";
}

/// Runs the command with the words after the kind; `parse` reads the files.
pub(super) fn command(words: &[OsString], parse: Parse<Case>) -> ExitCode {
    IN_KERNEL.carry_out(words, |options| run_files(options, parse))
}

fn run_files(options: &CommandLine, parse: Parse<Case>) -> Result<ExitCode, Refusal> {
    let settings = settings(options);
    let mut cases = read(options.files(), parse).map_err(Refusal::Usage)?;
    let most_cores = options.number(name::CORES_UP_TO).unwrap_or(MOST_CORES);
    let all = cases.len();
    // The number of cases left out is printed, so they do not pass unseen.
    cases.retain(|case| u64::from(case.cores) <= most_cores);
    if cases.len() < all {
        let left_out = all - cases.len();
        println!("{left_out} cases for more than {most_cores} cores are left out");
    }
    let failed = report(&run(&cases, &settings)?, &settings);
    Ok(ExitCode::from(u8::from(failed > 0)))
}

fn settings(options: &CommandLine) -> Settings {
    let usual = Settings::for_unit(options.number(name::UNIT_US).unwrap_or(10_000));
    let usual = match options.text(name::WORK) {
        Some("compute") => usual.computing(),
        _ => usual,
    };
    let mode = options.text(name::MODE).and_then(Mode::from_name);
    let machine = options.text(name::MACHINE).and_then(Machine::from_name);
    Settings {
        mode: mode.unwrap_or(usual.mode),
        machine: machine.unwrap_or(usual.machine),
        ..usual
    }
}

/// Prints the results of the cases, and returns how many failed.
fn report(judged: &[CaseResult], settings: &Settings) -> usize {
    for case in judged {
        if let Err(difference) = &case.outcome {
            println!("{}: {difference}", case.name);
        }
    }
    let passed = |cases: &[CaseResult]| cases.iter().filter(|case| case.outcome.is_ok()).count();
    for group in judged.chunk_by(|a, b| a.cores == b.cores) {
        let deviations = group.iter().filter_map(|case| case.outcome.clone().ok());
        let of_all = deviations.reduce(Deviation::and).unwrap_or_default();
        println!(
            "{} cores: {} of {} passed; starts and finishes from {:+} to {:+} us of the reference, \
             units of {} us",
            group[0].cores,
            passed(group),
            group.len(),
            of_all.earliest_ns / 1000,
            of_all.latest_ns / 1000,
            settings.unit_us,
        );
    }
    let failed = judged.len() - passed(judged);
    println!("{} passed, {failed} failed", passed(judged));
    failed
}

/// The settings for running and comparing cases.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// The meaning of time.
    pub mode: Mode,
    /// The board.
    pub machine: Machine,
    /// The length of a unit, in microseconds.
    pub unit_us: u64,
    /// The time before the end of a unit at which execution in it ends, in microseconds.
    pub guard_us: u64,
    /// The distance below which events count as one instant, in microseconds.
    pub window_us: u64,
    /// The tolerance for starts and finishes, in per cent of a unit.
    pub tolerance_percent: u64,
    /// Whether cores really compute in each unit of execution.
    pub computes: bool,
}

/// The result of a case run in the kernel.
#[derive(Clone, Debug)]
pub struct CaseResult {
    /// The case's name.
    pub name: String,
    /// The case's number of cores.
    pub cores: u32,
    /// The case's deviation, or the first difference, in one line.
    pub outcome: Result<Deviation, String>,
}

impl Settings {
    /// Returns the settings for a unit: a guard of a 1000th and a window of a 100th of a unit, a
    /// tolerance of 2 %, deterministic mode, and a microvm.
    pub fn for_unit(unit_us: u64) -> Self {
        Self {
            mode: Mode::Deterministic,
            machine: Machine::Microvm,
            unit_us,
            guard_us: unit_us / 1000,
            window_us: unit_us / 100,
            tolerance_percent: 2,
            computes: false,
        }
    }

    /// Makes cores compute. Events then wait for other work, so the guard is a 160th and the window
    /// a 40th of a unit, and the tolerance is 5 %.
    pub fn computing(self) -> Self {
        Self {
            guard_us: self.unit_us / 160,
            window_us: self.unit_us / 40,
            tolerance_percent: 5,
            computes: true,
            ..self
        }
    }

    fn scale(&self) -> TimeScale {
        TimeScale {
            unit_ns: self.unit_us.saturating_mul(1000),
            guard_ns: self.guard_us.saturating_mul(1000),
        }
    }

    fn tolerance_ns(&self) -> u64 {
        self.unit_us.saturating_mul(10 * self.tolerance_percent)
    }

    /// Returns the limit for a boot with the given cases, in wall time.
    fn limit(&self, cases: &[&Case]) -> Duration {
        const FOR_BOOT: Duration = Duration::from_secs(120);
        const FOR_CASE: Duration = Duration::from_secs(5);
        let count = u32::try_from(cases.len()).unwrap_or(u32::MAX);
        let finishes = |case: &&Case| case.instances.values().map(|times| times.finish_ns).max();
        let units = cases.iter().filter_map(finishes);
        let real = match self.mode {
            // In virtual time idle units are skipped, so only the other modes wait for them.
            Mode::Deterministic => Duration::ZERO,
            Mode::Kvm | Mode::Threads => Duration::from_micros(self.unit_us)
                .saturating_mul(u32::try_from(units.sum::<u64>()).unwrap_or(u32::MAX)),
        };
        FOR_BOOT + FOR_CASE.saturating_mul(count) + real.saturating_mul(2)
    }
}

/// The largest number of cases of one boot: the guest holds all of them in memory.
const MOST_CASES: usize = 64;

/// The guest's memory.
const MEMORY_MIB: u64 = 64;

/// Runs cases in the kernel, each boot on a single kind of machine, and compares.
///
/// # Errors
///
/// In words: there is no QEMU, no image, or a file cannot be written.
pub fn run(cases: &[Case], settings: &Settings) -> Result<Vec<CaseResult>, String> {
    install::ensure_qemu()?;
    let image = image::build("dag-file")?;
    let machine = Qemu {
        machine: settings.machine,
        cores: cases
            .iter()
            .map(|case| case.cores.into())
            .max()
            .unwrap_or(1),
        ..Qemu::default()
    };
    probe::choose(Some(settings.mode), settings.mode, &machine, &image)?;
    let mut sorted: Vec<&Case> = cases.iter().collect();
    sorted.sort_by_key(|case| machine_words(case));
    let mut waiting = &sorted[..];
    let mut judged = Vec::with_capacity(cases.len());
    let mut progress = Progress::new(cases.len() as u64, "cases");
    while let Some(first) = waiting.first() {
        let words = machine_words(first);
        let same = waiting.iter();
        let same = same.take_while(|case| machine_words(case) == words);
        let mut sets = same.map(|case| case.set_at(settings.scale())).peekable();
        let found = match sets.next_if(Result::is_err) {
            // A case that the guest refuses would end the whole boot.
            Some(refused) => vec![verdict(first, refused.map(|_| Deviation::default()))],
            None => {
                let sets: Vec<Set> = sets.take(MOST_CASES).map_while(Result::ok).collect();
                let cases = &waiting[..sets.len()];
                let outcome = boot_with(&image, &DagFile { sets }, cases, settings)?;
                judge(&outcome, cases, settings)
            }
        };
        // A boot may judge fewer cases than it was given: the rest go into the next one.
        waiting = &waiting[found.len()..];
        judged.extend(found);
        progress.show(judged.len() as u64);
    }
    progress.wipe();
    Ok(judged)
}

/// Returns a case's number of cores, and the kernel's words for the rest of the machine.
fn machine_words(case: &Case) -> (u32, String) {
    let policy = case.policy.word();
    let preemption = match case.preemption {
        Preemption::Enabled => "on",
        Preemption::Disabled => "off",
    };
    let sizes: Vec<String> = case.clusters.sizes().iter().map(u32::to_string).collect();
    let clusters = match &sizes[..] {
        [] => String::new(),
        sizes => format!(" clusters={}", sizes.join(",")),
    };
    let words = format!("policy={policy} preemption={preemption}{clusters}");
    (case.cores, words)
}

fn verdict(case: &Case, outcome: Result<Deviation, String>) -> CaseResult {
    CaseResult {
        name: case.name.clone(),
        cores: case.cores,
        outcome,
    }
}

fn boot_with(
    image: &Path,
    file: &DagFile,
    cases: &[&Case],
    settings: &Settings,
) -> Result<Outcome, String> {
    let log = system::new_log("oracle")?;
    let module = log.with_extension("dag");
    files::write(&module, file.to_string())?;
    let (mode, grid_us, window_us) = (settings.mode, settings.unit_us, settings.window_us);
    let occupy = if settings.computes { "spin" } else { "hold" };
    let (cores, words) = cases
        .first()
        .map_or((1, String::new()), |case| machine_words(case));
    let qemu = Qemu {
        mode,
        machine: settings.machine,
        cores: cores.into(),
        memory_mib: MEMORY_MIB,
        guest_words: format!(
            "mode={mode} {words} execution=sequence occupy={occupy} grid_us={grid_us} \
             window_us={window_us} events=on"
        ),
        module: Some(module.clone()),
        ..Qemu::default()
    };
    let outcome = boot(&qemu, image, &log, settings.limit(cases), |_| {});
    // Failing to remove our own file harms nothing.
    let _ = fs::remove_file(&module);
    outcome
}

/// Judges the cases that ran. If the guest did not run all, also judges the case that ended the
/// boot; the cases after that have not run.
pub(super) fn judge(outcome: &Outcome, cases: &[&Case], settings: &Settings) -> Vec<CaseResult> {
    let mut judged = Vec::with_capacity(cases.len());
    let ending = outcome.judge().err();
    let (runs, damaged) = match trace::read(&outcome.serial) {
        Ok(runs) => (runs, None),
        Err(damaged) => (Vec::new(), Some(damaged.to_string())),
    };
    let mut ran = outcome.transcript.of_kind("dag_set").zip(&runs);
    for case in cases {
        let Some((line, run)) = ran.next() else {
            let why = ending.map(|fault| fault.reason).or(damaged);
            let why = why.unwrap_or_else(|| "it printed nothing about it".into());
            let log = outcome.log.display();
            let why = format!("did not run: {why}; the serial log is {log}");
            judged.push(verdict(case, Err(why)));
            return judged;
        };
        judged.push(verdict(case, compare_run(case, line, run, settings)));
    }
    match (ending, judged.last_mut()) {
        // The guest failed after its last case; none of the others is to blame.
        (Some(fault), Some(last)) if last.outcome.is_ok() => last.outcome = Err(fault.reason),
        (None, _) => {
            let _ = fs::remove_file(&outcome.log);
        }
        _ => {}
    }
    judged
}

/// Compares a case with its trace, and with the guest's own report of the run.
fn compare_run(
    case: &Case,
    line: &MachineLine,
    run: &Run,
    settings: &Settings,
) -> Result<Deviation, String> {
    if line.text_at("set") != Some(case.name.as_str()) || run.lost > 0 {
        return Err(format!(
            "its trace is not whole, before line {}",
            line.number
        ));
    }
    let events = run.events.iter().copied();
    let record = RunRecord::of_events(&run.task_set, true, events).ok_or("too many jobs")?;
    let (unit_ns, tolerance_ns) = (settings.scale().unit_ns, settings.tolerance_ns());
    let whole = compare(case, &run.task_set, &record, unit_ns, tolerance_ns)?;
    let events = run.events.iter().copied();
    let deviation = whole.and(compare_turns(case, events, unit_ns, tolerance_ns)?);
    for what in ["violations", "allocations"] {
        equal(
            "the guest itself",
            what,
            0,
            line.number_at(what).unwrap_or(u64::MAX),
        )?;
    }
    Ok(deviation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::schedules::{Deviation, parse};
    use crate::tests::made::{self, line_of, record_of};
    use crate::tests::{altered, rows};
    use tool::qemu::RunEnd;
    use views::protocol::Status;

    const CASE: &str = "case small 1 0 1 1
dag 4 9 0 1 1 0
sub 1 0 1
x 0 0 0 0 1 0
j 0 0 0 1 1 0
end
";

    /// A run of the case with units of 1 ms, starting 10 us late and finishing 10 us early: the
    /// commit, the events, and the output.
    const LOG: &str = r#"static 1
0 T=4000000 D=9000000 O=0: a/0
;
0 released c0 0.0
0 ready c0 0.0.0
10000 start c0 0.0.0
990000 finish c0 0.0.0
990000 completed c0 0.0
;
{"kind":"dag_set","set":"small","dags":1,"violations":0,"allocations":0}
{"kind":"verdict","status":"success","reason":""}
"#;

    /// A part of the log, its replacement, and the resulting difference.
    const ALTERED: &str = r#"10000 | 20001 | dag 0 job 0 subtask 0: start: expected 0, found 0.020
990000 finish | 979999 finish | dag 0 job 0 subtask 0: finish: expected 1, found 0.979
990000 finish | 500000 suspend c0 0.0.0\n600000 request c0 0.0.0\n600000 resume c0 0.0.0\n990000 finish | dag 0 job 0 subtask 0: preemptions: expected 0, found 1
O=0 | O=1 | dag 0 job 0: release: expected 0, found 1
990000 completed | 1020001 completed | dag 0 job 0: response: expected 1, found 1.020
990000 completed | 990000 missed c0 0.0\n990000 completed | dag 0 job 0: missed: expected 0, found 1
0 released c0 | lost 2\n0 released c0 | its trace is not whole, before line 2
"small" | "smart" | its trace is not whole, before line 2
"allocations":0 | "allocations":1 | the guest itself: allocations: expected 0, found 1
"violations":0 | "violations":1 | the guest itself: violations: expected 0, found 1
990000 completed c0 0.0 |  | dag 0 job 0: response: there was none
"success" | "failure" | the verdict line says Failure, QEMU's exit status Success"#;

    #[test]
    fn what_is_near_passes_and_the_first_difference_is_named() {
        let case = parse(CASE).expect("well formed").remove(0);
        let judged_of = |log: String| {
            let status = RunEnd::Guest(Status::Success);
            let outcome = Outcome::of(status, log, "no.log".as_ref(), "no image".as_ref());
            let judged = judge(&outcome, &[&case], &Settings::for_unit(1000));
            judged.into_iter().next().expect("a case").outcome
        };
        let judged = |text: &str| {
            let [commit, events, lines] = parts(text);
            judged_of(line_of(&record_of("", &made::commit(commit), events)) + lines)
        };
        let deviation = Deviation {
            earliest_ns: -10_000,
            latest_ns: 10_000,
        };
        assert_eq!(judged(LOG), Ok(deviation));
        for [from, to, difference] in rows(ALTERED) {
            let altered = altered(LOG, [&from, &to]);
            assert_eq!(judged(&altered), Err(difference), "{to}");
        }
        let [commit, events, lines] = parts(LOG);
        let whole = record_of("", &made::commit(commit), events);
        let said = judged_of(line_of(&whole[..whole.len() / 2]) + lines).expect_err("it is cut");
        assert!(said.starts_with("did not run: "), "{said}");
        let said = judged_of(line_of(&whole)).expect_err("it ends early");
        assert!(said.starts_with("did not run: "), "{said}");
    }

    fn parts(text: &str) -> [&str; 3] {
        let parts: Vec<&str> = text.split("\n;\n").collect();
        parts.try_into().expect("three parts")
    }
}
