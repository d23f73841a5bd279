//! Runs an app, from the command line to the judgement: the subcommand `run`.
//!
//! The order of the steps matters. First the tool checks everything it can refuse. Then it finds or
//! installs QEMU, builds the image, probes KVM with the image to choose the mode, boots the guest,
//! and shows the output while the guest runs. A command line refused before the build leaves
//! nothing behind.
//!
//! Exit codes: 0 all is well, 1 a failure, 2 a refused command line (ours or the guest's), 130 a
//! run ended by a person.

mod boot;
mod certificate;
mod debug;
mod handed;
mod kept;
mod loading;
mod many_sets;
mod on_linux;
mod page;
mod screen;
mod several;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use text::quoted;

use crate::child::StopReason;
use crate::dag_file::{self, PreparedRun};
use crate::files;
use crate::image;
use crate::install;
use crate::medium;
use crate::options::{BY_PERSON, CommandLine, OptionName, Refusal};
use crate::outcome::{Outcome, boot_with_input};
use crate::probe;
use crate::qemu::{Mode, Qemu, RunEnd};
use crate::run_options::{GUEST_WORDS, name};
use handed::GuestInput;
use kept::{KeptFiles, SerialLog};
use screen::RunDisplay;
use views::protocol::{Status, Transcript};

pub use crate::run_options::RUN;
pub use boot::boot;
pub use debug::debug;

/// Pairs of options that exclude each other in a single run without `--prove`.
const APART: [(OptionName, OptionName, &str); 4] = [
    (
        name::DAG,
        name::MODULE,
        "exclude each other: the DAGs are the module",
    ),
    (name::REPLAY, name::KEEP, "exclude each other"),
    (name::REPLAY, name::PAGE, "exclude each other"),
    (name::REPLAY, name::DAG, "exclude each other"),
];

/// Runs the subcommand with the words after its name.
pub fn run(words: &[OsString]) -> ExitCode {
    RUN.carry_out(words, attempt)
}

fn attempt(options: &CommandLine) -> Result<ExitCode, Refusal> {
    // First: the default number of cores depends on the platform.
    let options = &on_linux::settle(options)?;
    if !options.is_given(name::REPLAY) {
        let from = options.check_without(&[name::FROM], "needs `--replay FILE`; give it, too");
        from.map_err(Refusal::Usage)?;
    }
    // Before the checks below: a folder, and an observed run, have rules of their own.
    if let Some(folder) = several::folder(options) {
        if on_linux::is_on_host(options) {
            let files = several::files(&folder).map_err(Refusal::Usage)?;
            return many_sets::run(options, &files);
        }
        return several::run_folder(options, &folder);
    }
    if options.is_given(name::PROVE) {
        return several::run(options);
    }
    let why = "needs `--prove`; give it, too";
    let apart = options.check_without(&[name::MARGIN, name::SEEDS], why);
    apart
        .and_then(|()| options.check_apart(&APART))
        .map_err(Refusal::Usage)?;
    check_files(options)?;
    let dags = prepare(options)?;
    if let Some(dags) = dags.as_ref().filter(|of| of.file.sets.len() > 1)
        && on_linux::is_on_host(options)
        && !options.is_given(name::PRINT_DAG)
    {
        return many_sets::run(options, std::slice::from_ref(&dags.path));
    }
    let dags = dags.map(|dags| certified(options, dags));
    if let Some(dags) = dags.as_ref().filter(|_| options.is_given(name::PRINT_DAG)) {
        print!("{}", dags.file);
        return Ok(ExitCode::SUCCESS);
    }
    let booted = boot_app(options, dags.as_ref(), true)?;
    Ok(conclude(&booted, dags.as_ref(), options))
}

/// Reads the file named by `--dag`, if there is such a file.
fn prepare(options: &CommandLine) -> Result<Option<PreparedRun>, Refusal> {
    dag_file::prepare(options).map_err(|lines| Refusal::Usage(lines.join("\n")))
}

/// Gives certificates to the sets of a file, and reports them.
fn certified(options: &CommandLine, mut dags: PreparedRun) -> PreparedRun {
    let words = words(options, Some(&dags), on_linux::own_words(options));
    for set in &mut dags.file.sets {
        let states = certificate::give(set, &words, options, dags.length);
        // The guest reads the text, and keeps it while it checks the states.
        dags.memory_mib += set.certificate.len() as u64 >> 15;
        if let Some(states) = states.filter(|_| !options.is_given(name::QUIET)) {
            eprintln!("certificate: {states} states");
        }
    }
    dags
}

