//! The subcommand `boot`: a runner for cargo.
//!
//! Cargo hands each program that it would start to a *runner*, images and tests alike. An image is
//! booted, as by `run --image`; any other program replaces this process, and so keeps its words,
//! streams and exit code. With `--on linux` or `--on debian`, cargo builds the app's Linux program,
//! and the runner runs it instead.

use std::env;
use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{self, ExitCode};

use super::{RUN, on_linux, run};
use crate::files;
use crate::image;
use crate::options::{Command, Refusal, ValueKind};

/// The help text of `boot`.
static BOOT: Command = Command {
    invocation: "./scripts/boot",
    about: "\
Boots an image, with the options of ./scripts/run after it, and runs any other program
as it is: a runner for cargo.",
    positional: Some((
        ValueKind::File("FILE"),
        "The image or program; all words after it are for that.",
    )),
    options: &[],
    notes: "\
In the .cargo/config.toml of an app that ./scripts/new-app made:
  [target.x86_64-unknown-linux-gnu]
  runner = [\"/path/to/scripts/boot\"]

exit codes: those of ./scripts/run, or of the program
",
};

/// Runs the subcommand with the words after its name.
pub fn boot(words: &[OsString]) -> ExitCode {
    let named = words.split_first();
    // The first word is the file, even if words after it look like our options: they are the
    // program's.
    let Some((file, rest)) = named.filter(|(file, _)| !file.as_bytes().starts_with(b"-")) else {
        return BOOT.carry_out(words, |_| {
            let question = "which file? name an image, such as `target/release/fork-join`";
            Err(Refusal::Usage(question.into()))
        });
    };
    // An image is recognized by its content; all else is a program of the host.
    if let Ok(app) = image::check_file(Path::new(file)) {
        // `run` below refuses a line that does not parse, with its own words.
        if let Ok(options) = RUN.parse(rest)
            && on_linux::is_asked_for(&options)
        {
            return match for_linux(app.as_deref()) {
                Ok(program) => run(&[&["--image".into(), program.into()], rest].concat()),
                Err(why) => BOOT.report(Refusal::Failure(why)),
            };
        }
        return run(&[&["--image".into(), file.clone()], rest].concat());
    }
    // `exec` returns only if it failed.
    let error = process::Command::new(file).args(rest).exec();
    let file = files::shown_path(Path::new(file));
    BOOT.report(Refusal::Failure(format!("cannot start {file}: {error}")))
}

/// Builds the program for Linux of the package whose image cargo has built.
fn for_linux(app: Option<&str>) -> Result<PathBuf, String> {
    // `scripts/tool/start` sets `TOOL_PACKAGE`, since the `cargo run` of the tool changes cargo's
    // own.
    let names = ["TOOL_PACKAGE", "CARGO_MANIFEST_DIR"];
    let folder = names.into_iter().find_map(env::var_os);
    let package = app.zip(folder.filter(|folder| !folder.is_empty()));
    let (app, folder) = package.ok_or(
        "`--on`: which package is the image of? say `cargo run -- --on linux` in the app's folder",
    )?;
    image::build_linux(app, Some(Path::new(&folder)))
}
