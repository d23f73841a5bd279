//! The subcommand `debug`: an app in QEMU, and gdb at it.
//!
//! The image is built by the profile `gdb`, which optimizes nothing and keeps what gdb needs to
//! show variables. QEMU waits before the first instruction; gdb is told of it by a script, with
//! the breakpoints that the person names, and takes this process over: so the terminal is gdb's
//! alone, and QEMU, which the system ends with it, does not hear a ctrl-C that is meant for gdb.
//!
//! What the guest prints for people comes between gdb's lines. Budgets are off, for code that
//! is not optimized takes many times its WCET.

use std::ffi::OsString;
use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{self, ExitCode, Stdio};
use std::time::{Duration, Instant};

use super::handed::Handed;
use super::{RUN, check_files, choose_app, gdb, loading};
use crate::child;
use crate::files;
use crate::image::{self, Profile};
use crate::install;
use crate::options::{Command, Opt, Parsed, Refusal, Takes};
use crate::qemu::{Mode, Qemu};
use crate::system;

/// How long QEMU may take until gdb can reach it.
const START: Duration = Duration::from_secs(30);

/// The table of `debug`. What is an option of `run`, too, means the same.
static DEBUG: Command = Command {
    invocation: "./scripts/debug",
    about: "Boots an app in QEMU with gdb at it, in an image that gdb shows whole.",
    positional: None,
    options: &[
        of_run("app"),
        Opt::new(
            "break",
            Takes::Text("PLACES"),
            "Where to stop, with commas between: a function, by the end of its path \
             (control, attitude::control), or FILE:LINE (src/dags.rs:153).",
        )
        .or("kernel_main"),
        Opt::new(
            "commands",
            Takes::File("FILE"),
            "Have gdb do what this file says once it has stopped, and end; no person is asked.",
        ),
        of_run("cores").or("1"),
        of_run("jobs"),
        of_run("seed"),
        of_run("memory"),
        of_run("mode").or("deterministic"),
        of_run("append"),
        of_run("module"),
        of_run("input"),
        of_run("replay"),
        of_run("from"),
        of_run("image"),
        of_run("qemu"),
    ],
    notes: "\
gdb is installed if it is missing. Budgets are off. In mode deterministic time stands still
while the guest is stopped, and each run stops where the last one did; docs/debugging.md has a
worked example.

exit codes: gdb's; 1 a failure; 2 a refused command line
",
};

/// Returns an option of `run`.
const fn of_run(name: &str) -> Opt {
    let mut at = 0;
    while at < RUN.options.len() {
        if is_same(RUN.options[at].name.as_bytes(), name.as_bytes()) {
            return RUN.options[at];
        }
        at += 1;
    }
    panic!("`run` has no such option")
}

const fn is_same(one: &[u8], other: &[u8]) -> bool {
    let mut at = 0;
    while at < one.len() && at < other.len() && one[at] == other[at] {
        at += 1;
    }
    at == one.len() && at == other.len()
}

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn debug(words: &[OsString]) -> ExitCode {
    DEBUG.carry_out(words, attempt)
}

/// Does so. Where all is well gdb takes this process over, and this never returns.
fn attempt(own: &Parsed) -> Result<ExitCode, Refusal> {
    let run = as_run(own)?;
    check_files(&run)?;
    let commands = own.path("commands");
    if let Some(path) = commands {
        let place = files::place(path);
        files::read(path)
            .map_err(|why| Refusal::Usage(format!("`--commands {place}` {why}; name another")))?;
    }
    let app = choose_app(&run, false)?;
    let memory_mib = loading::choose_memory(&run, None)?;
    let program = loading::choose_program(&run)?;
    install::ensure(&install::GDB)?;
    let handed = Handed::read(&run, None)?;
    let mode = run.text("mode").and_then(Mode::from_name);
    let mode = mode.unwrap_or(Mode::Deterministic);
    let mut qemu = super::describe(&run, &program, mode, memory_mib, None);
    qemu.stops = false; // ctrl-C is gdb's
    qemu.guest_words += &format!(" budget_factor=0{}", handed.guest_words());
    qemu.module = handed.module();
    qemu.check_words().map_err(Refusal::Usage)?;

    let image = match run.path("image") {
        Some(path) => path.into(),
        None => {
            eprintln!("building `{app}` by the profile `gdb`");
            image::build_by(&app, Profile::Gdb)?.path
        }
    };
    let places = own.text("break").unwrap_or_default();
    let places = gdb::resolve(&image, &app, places).map_err(Refusal::Usage)?;
    let log = system::new_log(&format!("{app}-gdb"))?;
    let socket = log.with_extension("socket");
    let script = log.with_extension("gdb");
    let text = gdb::script(&socket, &places);
    files::write(&script, text)?;
    start(qemu, &image, &log, &socket)?;
    let error = gdb::command(&image, &script, commands).exec();
    Err(Refusal::Failure(format!("cannot start gdb: {error}")))
}

/// Returns the options as those of `run`, whose names they have: what the person gave, and
/// where the defaults differ.
fn as_run(own: &Parsed) -> Result<Parsed, Refusal> {
    let shared = DEBUG.options.iter().map(|option| option.name);
    let shared = shared.filter(|name| RUN.options.iter().any(|option| option.name == *name));
    let shared = shared.filter(|name| own.is_given(name) || ["cores", "mode"].contains(name));
    let words = shared.filter_map(|name| {
        let mut word = OsString::from(format!("--{name}="));
        word.push(own.path(name)?);
        Some(word)
    });
    RUN.parse(&words.collect::<Vec<_>>())
}

/// Starts QEMU, which waits for gdb at the socket, and a filter that shows what the guest
/// prints for people.
fn start(mut qemu: Qemu, image: &Path, log: &Path, socket: &Path) -> Result<(), String> {
    let mut device = OsString::from("unix:");
    device.push(socket);
    device.push(",server=on,wait=off");
    qemu.debugger = Some(device);
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
    while !socket.exists() {
        if !matches!(running.try_wait(), Ok(None)) || begun.elapsed() > START {
            let _ = running.kill();
            let said = fs::read_to_string(&complaints).unwrap_or_default();
            return Err(format!("QEMU did not start: {}", said.trim()));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}
