//! The subcommand `boot`: what cargo starts a program by.
//!
//! Cargo hands each program that it would start to a *runner*, images and tests alike. Here an
//! image is booted, as by `run --image`; any other program takes this process over, so that it
//! has its words, its streams and its exit code. With `--on linux`, or `--on debian`, what runs is
//! the app's program for Linux, which cargo builds first.

use std::env;
use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{self, ExitCode};

use super::{RUN, on_linux, run};
use crate::files;
use crate::image;
use crate::options::{Command, Refusal, Takes};

/// The table of `boot`, for its help.
static BOOT: Command = Command {
    invocation: "./scripts/boot",
    about: "\
Boots an image, with the options of ./scripts/run after it, and runs any other program
as it is: a runner for cargo.",
    positional: Some((
        Takes::File("FILE"),
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
#[must_use]
pub fn boot(words: &[OsString]) -> ExitCode {
    let named = words.split_first();
    let Some((file, rest)) = named.filter(|(file, _)| !file.as_bytes().starts_with(b"-")) else {
        return BOOT.carry_out(words, |_| {
            let question = "which file? name an image, such as `target/release/fork-join`";
            Err(Refusal::Usage(question.into()))
        });
    };
    if let Ok(app) = image::check_file(Path::new(file)) {
        if let Ok(options) = RUN.parse(rest)
            && on_linux::is_asked_for(&options)
        {
            return match for_linux(app.as_deref()) {
                Ok(program) => run(&[&["--image".into(), program.into()], rest].concat()),
                Err(why) => BOOT.fail(&why),
            };
        }
        return run(&[&["--image".into(), file.clone()], rest].concat());
    }
    let error = process::Command::new(file).args(rest).exec();
    BOOT.fail(&format!(
        "cannot start {}: {error}",
        files::place(Path::new(file))
    ))
}

/// Builds the program for Linux of the package whose image cargo has built.
fn for_linux(app: Option<&str>) -> Result<PathBuf, String> {
    // `scripts/tool/start` sets the former; without it cargo's own word is of that package.
    let names = ["TOOL_PACKAGE", "CARGO_MANIFEST_DIR"];
    let folder = names.into_iter().find_map(env::var_os);
    let package = app.zip(folder.filter(|folder| !folder.is_empty()));
    let (app, folder) = package.ok_or(
        "`--on`: which package is the image of? say `cargo run -- --on linux` in the app's folder",
    )?;
    Ok(image::build_linux(app, Some(Path::new(&folder)))?.path)
}