/// Checks all files named by the options, before opening any of them.
fn check_files(options: &CommandLine) -> Result<(), Refusal> {
    handed::check(options)?;
    let names = [
        name::DAG,
        name::MODULE,
        name::REPLAY,
        name::IMAGE,
        name::QEMU,
        name::WCETS,
        name::PARAMS,
    ];
    let mut inputs = options.named(&names);
    inputs.extend(handed::input(options));
    let outputs = [name::SERIAL, name::TRACE, name::KEEP, name::OUTPUT];
    let outputs = options.named(&outputs);
    files::check(&inputs, &outputs).map_err(Refusal::Usage)?;
    kept::check(options).map_err(Refusal::Usage)
}

/// A finished run, whatever its ending.
struct EndedRun {
    outcome: Outcome,
    log: SerialLog,
    screen: RunDisplay,
}

/// Boots the app named by the options; `shows` says whether its lines are shown.
fn boot_app(
    options: &CommandLine,
    dags: Option<&PreparedRun>,
    shows: bool,
) -> Result<EndedRun, Refusal> {
    let app = choose_app(options, dags.is_some())?;
    if on_linux::is_asked_for(options) {
        return on_linux::run_app(options, &app, dags, shows);
    }
    let memory_mib = loading::choose_memory(options, dags)?;
    let named = options.text(name::MODE).and_then(Mode::from_name);
    loading::check(options, named).map_err(Refusal::Usage)?;
    let program = loading::choose_program(options)?;
    // May install packages, so it comes after the checks of the loader.
    install::ensure_loader(loading::chosen(options))?;

    let handed = GuestInput::read(options, dags)?;
    let kept = KeptFiles::new(options, &app)?;
    let describe = |mode| {
        let mut qemu = describe(options, &program, mode, memory_mib, dags);
        qemu.guest_words += &handed.words;
        qemu.guest_words += &kept.guest_word();
        qemu.records = kept.raw();
        qemu.module = handed.module();
        qemu
    };
    // The mode is chosen only after the build, so the words of the longest mode name are checked.
    let longest = describe(named.unwrap_or(Mode::Deterministic));
    longest.check_words().map_err(Refusal::Usage)?;
    if longest.loader.needs_stick() {
        medium::check_words(&longest.guest_words).map_err(Refusal::Usage)?;
    }
    let log = SerialLog::choose(options, &app)?;
    let image = match options.path(name::IMAGE) {
        Some(path) => path.into(),
        None => image::build(&app)?,
    };
    // Interactive runs need real time; a firmware takes minutes where instructions are counted.
    let otherwise = match is_live(options) || longest.loader.needs_stick() {
        true => Mode::Threads,
        false => Mode::Deterministic,
    };
    let chosen = probe::choose(named, otherwise, &describe(Mode::Kvm), &image);
    let (mode, why) = chosen?;
    let qemu = describe(mode);
    let limit = limit(options, dags);
    let mut screen = RunDisplay::new(options, &image);
    introduce(&screen, &app, &qemu, why);
    kept.introduce(&screen);
    let show = |line: &str| {
        // A firmware draws its menus on the serial port with escape sequences; they are not shown.
        if shows && !(qemu.loader.needs_stick() && line.contains('\x1b')) {
            // The guest's messages about a DAG file give line numbers of the form written for the
            // guest.
            let translated = dags.and_then(|dags| dags.translate(line));
            screen.show(translated.as_deref().unwrap_or(line));
        }
    };
    let talk = screen::relay(options, &log.path);
    let outcome = boot_with_input(&qemu, &image, &log.path, limit, talk, show);
    screen.wipe();
    kept::write(options, &kept, outcome?, log, screen)
}

