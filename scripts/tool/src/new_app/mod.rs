//! The subcommand `new-app`: an app of one's own, under `apps/` or in a repository of its own.
//!
//! The *template* is an app that is complete: a library with the functions and
//! their DAG, a program that boots it, the same as a program for Linux, and a test that runs
//! it on the host in virtual time. A new app is a copy in which the template's name is replaced.
//! Under `apps/` cargo finds it by the workspace's `apps/*`, so nothing else changes. In a
//! repository it has what the workspace gives otherwise: `repository` adds that.
//!
//! A name that cannot be a package's, or is taken, is refused before anything is
//! written. If writing fails in the middle, what was written is removed.
//!
//! Exit codes: 0 the app is there, 1 its files could not be written, 2 a refused
//! command line.

mod name;
mod repository;

use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::files;
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::system;

pub use name::check;
pub use repository::{Source, create_repository};

/// The table of `new-app`.
pub static NEW_APP: Command = Command {
    invocation: "./scripts/new-app",
    about: "\
Makes an app of your own, in a repository of its own or under apps/: a library with
functions and their DAG, a program that boots it, and a test that runs it on the host in
virtual time.",
    positional: Some((
        Takes::Text("NAME"),
        "The app's name: small letters, digits and hyphens, a letter first, at most 32.",
    )),
    options: options! {
        /// Make the app in this new folder, which is the root of a repository.
        "out": Takes::File("DIR");
        /// --out: take the crates from this git repository, not from the folder of these commands.
        /// Its runner is `fass-tool boot`, which `cargo install --git URL tool` installs.
        "git": Takes::Text("URL");
    },
    notes: "\
With --out, cargo run boots the app and cargo test tests it; without, it is in apps/,
./scripts/run --app NAME boots it and cargo test -p NAME tests it. docs/guide.md shows
what to do next.

exit codes: 0 the app is there; 1 its files cannot be written; 2 a refused
command line
",
};

/// The template's name, as a package and as a crate.
const PLACEHOLDER: (&str, &str) = ("app-template", "app_template");

/// A file of an app: where it goes in the app's folder, and its text.
type AppFile = (&'static str, &'static str);

/// What says how an app under `apps/` is built.
const MANIFEST: AppFile = ("Cargo.toml", include_str!("../../template/manifest.toml"));

/// The template's other files, which any app has.
const FILES: &[AppFile] = &[
    ("build.rs", include_str!("../../template/build.rs")),
    ("src/lib.rs", include_str!("../../template/src/lib.rs")),
    ("src/main.rs", include_str!("../../template/src/main.rs")),
    (
        "examples/app-template-linux.rs",
        include_str!("../../template/examples/app-template-linux.rs"),
    ),
    (
        "examples/replay.rs",
        include_str!("../../template/examples/replay.rs"),
    ),
    (
        "tests/virtual_time.rs",
        include_str!("../../template/tests/virtual_time.rs"),
    ),
];

/// Texts of the template, and those that stand for them in an app.
type Changes = Vec<(String, String)>;

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn new_app(words: &[OsString]) -> ExitCode {
    NEW_APP.carry_out(words, |options| {
        print!("{}", make(options)?);
        Ok(ExitCode::SUCCESS)
    })
}

/// Makes the app, and returns what to do with it.
fn make(options: &Parsed) -> Result<String, Refusal> {
    let usage = |line: &str| Err(Refusal::Usage(line.into()));
    let Some(name) = options.positional() else {
        return usage("which name? give one, such as `./scripts/new-app brake-assist`");
    };
    match (options.path("out"), options.text("git")) {
        (None, Some(_)) => usage("`--git` is for a repository; add its folder, `--out DIR`"),
        (None, None) => create(system::workspace(), name).map(|_| next_steps(name)),
        (Some(out), git) => {
            let source = git.map_or(Source::Folder(system::workspace()), Source::Git);
            create_repository(out, name, source).map(|()| repository::next_steps(out, source))
        }
    }
}

/// Writes a new app into a workspace, and returns its folder.
///
/// # Errors
///
/// The name is refused, or a file cannot be written; nothing is left then.
pub fn create(workspace: &Path, name: &str) -> Result<PathBuf, Refusal> {
    check(workspace, name).map_err(Refusal::Usage)?;
    let folder = workspace.join("apps").join(name);
    let files = [MANIFEST].into_iter().chain(FILES.iter().copied());
    // Another command may have been as quick.
    write_folder(&folder, name, files, Changes::new(), &name::taken(name))?;
    Ok(folder)
}

