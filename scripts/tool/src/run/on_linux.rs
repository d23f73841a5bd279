//! Runs an app as a program of this computer, built, started, shown and judged like a guest:
//! `run --on linux`. With `--on debian` the program runs on Debian's Linux in QEMU. With
//! `--on host` the app for DAG files runs in virtual time.

use std::ffi::OsString;
use std::path::Path;
use std::thread;
use std::time::Duration;

use super::handed::{self, GuestInput};
use super::kept::{self, KeptFiles, SerialLog};
use super::screen::RunDisplay;
use super::{EndedRun, limit};

use crate::dag_file::PreparedRun;
use crate::debian::{Guest, GuestOrder};
use crate::image;
use crate::options::{CommandLine, OptionName, Refusal};
use crate::program;
use crate::qemu::{self, Mode, RunEnd};
use crate::run_options::name;

/// Options that concern only QEMU, its guest, or the bare-metal kernel.
const FOREIGN: [OptionName; 10] = [
    name::BOOT,
    name::DEVICE,
    name::NET,
    name::CARD,
    name::PCAP,
    name::GDB,
    name::LATEST,
    name::MACHINE,
    name::MEMORY,
    name::QEMU,
];

/// Options that `--on debian` cannot pass on to its guest, and options only for that guest.
const NOT_IN_GUEST: [OptionName; 6] = [
    name::CONSOLE,
    name::INPUT,
    name::KEEP,
    name::OUTPUT,
    name::PAGE,
    name::REPLAY,
];
const ONLY_IN_GUEST: [OptionName; 2] = [name::MODE, name::BUSY];

/// Options that are of no use in virtual time, besides those of the bare machine.
const NOT_ON_HOST: [OptionName; 11] = [
    name::BUSY,
    name::CONSOLE,
    name::IMAGE,
    name::INPUT,
    name::MECHANISM,
    name::MODE,
    name::OCCUPY,
    name::OUTPUT,
    name::PAGE,
    name::PROVE,
    name::REPLAY,
];

/// The additional time for a guest, as Linux must start first.
const START: Duration = Duration::from_secs(120);

/// Reports whether the options ask for Linux, or at least for a program of this computer.
pub(super) fn is_asked_for(options: &CommandLine) -> bool {
    options.text(name::ON) != Some("machine")
}

/// Reports whether the options ask for virtual time.
pub(super) fn is_on_host(options: &CommandLine) -> bool {
    options.text(name::ON) == Some("host")
}

/// Reports whether Linux runs as a guest in QEMU.
fn is_in_guest(options: &CommandLine) -> bool {
    options.text(name::ON) == Some("debian")
}

/// Refuses options unavailable on Linux, and settles the number of cores.
pub(super) fn settle(options: &CommandLine) -> Result<CommandLine, Refusal> {
    if !is_asked_for(options) {
        // The reverse case: options of Linux on the bare machine.
        let why = "is for Linux; leave it out, or give `--on linux` or `--on debian`";
        let on_machine = options.check_without(&[name::MECHANISM, name::BUSY], why);
        return on_machine.map(|()| options.clone()).map_err(Refusal::Usage);
    }
    let on = options.text(name::ON).unwrap_or_default();
    let why = format!("is for the bare machine; leave it or `--on {on}` out");
    let on_linux = options.check_without(&FOREIGN, &why);
    on_linux.map_err(Refusal::Usage)?;
    if is_on_host(options) {
        return settle_host(options).map_err(Refusal::Usage);
    }
    let (others, place) = match is_in_guest(options) {
        true => (&NOT_IN_GUEST[..], "linux"),
        false => (&ONLY_IN_GUEST[..], "debian"),
    };
    let why = format!("is not for `--on {on}`; leave it out, or give `--on {place}`");
    options
        .check_without(others, &why)
        .map_err(Refusal::Usage)?;
    // Bytes with times make sense only where the times repeat.
    if options.is_given(name::INPUT) && !handed::is_live(options) {
        let line = "`--input FILE` is for the bare machine, which can repeat its times; with \
            `--on linux` give `--input -`";
        return Err(Refusal::Usage(line.into()));
    }
    // An explicit number of cores is kept, even if this computer has fewer.
    if options.is_given(name::CORES) {
        return Ok(options.clone());
    }
    if is_in_guest(options) {
        return Ok(options.with(name::CORES, GUEST_CORES));
    }
    let usual = options.number(name::CORES).unwrap_or(1);
    let there = thread::available_parallelism().map_or(1, |count| count.get() as u64);
    // More workers than processors would share them, and the times would say little.
    Ok(options.with(name::CORES, usual.min(there).to_string()))
}

fn settle_host(options: &CommandLine) -> Result<CommandLine, String> {
    options.check_without(
        &NOT_ON_HOST,
        "is not for virtual time; leave it or `--on host` out",
    )?;
    if !options.is_given(name::DAG) {
        return Err("`--on host` runs DAGs of a file; name one by `--dag FILE`".into());
    }
    // As on the machine, however many cores this computer has.
    let cores = options.number(name::CORES).unwrap_or(1);
    Ok(options.with(name::CORES, cores.to_string()))
}

/// The number of a guest's processors without `--cores`.
const GUEST_CORES: &str = "4";