/// Returns the app to run: the app named by the options, which a given image must match, or else
/// the app named by the image.
fn choose_app(options: &CommandLine, is_dag_file: bool) -> Result<String, Refusal> {
    let app = match is_dag_file {
        true => "dag-file",
        false => options.text(name::APP).unwrap_or_default(),
    };
    if app == "dag-file" && !is_dag_file {
        let line = "app `dag-file` runs the DAGs of a file; name one by `--dag FILE`";
        return Err(Refusal::Usage(line.into()));
    }
    let Some(path) = options.path(name::IMAGE) else {
        image::check_app(app).map_err(Refusal::Usage)?;
        return Ok(app.into());
    };
    let place = files::shown_path(path);
    let checked = match on_linux::is_asked_for(options) {
        true => image::check_linux_file(path),
        false => image::check_file(path),
    };
    let of_image = checked.map_err(|why| Refusal::Usage(format!("`--image {place}`: {why}")))?;
    // The default app is no wish: without `--app` an image of any app will do.
    let wanted = (is_dag_file || options.is_given(name::APP)).then_some(app);
    match (of_image, wanted) {
        (Some(own), Some(wanted)) if own != wanted => Err(Refusal::Usage(format!(
            "`--image {place}`: the image is of app `{own}`, and {} is wanted; name an image of \
             that one, or leave `--image` out to have it built",
            quoted(wanted)
        ))),
        (Some(own), _) => Ok(own),
        (None, Some(wanted)) => Ok(wanted.into()),
        // An image without a note of its app can run; the name only labels its files.
        (None, None) => Ok("unknown".into()),
    }
}

fn describe(
    options: &CommandLine,
    program: &Path,
    mode: Mode,
    memory_mib: u64,
    dags: Option<&PreparedRun>,
) -> Qemu {
    let words = words(options, dags, screen::guest_words(options)).join(" ");
    // Emulated cores take much longer than their instructions suggest, and budgets do not allow for
    // that.
    let budgets = match mode {
        Mode::Threads if options.is_given(name::CONSOLE) && !words.contains("budget_factor=") => {
            " budget_factor=0"
        }
        _ => "",
    };
    Qemu {
        program: program.into(),
        mode,
        machine: loading::machine(options),
        loader: loading::chosen(options),
        cores: options.number(name::CORES).unwrap_or(1),
        memory_mib,
        guest_words: format!("mode={mode} {words}{budgets}").trim_end().into(),
        has_input: options.is_given(name::CONSOLE),
        stops: screen::can_stop(options),
        second: handed::second(options),
        devices: options.text(name::DEVICE).unwrap_or_default().into(),
        network: handed::network(options),
        debugger: options.is_given(name::GDB).then(|| "tcp::1234".into()),
        ..Qemu::default()
    }
}

/// Returns the guest's words: first the options' words, then the platform's, and last the person's
/// own.
fn words(options: &CommandLine, dags: Option<&PreparedRun>, own: Vec<String>) -> Vec<String> {
    let mut words = Vec::new();
    for name in GUEST_WORDS.iter().copied() {
        words.extend(options.text(name).map(|value| format!("{name}={value}")));
    }
    words.extend(dags.iter().flat_map(|dags| dags.words.iter().cloned()));
    words.extend(own);
    words.extend(several::bounds_word(options));
    let more = options.text(name::APPEND).unwrap_or_default();
    words.extend(more.split_whitespace().map(String::from));
    words
}

/// Returns the time limit: the person's, or two minutes and a second for each job. The default is
/// generous even where a job takes its real time. A DAG file states its own limit.
fn limit(options: &CommandLine, dags: Option<&PreparedRun>) -> Duration {
    let jobs = options.number(name::JOBS).unwrap_or(200);
    let usual = dags.map_or(120 + jobs, |dags| dags.limit_s);
    let seconds = options.number(name::TIMEOUT).unwrap_or(usual);
    let is_short = options.is_given(name::TIMEOUT);
    if options.is_given(name::GDB) || options.is_given(name::CONSOLE) && !is_short {
        // Under a debugger or a console the person sets the pace: a day.
        return Duration::from_secs(86_400);
    }
    Duration::from_secs(seconds)
}

/// Reports whether somebody sends input while the guest runs.
fn is_live(options: &CommandLine) -> bool {
    options.is_given(name::CONSOLE) || handed::is_live(options)
}

