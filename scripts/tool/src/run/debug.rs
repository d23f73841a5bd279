//! Runs an app in QEMU under gdb: the subcommand `debug`.
//!
//! The image is built by the profile `gdb`, which optimizes nothing and keeps everything that gdb
//! needs to show variables. QEMU waits before the first instruction. A script connects gdb to QEMU
//! and sets the breakpoints; then gdb replaces this process. So the terminal belongs to gdb alone:
//! QEMU, which ends together with gdb, never gets a ctrl-C meant for gdb. The guest's lines for
//! people appear between gdb's lines. Budgets are off, since code without optimization takes many
//! times its WCET.
//!
//! A *place* is a breakpoint: a function, named by the last parts of its path, or `FILE:LINE`.
//! Because gdb takes only whole paths, such as `drone::camera::detect`, the tool asks gdb for the
//! functions of the image. A place missing from the image is refused before anything starts.

use std::ffi::OsString;
use std::fmt::Write;
use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{self, ExitCode, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use text::quoted;

use super::handed::GuestInput;
use super::loading;
use super::{RUN, check_files, choose_app};
use crate::child;
use crate::files;
use crate::image;
use crate::install;
use crate::options::{Command, CommandLine, Opt, OptionName, Refusal, did_you_mean};
use crate::qemu::{Mode, Qemu};
use crate::run_options::name;
use crate::system;

/// The longest time from QEMU's start until gdb can reach QEMU.
const START: Duration = Duration::from_secs(30);

/// The options and the help text of `debug`. Options shared with `run` have the same meaning there.
static DEBUG: LazyLock<Command> = LazyLock::new(|| Command {
    invocation: "./scripts/debug",
    about: "Boots an app in QEMU with gdb at it, in an image that gdb shows whole.",
    positional: None,
    options: Vec::leak(vec![
        of_run(name::APP, None),
        own::OPTIONS[0],
        own::OPTIONS[1],
        of_run(name::CORES, Some("1")),
        of_run(name::JOBS, None),
        of_run(name::SEED, None),
        of_run(name::MEMORY, None),
        of_run(name::MODE, Some("deterministic")),
        of_run(name::APPEND, None),
        of_run(name::MODULE, None),
        of_run(name::INPUT, None),
        of_run(name::REPLAY, None),
        of_run(name::FROM, None),
        of_run(name::IMAGE, None),
        of_run(name::QEMU, None),
    ]),
    notes: "\
gdb is installed if it is missing. Budgets are off. In mode deterministic time stands still
while the guest is stopped, and each run stops where the last one did; docs/watching.md has a
worked example.

exit codes: gdb's; 1 a failure; 2 a refused command line
",
});

/// The options that `run` does not have.
mod own {
    use crate::options::{ValueKind, options};

    options! {
        /// Where to stop, with commas between: a function, by the end of its path
        /// (control, attitude::control), or FILE:LINE (src/dags.rs:153).
        BREAK: ValueKind::Text("PLACES"), or "kernel_main";
        /// Have gdb do what this file says once it has stopped, and end; no person is asked.
        COMMANDS: ValueKind::File("FILE");
    }
}

/// Returns an option of `run`, optionally with another default.
fn of_run(name: OptionName, default: Option<&'static str>) -> Opt {
    let option = RUN.options.iter().find(|option| option.name == name);
    let option = option.expect("`run` has each of them");
    Opt {
        group: "",
        default: default.unwrap_or(option.default),
        ..*option
    }
}

/// Runs the subcommand with the words after its name.
pub fn debug(words: &[OsString]) -> ExitCode {
    DEBUG.carry_out(words, attempt)
}

/// Starts gdb in place of this process; returns only if a step fails.
fn attempt(own: &CommandLine) -> Result<ExitCode, Refusal> {
    let run = as_run(own)?;
    check_files(&run)?;
    let commands = own.path(own::name::COMMANDS);
    if let Some(path) = commands {
        let place = files::shown_path(path);
        // Read now to see whether it can be read; gdb itself would complain only after the boot.
        files::read(path)
            .map_err(|why| Refusal::Usage(format!("`--commands {place}` {why}; name another")))?;
    }
    let app = choose_app(&run, false)?;
    let memory_mib = loading::choose_memory(&run, None)?;
    let program = loading::choose_program(&run)?;
    install::ensure(&install::GDB)?;
    let handed = GuestInput::read(&run, None)?;
    let mode = run.text(name::MODE).and_then(Mode::from_name);
    let mode = mode.unwrap_or(Mode::Deterministic);
    let mut qemu = super::describe(&run, &program, mode, memory_mib, None);
    qemu.stops = false; // ctrl-C is gdb's
    qemu.guest_words += &format!(" budget_factor=0{}", handed.words);
    qemu.module = handed.module();
    qemu.check_words().map_err(Refusal::Usage)?;

    let image = match run.path(name::IMAGE) {
        Some(path) => path.into(),
        None => {
            eprintln!("building `{app}` by the profile `gdb`");
            image::build_target(&app, "gdb", ["--bin", &app], None)?
        }
    };
    let places = own.text(own::name::BREAK).unwrap_or_default();
    let places = resolve(&image, &app, places).map_err(Refusal::Usage)?;
    let log = system::new_log(&format!("{app}-gdb"))?;
    let socket = log.with_extension("socket");
    let script = log.with_extension("gdb");
    let text = script_text(&socket, &places);
    files::write(&script, text)?;
    // The guest waits for gdb, so nothing is lost between these two calls.
    start(qemu, &image, &log, &socket)?;
    let error = gdb(&image, &script, commands).exec();
    Err(Refusal::Failure(format!("cannot start gdb: {error}")))
}

/// Returns a command line for `run` with the options shared by both commands: the given options,
/// and options with other defaults here.
fn as_run(own: &CommandLine) -> Result<CommandLine, Refusal> {
    let shared = DEBUG.options.iter().map(|option| option.name);
    let shared = shared.filter(|name| RUN.options.iter().any(|option| option.name == *name));
    let shared =
        shared.filter(|name| own.is_given(*name) || [name::CORES, name::MODE].contains(name));
    let words = shared.filter_map(|name| {
        let mut word = OsString::from(format!("--{name}="));
        word.push(own.path(name)?);
        Some(word)
    });
    RUN.parse(&words.collect::<Vec<_>>())
}

/// Starts QEMU, waiting for gdb at the socket, and a filter that shows only the guest's lines for
/// people.
fn start(mut qemu: Qemu, image: &Path, log: &Path, socket: &Path) -> Result<(), String> {
    let mut device = OsString::from("unix:");
    device.push(socket);
    device.push(",server=on,wait=off");
    qemu.debugger = Some(device);
    // A separate process: this process becomes gdb and can no longer filter.
    let shown = process::Command::new("grep")
        .args(["--line-buffered", "-v", "^{"])
        .stdin(Stdio::piped())
        .process_group(0)
        .spawn();
    let mut shown = shown.map_err(|error| format!("cannot start grep: {error}"))?;
    let pipe = shown.stdin.take().map_or(Stdio::null(), Stdio::from);

    let complaints = log.with_extension("log.qemu");
    let errors = File::create(&complaints)
        .map_err(|error| format!("cannot write `{}`: {error}", complaints.display()))?;
    let program = system::find_program(&qemu.program).unwrap_or_else(|| qemu.program.clone());
    let mut command = child::bound_to_us(&program);
    command
        .args(qemu.arguments(image, Path::new("/dev/stdout")))
        .stdin(Stdio::null())
        .stdout(pipe)
        .stderr(errors)
        // Ctrl-C is gdb's.
        .process_group(0);
    let running = command.spawn();
    let mut running = running.map_err(|error| format!("cannot start QEMU: {error}"))?;
    let begun = Instant::now();
    // Without the socket gdb would fail at once, so we wait for it.
    while !socket.exists() {
        if !matches!(running.try_wait(), Ok(None)) || begun.elapsed() > START {
            // QEMU may have ended by itself; then there is nothing to kill.
            let _ = running.kill();
            let said = fs::read_to_string(&complaints).unwrap_or_default();
            return Err(format!("QEMU did not start: {}", said.trim()));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}

/// The most functions that a single place may match.
const MOST: usize = 8;

/// Marks the start of gdb's answer to each place.
const MARK: &str = "@@ place";

/// Translates places, separated by commas, into gdb's breakpoints in the image of an app.
///
/// # Errors
///
/// In words: gdb cannot be started, or a place is not in the image, with a suggestion.
pub(super) fn resolve(image: &Path, app: &str, places: &str) -> Result<Vec<String>, String> {
    let places: Vec<&str> = places.split(',').map(str::trim).collect();
    let mut gdb = process::Command::new("gdb");
    // `-nx`: a person's own settings could change the answers.
    gdb.args(["-nx", "-batch"]).arg(image);
    for place in &places {
        gdb.args(["-ex", &format!("echo {MARK}\\n")]);
        match is_line(place) {
            true => gdb.args(["-ex", &format!("info line {place}")]),
            false => gdb.args(["-ex", &format!("info functions -q -n {}", last(place))]),
        };
    }
    // The app's own functions, for a suggestion.
    let own = app.replace('-', "_");
    gdb.args(["-ex", &format!("echo {MARK}\\n")]);
    gdb.args(["-ex", &format!("info functions -q -n ^{own}::")]);
    let output = gdb.output();
    let output = output.map_err(|error| format!("cannot start gdb: {error}"))?;
    let said = String::from_utf8_lossy(&output.stdout);
    let mut said = said.split(MARK).skip(1);
    let answers: Vec<&str> = said.by_ref().take(places.len()).collect();
    let known = functions(said.next().unwrap_or_default());
    let mut found = Vec::new();
    for (place, answer) in places.into_iter().zip(answers) {
        match is_line(place) {
            // gdb also answers for lines without code, but names an address only for a line with
            // code.
            true if answer.contains(" address ") => found.push(place.into()),
            true => {
                return Err(format!(
                    "`--break {place}`: the image has no code of that line; name a file and a \
                     line of a function, such as `src/lib.rs:40`"
                ));
            }
            false => found.extend(choose(place, &own, functions(answer), &known)?),
        }
    }
    Ok(found)
}

/// Reports whether a place is a file and a line.
fn is_line(place: &str) -> bool {
    let parts = place.rsplit_once(':');
    parts.is_some_and(|(file, line)| {
        !file.ends_with(':') && line.bytes().all(|byte| byte.is_ascii_digit()) && !line.is_empty()
    })
}

/// Returns the last part of a function's path.
fn last(path: &str) -> &str {
    path.rsplit("::").next().unwrap_or(path)
}

/// Reads the paths of functions from gdb's list. Skips generic functions, because gdb does not find
/// them by name.
fn functions(listed: &str) -> Vec<&str> {
    let lines = listed.lines().filter_map(|line| line.split_once("fn "));
    let paths = lines.filter_map(|(_, rest)| {
        let end = rest.find(['(', '<'])?;
        rest[end..].starts_with('(').then_some(&rest[..end])
    });
    let mut paths: Vec<&str> = paths.collect();
    paths.sort_unstable();
    paths.dedup();
    paths
}

/// Chooses the functions matching a place; functions of the app take precedence.
fn choose(
    place: &str,
    own: &str,
    listed: Vec<&str>,
    known: &[&str],
) -> Result<Vec<String>, String> {
    let is_meant = |path: &&str| {
        let before = path.strip_suffix(place);
        // Only whole parts of a path match: `trol` is not `control`.
        before.is_some_and(|before| before.is_empty() || before.ends_with("::"))
    };
    let mut meant: Vec<&str> = listed.into_iter().filter(is_meant).collect();
    let is_own = |path: &&str| path.split("::").next() == Some(own);
    if meant.iter().any(is_own) {
        meant.retain(is_own);
    }
    let shown = quoted(place);
    if meant.is_empty() {
        let names: Vec<&str> = known.iter().map(|path| last(path)).collect();
        let hint = did_you_mean(last(place), &names);
        return Err(format!(
            "`--break`: the image has no function {shown}; a closure is found by `FILE:LINE`{hint}"
        ));
    }
    // The processor has few hardware breakpoints, and hardly anybody wants so many stops.
    if meant.len() > MOST {
        return Err(format!(
            "`--break`: {} functions are called {shown}; give more of the path, such as `{}`",
            meant.len(),
            meant[0]
        ));
    }
    Ok(meant.into_iter().map(String::from).collect())
}

/// Returns the script for gdb: it connects to the guest, sets the breakpoints and continues.
///
/// The script sets hardware breakpoints, because they work before the code has been loaded.
pub(super) fn script_text(socket: &Path, places: &[String]) -> String {
    let mut text = String::from("set pagination off\nset confirm off\nset width 0\n");
    if let Some(printers) = printers() {
        let _ = writeln!(text, "source {printers}");
    }
    let _ = writeln!(text, "target remote {}", socket.display());
    for place in places {
        let _ = writeln!(text, "hbreak {place}");
    }
    text + "continue\n"
}

/// Returns the path of the Rust toolchain's script for showing vectors and strings in gdb.
fn printers() -> Option<String> {
    let mut rustc = process::Command::new("rustc");
    rustc.current_dir(system::workspace());
    let root = system::run(rustc.args(["--print", "sysroot"])).ok()?;
    let folder = Path::new(root.trim()).join("lib/rustlib/etc");
    let file = folder.join("gdb_load_rust_pretty_printers.py");
    file.is_file().then(|| file.display().to_string())
}

/// Returns the command for starting gdb with its script and, in place of a person, with a file of
/// commands.
pub(super) fn gdb(image: &Path, script: &Path, commands: Option<&Path>) -> process::Command {
    let mut gdb = process::Command::new("gdb");
    gdb.arg("-q");
    if commands.is_some() {
        gdb.args(["-nx", "-batch"]);
    }
    gdb.arg("-x").arg(script);
    if let Some(commands) = commands {
        gdb.arg("-x").arg(commands);
    }
    gdb.arg(image);
    gdb
}

#[cfg(test)]
mod tests {
    use super::{choose, functions, is_line};

    const LISTED: &str = "\nFile apps/drone/src/attitude.rs:\n\
        78:\tfn drone::attitude::control(*mut drone::attitude::AttitudeEstimate) -> [f64; 3];\n\
        149:\tstatic fn drone::dags::register<(a, b)>(u8);\n\
        File kernel/src/a.rs:\n1:\tfn kernel::watch::control();\n";

    #[test]
    fn a_function_is_found_by_the_end_of_its_path() {
        let chosen = |place| choose(place, "drone", functions(LISTED), &functions(LISTED));
        for (place, path) in [
            ("control", "drone::attitude::control"),
            ("attitude::control", "drone::attitude::control"),
            ("watch::control", "kernel::watch::control"),
        ] {
            assert_eq!(chosen(place), Ok(vec![path.to_string()]));
        }
        let refused = chosen("contrl").unwrap_err();
        assert!(refused.ends_with("did you mean `control`?"), "{refused}");
        assert!(chosen("trol").is_err());
        let all: Vec<String> = (0..9).map(|n| format!("a{n}::new")).collect();
        let all = all.iter().map(String::as_str).collect();
        let refused = choose("new", "drone", all, &[]).unwrap_err();
        assert!(refused.contains("9 functions") && refused.contains("`a0::new`"));
        let places = ["src/lib.rs:40", "control", "a::b", "a::9", "lib.rs:"];
        assert_eq!(places.map(is_line), [true, false, false, false, false]);
    }
}