/// Makes an app's folder, which must not be there, and writes its files, each changed as it
/// has to be. `taken` says that the folder is there.
fn write_folder(
    folder: &Path,
    name: &str,
    mut files: impl Iterator<Item = AppFile>,
    mut changes: Changes,
    taken: &str,
) -> Result<(), Refusal> {
    let failed = |error| Refusal::Failure(format!("cannot write `{}`: {error}", folder.display()));
    if let Some(parent) = folder.parent() {
        fs::create_dir_all(parent).map_err(failed)?;
    }
    fs::create_dir(folder).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => Refusal::Usage(taken.into()),
        _ => failed(error),
    })?;
    changes.push((PLACEHOLDER.0.into(), name.into()));
    changes.push((PLACEHOLDER.1.into(), name.replace('-', "_")));
    let written = files.try_for_each(|(place, text)| {
        let place = folder.join(place.replace(PLACEHOLDER.0, name));
        let changes = changes.iter();
        let text = changes.fold(text.to_string(), |text, (old, new)| text.replace(old, new));
        files::write(&place, text)
    });
    written.map_err(|line| {
        // What cannot be written can perhaps not be removed either; the line
        // names the place.
        let _ = fs::remove_dir_all(folder);
        Refusal::Failure(line)
    })
}

/// Says what is in an app's folder.
fn is_there(folder: &str) -> String {
    format!(
        "\
{folder} is there:
  src/lib.rs             the functions and their DAG: begin here
  src/main.rs            boots it and reports
  tests/virtual_time.rs  runs it on the host, in virtual time

"
    )
}

fn next_steps(name: &str) -> String {
    let boot = format!("./scripts/run --app {name}");
    let linux = format!("{boot} --on linux");
    let test = format!("cargo test -p {name}");
    format!(
        "\
{}{boot:width$}  boots it in QEMU
{linux}  runs it on Linux
{test:width$}  tests it on the host
{:width$}  goes on from here
",
        is_there(&format!("apps/{name}")),
        "docs/guide.md",
        width = linux.len()
    )
}

#[cfg(test)]
mod tests {
    use super::{FILES, MANIFEST, PLACEHOLDER, Refusal, create};
    use std::fs;

    #[test]
    fn the_template_names_itself_and_nothing_of_its_name_is_left_in_a_copy() {
        let workspace = std::env::temp_dir().join(format!("new-app-{}", std::process::id()));
        let folder = create(&workspace, "brake-assist").unwrap();
        let mut named = 0;
        for (place, template) in FILES.iter().chain([&MANIFEST]) {
            let place = place.replace(PLACEHOLDER.0, "brake-assist");
            let text = fs::read_to_string(folder.join(&place)).unwrap();
            let has_old = text.contains(PLACEHOLDER.0) || text.contains(PLACEHOLDER.1);
            assert!(!has_old, "{place}");
            named += usize::from(*template != text);
        }
        // All but build.rs and the program for Linux have the app's name.
        assert_eq!(named, 5);
        let again = create(&workspace, "brake-assist").unwrap_err();
        let line = "there is an app `brake-assist` already; choose another name, or edit \
                    apps/brake-assist";
        assert_eq!(again, Refusal::Usage(line.into()));
        // Of two at once one makes it.
        for number in 0..50 {
            let (name, barrier) = (format!("app-{number}"), std::sync::Barrier::new(2));
            let make = || {
                barrier.wait();
                create(&workspace, &name).is_ok()
            };
            let made = std::thread::scope(|scope| {
                [scope.spawn(make), scope.spawn(make)].map(|thread| thread.join().unwrap())
            });
            assert!(made[0] != made[1], "{name}: {made:?}");
        }
        fs::remove_dir_all(workspace).unwrap();
    }

    #[test]
    fn what_cannot_be_written_is_said_and_leaves_nothing() {
        let workspace = std::env::temp_dir().join(format!("no-app-{}", std::process::id()));
        fs::create_dir_all(&workspace).unwrap();
        // A file where a folder has to be.
        fs::write(workspace.join("apps"), "").unwrap();
        let Refusal::Failure(line) = create(&workspace, "brake-assist").unwrap_err() else {
            panic!("a file has become a folder");
        };
        assert!(line.starts_with("cannot write `") && line.contains("apps/brake-assist`: "));
        fs::remove_dir_all(workspace).unwrap();
    }
}
