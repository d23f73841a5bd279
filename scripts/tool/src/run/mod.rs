//! The subcommand `run`: from a command line to a judged run of an app.
//!
//! The order matters: first everything that can be refused is checked, then
//! QEMU is made sure of, the image is built, the mode is settled by it, the guest
//! is booted, and its output is shown while it runs. Whatever is refused
//! before the build leaves nothing behind.
//!
//! Exit codes: 0 all is well, 1 a failure, 2 a refused command line (ours or
//! the guest's), 130 a run that a person has ended.

mod boot;
mod debug;
mod handed;
mod kept;
mod loading;
mod on_linux;
mod screen;
mod several;
mod table;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use replay::shown::quoted;

use crate::child::Asked;
use crate::dag_file::{self, Prepared};
use crate::files;
use crate::image;
use crate::install;
use crate::medium;
use crate::options::{BY_PERSON, Parsed, Refusal};
use crate::outcome::{Outcome, boot_with_input};
use crate::probe;
use crate::protocol::{Status, Transcript};
use crate::qemu::{Ending, Mode, Qemu};
use handed::Handed;
use kept::{Kept, Log};
use screen::Screen;

pub use boot::boot;
pub use debug::debug;
pub use table::RUN;

/// Options that exclude each other in one run that is not observed.
const APART: [(&str, &str, &str); 3] = [
    (
        "dag",
        "module",
        "exclude each other: the DAGs are the module",
    ),
    ("replay", "record", "exclude each other"),
    ("replay", "dag", "exclude each other"),
];

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn run(words: &[OsString]) -> ExitCode {
    RUN.carry_out(words, attempt)
}

fn attempt(options: &Parsed) -> Result<ExitCode, Refusal> {
    let options = &on_linux::settle(options)?;
    if let Some(folder) = several::folder(options) {
        return several::run_folder(options, &folder);
    }
    if several::is_asked_for(options) {
        return several::run(options);
    }
    if let Some(name) = options.given_of(&["margin", "seeds"]) {
        let line = format!("`--{name}` needs `--observe FILE` or `--prove`; give one, too");
        return Err(Refusal::Usage(line));
    }
    options.check_apart(&APART).map_err(Refusal::Usage)?;
    check_files(options)?;
    let dags = prepare(options)?;
    if let Some(dags) = dags.as_ref().filter(|_| options.is_given("print-dag")) {
        print!("{}", dags.file);
        return Ok(ExitCode::SUCCESS);
    }
    let booted = boot_app(options, dags.as_ref(), true)?;
    Ok(conclude(&booted, dags.as_ref(), options))
}

/// Reads the file that `--dag` names, if there is one.
fn prepare(options: &Parsed) -> Result<Option<Prepared>, Refusal> {
    dag_file::prepare(options).map_err(|lines| Refusal::Usage(lines.join("\n")))
}

/// Makes sure of all files that the options name, before any is opened.
fn check_files(options: &Parsed) -> Result<(), Refusal> {
    handed::check(options)?;
    let names = [
        "dag", "module", "replay", "image", "qemu", "wcets", "params",
    ];
    let mut inputs = options.named(&names);
    inputs.extend(handed::input(options));
    let outputs = [
        "serial", "trace", "record", "keep", "dot", "witness", "observe", "output",
    ];
    let outputs = options.named(&outputs);
    files::check(&inputs, &outputs).map_err(Refusal::Usage)?;
    kept::check(options).map_err(Refusal::Usage)
}

/// A guest that has been booted and has ended, somehow.
struct Booted {
    outcome: Outcome,
    log: Log,
    screen: Screen,
}