/// Prints the app, its guest, and how far the times can be trusted.
fn introduce(screen: &RunDisplay, app: &str, qemu: &Qemu, why: Option<String>) {
    screen.say(&format!("app {app}, guest words: {}", qemu.guest_words));
    screen.say(&format!(
        "mode {}, machine {}, booted by {}, {} cores, {} MiB of memory",
        qemu.mode, qemu.machine, qemu.loader, qemu.cores, qemu.memory_mib
    ));
    screen.say(&format!("time: {}", qemu.mode.meaning()));
    if let Some(why) = why {
        screen.say(&format!("mode {} because {why}", qemu.mode));
    }
    if qemu.has_input {
        screen.say("console: type `help`; the end of input or ctrl-C ends the run");
    }
    if qemu.debugger.is_some() {
        screen.say("waiting for a debugger: `gdb IMAGE -ex 'target remote :1234'`");
    }
    screen.say("");
}

/// Reports how a run has ended, and returns the exit code.
fn conclude(booted: &EndedRun, dags: Option<&PreparedRun>, options: &CommandLine) -> ExitCode {
    let EndedRun {
        outcome,
        log,
        screen,
    } = booted;
    let by_person = outcome.asked == Some(StopReason::ByPerson);
    let Err(fault) = outcome.judge() else {
        let (how, code) = match by_person {
            true => ("ended by ctrl-C, in order,", ExitCode::from(BY_PERSON)),
            false => ("well ended", ExitCode::SUCCESS),
        };
        let seconds = outcome.elapsed.as_secs_f64();
        screen.say(&format!("\n{how} after {seconds:.1} s"));
        // A good run needs no log; `discard` spares a log named by the person.
        log.discard();
        return code;
    };
    // A fault in the WCET file is reported with the file's name and line instead of the guest's
    // words.
    if several::refused(options, &fault.reason) {
        log.restore();
        return ExitCode::from(2);
    }
    if fault.status == Status::Usage {
        let of_file = dags.and_then(|dags| dags.translate(&fault.reason));
        let who = if on_linux::is_asked_for(options) {
            "app"
        } else {
            "guest"
        };
        let lines = of_file
            .unwrap_or_else(|| format!("the {who} refused its command line: {}", fault.reason));
        // Apps without draws do not know the word `seed`, which `--seeds` adds on its own.
        let draws_nothing = options.is_given(name::SEEDS) && fault.reason.starts_with("`seed`");
        let remedy = match draws_nothing {
            true => "; this app draws nothing by a seed: leave `--seeds` out",
            false => "",
        };
        // Nothing has run, so the person's earlier log must not be lost.
        log.restore();
        return RUN.report(Refusal::Usage(lines + remedy));
    }
    match outcome.transcript.verdict() {
        // The screen has already shown the guest's own reason.
        Ok(_) => eprintln!("the serial log is {}", outcome.log.display()),
        // Without a verdict the last lines are the only hint at the cause.
        Err(_) => eprint!("{}", outcome.tail()),
    }
    let remedy = match outcome.ending {
        RunEnd::TimedOut { .. } => format!(
            "{}; `--timeout SECONDS` gives it longer, and a subtask that never returns is ended \
             if it has a WCET or a budget",
            stalled(&outcome.transcript)
        ),
        RunEnd::Guest(Status::Success) if matches!(outcome.asked, Some(StopReason::ByLimit(_))) => {
            "; `--timeout SECONDS` gives it longer".into()
        }
        _ => String::new(),
    };
    let line = format!("failed: {}{remedy}", fault.reason);
    let code = RUN.report(Refusal::Failure(line));
    // Ctrl-C has the last word: the fault of an interrupted run is not the app's.
    if by_person {
        return ExitCode::from(BY_PERSON);
    }
    code
}

/// Returns an error to stop a series of runs if a person has ended this run.
fn go_on(booted: &EndedRun) -> Result<(), Refusal> {
    match booted.outcome.asked {
        Some(StopReason::ByPerson) => Err(Refusal::ByPerson),
        _ => Ok(()),
    }
}

/// Names the subtasks reported by the guest as never giving up their cores.
fn stalled(transcript: &Transcript) -> String {
    let named = transcript.of_kind("stalled").filter_map(|line| {
        let (subtask, dag) = (line.text_at("subtask_name")?, line.text_at("dag_name")?);
        let ms = line.number_at("still_ns")? / 1_000_000;
        Some(format!(
            "; subtask `{subtask}` of dag `{dag}` kept its core for more than {ms} ms of its time"
        ))
    });
    named.collect()
}
