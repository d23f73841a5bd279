//! The host command with which an app replays its recordings.

use std::error::Error;
use std::ffi::OsString;
use std::process::ExitCode;
use std::{env, fs, panic};

use fass::Policy;
use fass::edge::job_of;
use sched_dag::{Instance, OnFault};

use crate::VirtualTime;
use crate::report::{PanicRecord, Report};

const USAGE: &str = "\
Replays a recording of this app in virtual time, and compares what it computes.

usage: FILE [--from DAG/JOB] [--until DAG/JOB] [--cores N] [--policy WORD]

--from begins with that job, or with the last one before it of which all states of the DAG are
recorded. --until shows what the subtasks of a job got and gave, as far as it is recorded. Without it the
first job is shown in which a function panics, if one does.

exit codes: 0 nothing differs; 1 something does, a function panics in a job that the recorded run has
not survived, or there is no such job; 2 a refused command line or file";

/// The parsed command line.
struct Words {
    file: OsString,
    from: Option<(String, u64)>,
    until: Option<(String, u64)>,
    cores: u32,
    policy: Policy,
}

/// Replays the recording named on the command line, in the `main` of an app's example.
/// `--until DAG/JOB` stops at a job and shows its subtasks' inputs and outputs, `--from DAG/JOB`
/// begins late, and `--help` explains the rest. `commit` gets the file's bytes, builds the app's
/// DAGs and commits them.
///
/// ```no_run
/// use std::process::ExitCode;
/// use fass::{create_dag, finish_create_dags};
///
/// fn main() -> ExitCode {
///     virtual_time::replay_command(|_file| {
///         let dag = create_dag(); // and all that belongs to it
///         finish_create_dags(&[dag])?;
///         Ok(())
///     })
/// }
/// ```
pub fn replay_command(
    commit: impl FnOnce(&'static [u8]) -> Result<(), Box<dyn Error>>,
) -> ExitCode {
    let words: Vec<OsString> = env::args_os().skip(1).collect();
    if words.iter().any(|word| word == "--help" || word == "-h") {
        println!("{}", USAGE.replace("WORD", &Policy::WORDS.join("|")));
        return ExitCode::SUCCESS;
    }
    let result = read(words).and_then(|words| replay(&words, commit));
    result.unwrap_or_else(|line| {
        eprintln!("replay: {line}");
        ExitCode::from(2)
    })
}

fn read(words: Vec<OsString>) -> Result<Words, String> {
    let mut read = Words {
        file: OsString::new(),
        from: None,
        until: None,
        cores: 1,
        policy: Policy::Edf,
    };
    let mut words = words.into_iter();
    while let Some(word) = words.next() {
        let text = word.to_string_lossy();
        if !text.starts_with("--") {
            read.file = word;
            continue;
        }
        let value = words.next().unwrap_or_default();
        let value = value.to_string_lossy();
        let refused = |wanted: &str| format!("`{text} {value}`: {wanted} is wanted");
        match &*text {
            "--from" | "--until" => {
                let (dag, job) = job_of(&value).ok_or_else(|| refused("DAG/JOB"))?;
                let named = Some((dag.into(), job));
                match &*text {
                    "--from" => read.from = named,
                    _ => read.until = named,
                }
            }
            "--cores" => {
                let cores = value.parse().ok().filter(|cores| (1..=64).contains(cores));
                read.cores = cores.ok_or_else(|| refused("a number from 1 to 64"))?;
            }
            "--policy" => {
                let words = || refused(&format!("one of {}", Policy::WORDS.join(", ")));
                read.policy = Policy::of_word(&value).ok_or_else(words)?;
            }
            _ => return Err(format!("there is no option `{text}`; see --help")),
        }
    }
    match read.file.is_empty() {
        true => Err("which file? name a recording; see --help".into()),
        false => Ok(read),
    }
}

fn replay(
    words: &Words,
    commit: impl FnOnce(&'static [u8]) -> Result<(), Box<dyn Error>>,
) -> Result<ExitCode, String> {
    let place = words.file.to_string_lossy();
    let bytes = fs::read(&words.file).map_err(|error| format!("{place}: {error}"))?;
    // An app keeps its input for its whole run, as on its machine.
    let bytes = recording::completed(bytes).map_err(|malformed| format!("{place}: {malformed}"))?;
    let bytes: &'static [u8] = bytes.into_owned().leak();
    let machine = VirtualTime::new().cores(words.cores).policy(words.policy);
    if cfg!(panic = "abort") {
        name_remedy();
    }
    // Users mostly look for the panic itself: once contained, its job can be shown.
    let machine = machine.contain_panics().replay(bytes);
    let machine = machine.map_err(|malformed| format!("{place}: {malformed}"))?;
    let machine = match &words.from {
        Some((dag, job)) => machine.from(dag, *job),
        None => machine,
    };
    commit(bytes).map_err(|error| error.to_string())?;
    if let Some((dag, job)) = &words.until {
        let shown = machine.until(dag, *job);
        let shown = shown.map_err(|error| error.to_string())?;
        println!("{shown}");
        let is_right = shown.times.is_some() && shown.unmet_fault.is_none();
        return Ok(ExitCode::from(u8::from(!is_right)));
    }
    let report = machine.try_run().map_err(|error| error.to_string())?;
    let survived = |panic: &&PanicRecord| {
        let Instance { dag, job, .. } = panic.instance;
        let survives = report.task_set().dag(dag).on_fault() != OnFault::EndDag;
        survives && machine.has_failed(dag, job)
    };
    let again = report.panics.iter().filter(survived).count();
    println!("{}", summary(&report, again));
    let Some(panic) = report.panics.iter().find(|panic| !survived(panic)) else {
        return Ok(ExitCode::from(u8::from(report.divergence.is_some())));
    };
    let (dag, job) = (panic.instance.dag, panic.instance.job);
    println!("{}", machine.show(&report, dag, job));
    Ok(ExitCode::FAILURE)
}

/// After a panic that ends the command, explains how to build the command for showing the job
/// instead.
fn name_remedy() {
    let show = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        show(info);
        eprintln!(
            "replay: this build ends at a panic; by `cargo run --profile linux`, that is a profile \
             with `panic = \"unwind\"`, the job is shown instead"
        );
    }));
}

fn summary(report: &Report, again: usize) -> String {
    let compared = report.compared;
    let differs = match &report.divergence {
        Some(divergence) => divergence.to_string(),
        None if report.uncompared == 0 => "nothing differs".into(),
        None => "nothing differs of the others".into(),
    };
    let uncompared = match report.uncompared {
        0 => String::new(),
        count => format!(", {count} are not"),
    };
    let again_too = match again {
        0 => String::new(),
        count => format!("\n{count} faults that the recorded run has survived came again"),
    };
    let panics = match report.panics.len() - again {
        0 => String::new(),
        count => format!("\n{count} panics, first of all in this job:"),
    };
    let lacking = (report.lacking.as_ref()).map_or(String::new(), |(dag, first)| {
        format!("\nwhat functions of dag `{dag}` remember of jobs before {first} is not recorded")
    });
    format!("{compared} values are compared{uncompared}: {differs}{lacking}{again_too}{panics}")
}