/// Boots what the options name, and shows its lines if it shall.
fn boot_app(options: &Parsed, dags: Option<&Prepared>, shows: bool) -> Result<Booted, Refusal> {
    let app = choose_app(options, dags.is_some())?;
    if on_linux::is_asked_for(options) {
        return on_linux::run_app(options, &app, dags, shows);
    }
    let memory_mib = loading::choose_memory(options, dags)?;
    let named = options.text("mode").and_then(Mode::from_name);
    loading::check(options, named).map_err(Refusal::Usage)?;
    let program = loading::choose_program(options)?;
    install::ensure_loader(loading::chosen(options))?;

    let handed = Handed::read(options, dags)?;
    let kept = Kept::new(options, &app)?;
    let describe = |mode| {
        let mut qemu = describe(options, &program, mode, memory_mib, dags);
        qemu.guest_words += &handed.words;
        qemu.guest_words += &kept.guest_word();
        qemu.records = kept.raw();
        qemu.module = handed.module();
        qemu
    };
    // No mode has a longer name than this one.
    let longest = describe(named.unwrap_or(Mode::Deterministic));
    longest.check_words().map_err(Refusal::Usage)?;
    if longest.loader.is_grub() {
        medium::check_words(&longest.guest_words).map_err(Refusal::Usage)?;
    }
    let log = Log::choose(options, &app)?;
    let image = match options.path("image") {
        Some(path) => path.into(),
        None => image::build(&app)?.path,
    };
    // A person needs time to type, and a firmware takes long where instructions are counted.
    let is_live = options.is_given("console") || handed::is_live(options);
    let otherwise = match is_live || longest.loader.needs_stick() {
        true => Mode::Threads,
        false => Mode::Deterministic,
    };
    let chosen = probe::choose(named, otherwise, &describe(Mode::Kvm), &image);
    let (mode, why) = chosen?;
    let qemu = describe(mode);
    let limit = limit(options, dags);
    let mut screen = Screen::new(options, &image);
    introduce(&screen, &app, &qemu, why);
    let show = |line: &str| {
        // Where a firmware paints on the serial port, it is not for this screen.
        if shows && !(qemu.loader.needs_stick() && line.contains('\x1b')) {
            let translated = dags.and_then(|dags| dags.translate(line));
            screen.show(translated.as_deref().unwrap_or(line));
        }
    };
    let talk = screen::relay(options, &log.path);
    let outcome = boot_with_input(&qemu, &image, &log.path, limit, talk, show);
    screen.end();
    kept::write(options, &kept, outcome?, log, screen)
}

/// Settles which app runs: the one that the options name, which a given image must be of,
/// or else the one that the image names.
fn choose_app(options: &Parsed, is_dag_file: bool) -> Result<String, Refusal> {
    let app = match is_dag_file {
        true => "dag-file",
        false => options.text("app").unwrap_or_default(),
    };
    if app == "dag-file" && !is_dag_file {
        let line = "app `dag-file` runs the DAGs of a file; name one by `--dag FILE`";
        return Err(Refusal::Usage(line.into()));
    }
    let Some(path) = options.path("image") else {
        image::check_app(app).map_err(Refusal::Usage)?;
        return Ok(app.into());
    };
    let place = files::place(path);
    let checked = match on_linux::is_asked_for(options) {
        true => image::check_linux_file(path),
        false => image::check_file(path),
    };
    let of_image = checked.map_err(|why| Refusal::Usage(format!("`--image {place}`: {why}")))?;
    let wanted = (is_dag_file || options.is_given("app")).then_some(app);
    match (of_image, wanted) {
        (Some(own), Some(wanted)) if own != wanted => Err(Refusal::Usage(format!(
            "`--image {place}`: the image is of app `{own}`, and {} is wanted; name an image of \
             that one, or leave `--image` out to have it built",
            quoted(wanted)
        ))),
        (Some(own), _) => Ok(own),
        (None, Some(wanted)) => Ok(wanted.into()),
        (None, None) => Ok("unknown".into()),
    }
}

fn describe(
    options: &Parsed,
    program: &Path,
    mode: Mode,
    memory_mib: u64,
    dags: Option<&Prepared>,
) -> Qemu {
    let words = words(options, dags, screen::guest_words(options)).join(" ");
    Qemu {
        program: program.into(),
        mode,
        machine: loading::machine(options),
        loader: loading::chosen(options),
        cores: options.number("cores").unwrap_or(1),
        memory_mib,
        guest_words: format!("mode={mode} {words}").trim_end().into(),
        module: None,
        records: None,
        has_input: options.is_given("console"),
        stops: screen::can_stop(options),
        second: handed::second(options),
        logs_instructions: false,
        debugger: options.is_given("gdb").then(|| "tcp::1234".into()),
    }
}

