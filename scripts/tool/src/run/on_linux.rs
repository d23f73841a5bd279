//! `run --on linux`: the app as a program of this computer, built, started, shown and judged as
//! a guest is.
//!
//! Its standard output is the log. Its exit code is one of two witnesses, as QEMU's status is.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::Path;
use std::process::{ExitStatus, Stdio};
use std::thread;
use std::time::Duration;

use super::{Booted, Refusal, limit, prove, seeing, table, wire, written};
use crate::child::{Child, Waited, bound_to_us};
use crate::dag_file::Prepared;
use crate::image;
use crate::options::Parsed;
use crate::outcome::Outcome;
use crate::protocol::{Status, Transcript};
use crate::qemu::Ending;
use crate::system;
use crate::tail::Tail;

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
    let outcome = run_program(&image.path, &words, &log.path, limit, options, &mut show);
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

/// Runs a program until its end, or for `limit`, with its output in `log`.
fn run_program(
    program: &Path,
    words: &[OsString],
    log: &Path,
    limit: Duration,
    options: &Parsed,
    show: &mut impl FnMut(&str),
) -> Result<Outcome, String> {
    let place = log.display();
    let file = File::create(log)
        .map_err(|error| format!("cannot write `{place}`: {error}; name a file elsewhere"))?;
    let mut command = bound_to_us(program);
    command.args(words).stdout(file);
    if !wire::is_live(options) {
        command.stdin(Stdio::null());
    }
    let mut child = Child::start(&mut command)
        .map_err(|error| format!("cannot start `{}`: {error}", program.display()))?;
    let mut tail = Tail::new(log);
    let waited = child.wait(limit, || {
        tail.follow(show);
        true
    });
    tail.finish(show);
    let bytes = fs::read(log).map_err(|error| format!("cannot read `{place}`: {error}"))?;
    let serial = String::from_utf8_lossy(&bytes).into_owned();
    let transcript = Transcript::read(&serial);
    let ending = match waited {
        Waited::Ended(status) => ending_of(status, &transcript),
        Waited::TimedOut | Waited::GivenUp => Ending::Program(format!(
            "no end within {} s, the program was killed; {}; `--timeout SECONDS` gives it longer",
            limit.as_secs(),
            system::host_load()
        )),
    };
    Ok(Outcome {
        ending,
        transcript,
        serial,
        log: log.to_path_buf(),
        image: program.to_path_buf(),
        elapsed: child.elapsed(),
        complaints: String::new(),
    })
}

fn ending_of(status: ExitStatus, transcript: &Transcript) -> Ending {
    let has_verdict = transcript.of_kind("verdict").next().is_some();
    match status.code().filter(|_| has_verdict) {
        Some(0) => Ending::Guest(Status::Success),
        Some(1) => Ending::Guest(Status::Failure),
        Some(2) => Ending::Guest(Status::Usage),
        _ => Ending::Program(format!(
            "the program gave no verdict and ended with {status}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt as _;
    use std::process::ExitStatus;

    use super::{ending_of, settle};
    use crate::protocol::{Status, Transcript};
    use crate::qemu::Ending;
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

    #[test]
    fn without_a_verdict_no_exit_code_counts() {
        let verdict = "{\"kind\":\"verdict\",\"status\":\"success\"}\n";
        let of = |wait_status, text| {
            ending_of(ExitStatus::from_raw(wait_status), &Transcript::read(text))
        };
        assert_eq!(of(0, verdict), Ending::Guest(Status::Success));
        assert_eq!(of(2 << 8, verdict), Ending::Guest(Status::Usage));
        for wait_status in [0, 9, 101 << 8] {
            assert!(matches!(of(wait_status, ""), Ending::Program(_)));
        }
        assert!(matches!(of(9, verdict), Ending::Program(_)));
    }
}
