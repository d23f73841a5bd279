//! `run --on linux`: the app as a program of this computer, built, started, shown and judged as
//! a guest is.

use std::ffi::OsString;
use std::process::Stdio;
use std::thread;

use super::{Booted, Refusal, limit, prove, seeing, table, wire, written};
use crate::dag_file::Prepared;
use crate::image;
use crate::options::Parsed;
use crate::program;

use super::handed::Handed;
use super::log::Log;
use super::screen::Screen;

/// The options that are about QEMU, its guest, or what the kernel alone does.
const FOREIGN: [&str; 11] = [
    "boot", "console", "gdb", "image", "latest", "machine", "memory", "mode", "qemu", "record",
    "replay",
];

/// Reports whether the options ask for Linux.
pub(super) fn is_asked_for(options: &Parsed) -> bool {
    options.text("on") == Some("linux")
}

/// Refuses what there is not on Linux, and settles how many cores there are.
pub(super) fn settle(options: &Parsed) -> Result<Parsed, Refusal> {
    if !is_asked_for(options) {
        return Ok(options.clone());
    }
    let foreign = FOREIGN.into_iter().find(|name| options.is_given(name));
    if let Some(name) = foreign {
        let line = format!("`--{name}` is for the bare machine; leave it or `--on linux` out");
        return Err(Refusal::Usage(line));
    }
    if options.is_given("input") && !wire::is_live(options) {
        let line = "`--input FILE` is for the bare machine, which can repeat its times; with \
            `--on linux` give `--input -`";
        return Err(Refusal::Usage(line.into()));
    }
    if options.is_given("cores") {
        return Ok(options.clone());
    }
    let usual = options.number("cores").unwrap_or(1);
    let there = thread::available_parallelism().map_or(1, |count| count.get() as u64);
    Ok(options.with("cores", usual.min(there).to_string()))
}

/// Builds the app's program, and runs it as the options say.
pub(super) fn run_app(
    options: &Parsed,
    app: &str,
    mut dags: Option<&mut Prepared>,
    shows: bool,
) -> Result<Booted, Refusal> {
    image::check_linux(app).map_err(Refusal::Usage)?;
    let handed = Handed::read(options, dags.is_none())?;
    if let Some(dags) = dags.as_deref_mut() {
        dags.write_module(handed.text()).map_err(Refusal::Failure)?;
    }
    let dags = dags.as_deref();
    let module = dags.and_then(|dags| dags.module.clone());
    let mut words = words(options, dags);
    words.extend(handed.guest_words().split_whitespace().map(OsString::from));
    if let Some(path) = module.or_else(|| handed.module()) {
        let mut word = OsString::from("module=");
        word.push(path);
        words.push(word);
    }
    let log = Log::choose(options, app).map_err(Refusal::Failure)?;
    let built = image::build_linux(app);
    let image = built.map_err(|error| Refusal::Failure(error.to_string()))?;
    let mut screen = Screen::new(options, &image.path);
    introduce(&screen, app, &words, options);
    let mut show = |line: &str| {
        if shows {
            let translated = dags.and_then(|dags| dags.translate(line));
            screen.show(translated.as_deref().unwrap_or(line));
        }
    };
    let limit = limit(options, dags);
    let stdin = match wire::is_live(options) {
        true => Stdio::inherit(),
        false => Stdio::null(),
    };
    let outcome = program::run(&image.path, &words, stdin, &log.path, limit, &mut show);
    screen.end();
    let outcome = outcome.map_err(Refusal::Failure)?;
    written::say_trace(&screen, options);
    Ok(Booted {
        outcome,
        log,
        screen,
    })
}

/// Says which program is run, and what its times are worth.
fn introduce(screen: &Screen, app: &str, words: &[OsString], options: &Parsed) {
    let words: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
    screen.say(&format!("app {app}, words: {}", words.join(" ")));
    let cores = options.number("cores").unwrap_or(1);
    screen.say(&format!("on Linux, {cores} cores of this computer"));
    screen.say("time: real nanoseconds on real cores, whatever else this computer does\n");
}

/// Returns the program's words.
fn words(options: &Parsed, dags: Option<&Prepared>) -> Vec<OsString> {
    let mut words = Vec::new();
    for name in ["cores"].iter().chain(table::GUEST_WORDS) {
        words.extend(options.text(name).map(|value| format!("{name}={value}")));
    }
    words.extend(dags.iter().flat_map(|dags| dags.words.iter().cloned()));
    words.extend(options.is_given("trace").then(|| "trace=dump".into()));
    words.extend(seeing::graph_word(options));
    words.extend(prove::guest_words(options));
    words.extend(wire::is_live(options).then(|| "input=-".into()));
    words.extend(options.text("output").map(|path| format!("output={path}")));
    let more = options.text("append").unwrap_or_default();
    words.extend(more.split_whitespace().map(String::from));
    words.into_iter().map(OsString::from).collect()
}

#[cfg(test)]
mod tests {
    use super::settle;
    use crate::run::{RUN, Refusal};

    #[test]
    fn what_is_only_on_the_machine_is_refused_in_one_line() {
        for (line, says) in [
            (
                "--on linux --machine q35",
                "`--machine` is for the bare machine; ",
            ),
            (
                "--on linux --mode threads",
                "`--mode` is for the bare machine; ",
            ),
            (
                "--on linux --console",
                "`--console` is for the bare machine; ",
            ),
            (
                "--on linux --replay x",
                "`--replay` is for the bare machine; ",
            ),
            (
                "--on linux --input x",
                "`--input FILE` is for the bare machine, ",
            ),
        ] {
            match settle(&RUN.right(line)) {
                Err(Refusal::Usage(why)) => {
                    assert!(why.starts_with(says) && !why.contains('\n'), "{why}");
                }
                _ => panic!("`{line}` is not refused"),
            }
        }
        assert!(settle(&RUN.right("--on linux --input - --trace x --cores 3")).is_ok());
        assert!(settle(&RUN.right("--machine q35")).is_ok());
    }
}