/// Returns the words that the options make for an app, with a platform's own, and last those that
/// the person adds.
fn words(options: &Parsed, dags: Option<&Prepared>, own: Vec<String>) -> Vec<String> {
    let mut words = Vec::new();
    for name in table::GUEST_WORDS {
        words.extend(options.text(name).map(|value| format!("{name}={value}")));
    }
    words.extend(dags.iter().flat_map(|dags| dags.words.iter().cloned()));
    words.extend(own);
    words.extend(several::bounds_word(options));
    let more = options.text("append").unwrap_or_default();
    words.extend(more.split_whitespace().map(String::from));
    words
}

/// The person's limit, or one that is generous also where a job takes its
/// real time: two minutes, and a second for each job. A DAG file has its own.
fn limit(options: &Parsed, dags: Option<&Prepared>) -> Duration {
    let jobs = options.number("jobs").unwrap_or(200);
    let usual = dags.map_or(120 + jobs, |dags| dags.limit_s);
    let seconds = options.number("timeout").unwrap_or(usual);
    let is_short = options.is_given("timeout");
    if options.is_given("gdb") || options.is_given("console") && !is_short {
        // A person takes all day.
        return Duration::from_secs(86_400);
    }
    Duration::from_secs(seconds)
}

/// Says what is run, and what its times are worth.
fn introduce(screen: &Screen, app: &str, qemu: &Qemu, why: Option<String>) {
    screen.say(&format!("app {app}, guest words: {}", qemu.guest_words));
    screen.say(&format!(
        "mode {}, machine {}, booted by {}, {} cores, {} MiB of memory",
        qemu.mode, qemu.machine, qemu.loader, qemu.cores, qemu.memory_mib
    ));
    screen.say(&format!("time: {}", qemu.mode.meaning()));
    if let Some(why) = why {
        screen.say(&format!("mode {} because {why}", qemu.mode));
    }
    if qemu.debugger.is_some() {
        screen.say("waiting for a debugger: `gdb IMAGE -ex 'target remote :1234'`");
    }
    screen.say("");
}

/// Says how a run has ended, and returns the exit code.
fn conclude(booted: &Booted, dags: Option<&Prepared>, options: &Parsed) -> ExitCode {
    let Booted {
        outcome,
        log,
        screen,
    } = booted;
    let by_person = outcome.asked == Some(Asked::ByPerson);
    let Err(fault) = outcome.judge() else {
        let (how, code) = match by_person {
            true => ("ended by ctrl-C, in order,", ExitCode::from(BY_PERSON)),
            false => ("well ended", ExitCode::SUCCESS),
        };
        let seconds = outcome.elapsed.as_secs_f64();
        screen.say(&format!("\n{how} after {seconds:.1} s"));
        log.discard();
        return code;
    };
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
        let draws_nothing = options.is_given("seeds") && fault.reason.starts_with("`seed`");
        let remedy = match draws_nothing {
            true => "; this app draws nothing by a seed: leave `--seeds` out",
            false => "",
        };
        log.restore();
        return RUN.refuse(&(lines + remedy));
    }
    match outcome.transcript.verdict() {
        // The screen has shown all that it said.
        Ok(_) => eprintln!("the serial log is {}", outcome.log.display()),
        Err(_) => eprint!("{}", outcome.tail()),
    }
    let remedy = match outcome.ending {
        Ending::TimedOut { .. } => format!(
            "{}; `--timeout SECONDS` gives it longer, and a subtask that never returns is ended \
             if it has a WCET or a budget",
            stalled(&outcome.transcript)
        ),
        Ending::Guest(Status::Success) if matches!(outcome.asked, Some(Asked::ByLimit(_))) => {
            "; `--timeout SECONDS` gives it longer".into()
        }
        _ => String::new(),
    };
    let code = RUN.fail(&format!("failed: {}{remedy}", fault.reason));
    if by_person {
        return ExitCode::from(BY_PERSON);
    }
    code
}

/// Goes on to the next run, unless a person has ended this one.
fn go_on(booted: &Booted) -> Result<(), Refusal> {
    match booted.outcome.asked {
        Some(Asked::ByPerson) => Err(Refusal::ByPerson),
        _ => Ok(()),
    }
}

/// Names the subtasks that the guest has found to keep their cores, if it has.
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