/// Builds the app's program and runs it as the options say.
#[allow(clippy::too_many_lines, reason = "the steps of a run, in order")]
pub(super) fn run_app(
    options: &CommandLine,
    app: &str,
    dags: Option<&PreparedRun>,
    shows: bool,
) -> Result<EndedRun, Refusal> {
    let given = options.path(name::IMAGE);
    if given.is_none() {
        image::check_linux(app).map_err(Refusal::Usage)?;
    }
    let handed = GuestInput::read(options, dags)?;
    let mut words: Vec<OsString> = super::words(options, dags, own_words(options))
        .iter()
        .map(OsString::from)
        .collect();
    words.extend(qemu::words(&handed.words));
    let kept = KeptFiles::new(options, app)?;
    let replayed = options.path(name::REPLAY).map(Path::to_path_buf);
    // As bytes: the name of a file need not be UTF-8.
    for (name, path) in [("module=", handed.module()), ("replay=", replayed)] {
        if let Some(path) = path {
            let mut word = OsString::from(name);
            word.push(path);
            words.push(word);
        }
    }
    if is_in_guest(options) {
        // The file must lie in the guest; only its events come back, through the log.
        words.extend(kept::word(options).map(|word| format!("{word}=on").into()));
    } else if let Some((word, path)) = kept.word_with_file() {
        let mut word = OsString::from(format!("{word}="));
        word.push(path);
        words.push(word);
    }
    let log = SerialLog::choose(options, app)?;
    let image = match given {
        Some(path) => path.into(),
        None if is_on_host(options) => image::build_host()?,
        None => image::build_linux(app, None)?,
    };
    let mut screen = RunDisplay::new(options, &image);
    let mode = options.text(name::MODE).and_then(Mode::from_name);
    let mode = mode.unwrap_or(Mode::Deterministic);
    let guest = is_in_guest(options).then(|| {
        let order = GuestOrder {
            program: &image,
            words: &words,
            with_policy: options.text(name::MECHANISM) == Some("sched_ext"),
            busy: options.number(name::BUSY).unwrap_or(0),
            mode,
            cores: options.number(name::CORES).unwrap_or(1),
        };
        Guest::new(&order, &log.path).map_err(Refusal::Failure)
    });
    let guest = guest.transpose()?;
    introduce(
        &screen,
        app,
        &words,
        options,
        guest.is_some().then_some(mode),
    );
    if guest.is_none() && !is_on_host(options) {
        kept.introduce(&screen);
    }
    let mut show = |line: &str| {
        if shows {
            let translated = dags.and_then(|dags| dags.translate(line));
            screen.show(translated.as_deref().unwrap_or(line));
        }
    };
    let limit = limit(options, dags);
    let order = program::ProgramOrder {
        program: &image,
        words: &words,
        is_live: handed::is_live(options) || options.is_given(name::CONSOLE),
        // In virtual time no program listens, and none has to end in order.
        stops: !is_on_host(options),
        log: &log.path,
        limit,
    };
    let outcome = match &guest {
        None => program::run(&order, &mut show),
        // The program to run is QEMU, without a terminal and with extra time for the start of
        // Linux.
        Some(guest) => {
            let order = program::ProgramOrder {
                program: &guest.program,
                words: &guest.words,
                is_live: false,
                stops: false,
                limit: limit + START,
                ..order
            };
            program::run_for(&order, &mut show, |_| guest.code())
        }
    };
    screen.wipe();
    let mut outcome = outcome?;
    // If Linux itself failed, the app's log is empty; the guest's console tells why.
    if let (Some(guest), RunEnd::Program(why)) = (&guest, &mut outcome.ending) {
        *why = format!("{why}; the guest's last words:\n{}", guest.said());
    }
    kept::write(options, &kept, outcome, log, screen)
}

/// Prints the program, its words, and how far its times can be trusted.
fn introduce(
    screen: &RunDisplay,
    app: &str,
    words: &[OsString],
    options: &CommandLine,
    guest: Option<Mode>,
) {
    let words: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
    screen.say(&format!("app {app}, words: {}", words.join(" ")));
    let cores = options.number(name::CORES).unwrap_or(1);
    if let Some(mode) = guest {
        screen.say(&format!(
            "on Debian's Linux in QEMU, mode {mode}, {cores} cores"
        ));
        screen.say(&format!("time: {}\n", meaning(mode)));
        return;
    }
    if is_on_host(options) {
        screen.say(&format!(
            "in virtual time, {cores} cores; bounds have the overheads, responses have none\n"
        ));
        return;
    }
    screen.say(&format!("on Linux, {cores} cores of this computer"));
    screen.say("time: real nanoseconds on real cores, whatever else this computer does\n");
}

/// Says how far the times of a guest can be trusted.
fn meaning(mode: Mode) -> &'static str {
    match mode {
        Mode::Deterministic => {
            "two instructions are one virtual nanosecond, idle time is skipped, busy processors \
             take turns"
        }
        other => other.meaning(),
    }
}

/// Returns the words that only a program for Linux or for virtual time gets.
pub(super) fn own_words(options: &CommandLine) -> Vec<String> {
    let mut words = Vec::new();
    for name in [name::CORES, name::MECHANISM, name::OUTPUT] {
        words.extend(options.text(name).map(|value| format!("{name}={value}")));
    }
    words.extend(options.is_given(name::CONSOLE).then(|| "console=on".into()));
    words.extend(handed::is_live(options).then(|| "input=-".into()));
    words.extend(is_on_host(options).then(|| "tests=on".into()));
    words
}

#[cfg(test)]
mod tests {
    use super::settle;
    use crate::run::RUN;
    use crate::tests::right;

    /// `tests/it/lines.rs` has what is refused.
    #[test]
    fn standard_input_is_for_linux_too() {
        assert!(settle(&right(&RUN, "--on linux --input - --trace x --cores 3")).is_ok());
    }
}
