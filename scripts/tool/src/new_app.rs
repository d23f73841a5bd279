//! Makes an app of one's own, under `apps/` or in a repository of its own: the subcommand
//! `new-app`.
//!
//! The *template* is a complete app: a library with the functions and their DAG, a program to boot
//! them, the same program for Linux, and a test in virtual time on the host. A new app is a copy of
//! the template with another name. The workspace's `apps/*` lets cargo find apps under `apps/`, so
//! nothing else changes there. A repository also gets its share of the workspace: profiles, the
//! toolchain's version, the sources of the crates. Cargo's *runner* there boots images, so
//! `cargo run` and `cargo test` work as for any program.
//!
//! The name becomes the name of a package, of a folder and, with `_` for `-`, of a crate. So it
//! must be possible as each of them: no keyword, no library linked to every program, no package of
//! the workspace. An impossible name is refused before anything is written. If writing fails in the
//! middle, the new folder is removed.
//!
//! Exit codes: 0 the app is there, 1 its files could not be written, 2 a refused
//! command line.

use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use text::quoted;

use crate::files;
use crate::image::package_name;
use crate::options::{Command, CommandLine, Refusal, ValueKind, options};
use crate::system::{self, files_below};

/// The options and the help text of `new-app`.
pub static NEW_APP: Command = Command {
    invocation: "./scripts/new-app",
    about: "\
Makes an app of your own, in a repository of its own or under apps/: a library with
functions and their DAG, a program that boots it, and a test that runs it on the host in
virtual time.",
    positional: Some((
        ValueKind::Text("NAME"),
        "The app's name: small letters, digits and hyphens, a letter first, at most 32.",
    )),
    options: OPTIONS,
    notes: "\
With --out, cargo run boots the app and cargo test tests it; without, it is in apps/,
./scripts/run --app NAME boots it and cargo test -p NAME tests it. docs/guide.md shows
what to do next.

exit codes: 0 the app is there; 1 its files cannot be written; 2 a refused
command line
",
};

options! {
    /// Make the app in this new folder, which is the root of a repository.
    OUT: ValueKind::File("DIR");
    /// --out: take the crates from this git repository, not from the folder of these commands.
    /// Its runner is `fass-tool boot`, which `cargo install --git URL tool` installs.
    GIT: ValueKind::Text("URL");
}

/// The template's name, as a package and as a crate.
const PLACEHOLDER: (&str, &str) = ("app-template", "app_template");

/// A file of an app: its path in the app's folder, and its text.
type AppFile = (&'static str, &'static str);

/// Returns a file of the template; its name there may differ from its name in the app.
macro_rules! template {
    ($file:literal) => {
        template!($file, $file)
    };
    ($file:literal, $name:literal) => {
        ($file, include_str!(concat!("../template/", $name)))
    };
}

/// The manifest of an app under `apps/`.
const MANIFEST: AppFile = template!("Cargo.toml", "manifest.toml");

/// The template's other files, included in every app.
const FILES: &[AppFile] = &[
    template!("build.rs"),
    template!("src/lib.rs"),
    template!("src/main.rs"),
    template!("examples/app-template-linux.rs"),
    template!("examples/replay.rs"),
    template!("tests/virtual_time.rs"),
];

/// Texts of the template, and the texts to replace them in an app.
type Changes = Vec<(String, String)>;

/// Runs the subcommand with the words after its name.
pub fn new_app(words: &[OsString]) -> ExitCode {
    NEW_APP.carry_out(words, |options| {
        print!("{}", make(options)?);
        Ok(ExitCode::SUCCESS)
    })
}

/// Makes the app, and returns the next steps for the person.
fn make(options: &CommandLine) -> Result<String, Refusal> {
    let usage = |line: &str| Err(Refusal::Usage(line.into()));
    let Some(name) = options.positional() else {
        return usage("which name? give one, such as `./scripts/new-app brake-assist`");
    };
    match (options.path(name::OUT), options.text(name::GIT)) {
        (None, Some(_)) => usage("`--git` is for a repository; add its folder, `--out DIR`"),
        (None, None) => create(system::workspace(), name).map(|_| next_steps(name)),
        (Some(out), git) => {
            let source = git.map_or(CrateSource::Folder(system::workspace()), CrateSource::Git);
            create_repository(out, name, source).map(|()| next_steps_there(out, source))
        }
    }
}

/// Writes a new app into a workspace, and returns its folder.
///
/// # Errors
///
/// The name is refused, or a file cannot be written. Nothing is left in either case.
pub fn create(workspace: &Path, name: &str) -> Result<PathBuf, Refusal> {
    check(workspace, name).map_err(Refusal::Usage)?;
    let folder = workspace.join("apps").join(name);
    let files = [MANIFEST].into_iter().chain(FILES.iter().copied());
    // `check` has passed, but another command may have made the folder since.
    write_folder(&folder, name, files, Changes::new(), &taken(name))?;
    Ok(folder)
}

/// Makes an app's folder, which must not exist, and writes the changed files into it. `taken` is
/// the error for an existing folder.
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
    // `create_dir` is the one atomic test that the folder is new, so removing it later is safe.
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
        // A folder that cannot be written can perhaps not be removed either; the error names the
        // folder.
        let _ = fs::remove_dir_all(folder);
        Refusal::Failure(line)
    })
}

/// Returns the list of the files in an app's folder.
fn is_there(folder: &str) -> String {
    format!(
        "\
{folder} is there:
  src/lib.rs             the functions and their DAG: begin here
  src/main.rs            boots it and reports
  tests/virtual_time.rs  runs it on the host, in virtual time
  examples/              replay a recording, run it on Linux

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

/// The longest name, in bytes; with a longer name, lines of the template would exceed the width.
const LONGEST: usize = 32;

/// Names that cannot be crates, because they have another meaning: keywords, the compiler's own
/// crates, and folders made by cargo.
const RESERVED: &str = "\
    abstract alloc as async await become box break build const continue core crate deps do dyn \
    else enum examples extern false final fn for gen if impl in incremental let loop macro \
    match mod move mut override priv proc-macro pub ref return self static std struct super \
    test trait true try type typeof unsafe unsized use virtual where while yield";

/// Checks whether a new app of a workspace can have a name.
///
/// # Errors
///
/// One line: the name, the fault, and the rule.
pub fn check(workspace: &Path, name: &str) -> Result<(), String> {
    check_word(name)?;
    let folder = Path::new("apps").join(name);
    if workspace.join(&folder).exists() {
        return Err(taken(name));
    }
    check_packages(workspace, name)
}

/// Checks that no package of a workspace has an app's name.
fn check_packages(workspace: &Path, name: &str) -> Result<(), String> {
    match package_folder(workspace, name) {
        Some(taken) => refuse(
            name,
            &format!("the package in {} has it; choose another", taken.display()),
        ),
        None => Ok(()),
    }
}

fn refuse(name: &str, why: &str) -> Result<(), String> {
    Err(format!("{} cannot be an app's name: {why}", quoted(name)))
}

/// Checks whether a name is possible for any app: as a package and as a crate.
///
/// # Errors
///
/// The name's fault, as in [`check`].
fn check_word(name: &str) -> Result<(), String> {
    let is_allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let is_right = (name.len() <= LONGEST && name.chars().all(is_allowed))
        && name.split('-').all(|part| !part.is_empty())
        && name.starts_with(|first: char| first.is_ascii_lowercase());
    if !is_right {
        let why = format!(
            "give small letters, digits and single hyphens, a letter first, {LONGEST} at most, as \
             in `brake-assist`"
        );
        return refuse(name, &why);
    }
    if RESERVED.split(' ').any(|word| word == name) {
        let why = "Rust or cargo use the word themselves; add another, such as `my-`";
        return refuse(name, why);
    }
    Ok(())
}

/// Returns the error for a name that an app already has.
fn taken(name: &str) -> String {
    format!("there is an app `{name}` already; choose another name, or edit apps/{name}")
}

/// Returns the folder, within the workspace, of the package with a name.
fn package_folder(workspace: &Path, name: &str) -> Option<PathBuf> {
    let manifest = files_below(workspace, |_| true).into_iter().find(|file| {
        let text = || fs::read_to_string(file).unwrap_or_default();
        file.ends_with("Cargo.toml") && package_name(&text()).as_deref() == Some(name)
    })?;
    let folder = manifest.parent()?.strip_prefix(workspace);
    folder.ok().map(Path::to_path_buf)
}

/// The source of a repository's crates and of cargo's runner.
#[derive(Clone, Copy, Debug)]
pub enum CrateSource<'a> {
    /// The root of a workspace in this file system.
    Folder(&'a Path),
    /// The URL of a git repository; the runner is installed from there.
    Git(&'a str),
}

/// The workspace's root, as written in the template's files.
const WORKSPACE: &str = "/workspace";

/// The folders of the packages in the template's dependencies.
const PACKAGES: [&str; 5] = [
    "fass",
    "kernel",
    "kernel/on-linux",
    "fass/virtual-time",
    "boot/link",
];

/// The files of an app in a repository, beyond those of every app.
const OWN_FILES: [AppFile; 6] = [
    template!("Cargo.toml", "repository/manifest.toml"),
    template!(".cargo/config.toml", "repository/config.toml"),
    template!(".github/workflows/ci.yml", "repository/ci.yml"),
    (".gitignore", "/target\n"),
    template!("README.md", "repository/README.md"),
    (
        "rust-toolchain.toml",
        include_str!("../../../rust-toolchain.toml"),
    ),
];

/// Makes a new folder, the root of an app's repository.
///
/// # Errors
///
/// The name or the folder is refused, or a file cannot be written. Nothing is left in any case.
pub fn create_repository(out: &Path, name: &str, source: CrateSource<'_>) -> Result<(), Refusal> {
    check_word(name).map_err(Refusal::Usage)?;
    // Cargo could not tell the app from a dependency of the same name, however indirect. A git
    // repository has the same packages as this workspace.
    check_packages(system::workspace(), name).map_err(Refusal::Usage)?;
    let shown = quoted(&out.to_string_lossy()).to_string();
    let changes = match source {
        // The URL goes into a TOML string as it is.
        CrateSource::Git(url) if url.contains(['"', '\\', '\n']) => {
            let line = format!("`--git {}`: no URL has such a character", quoted(url));
            return Err(Refusal::Usage(line));
        }
        CrateSource::Folder(root) => {
            match way(out, root).filter(|way| !way.contains(['"', '\\'])) {
                Some(way) => from_folder(&way),
                None => {
                    let line = format!("{shown}: cargo cannot name the folder of these commands");
                    return Err(Refusal::Failure(line));
                }
            }
        }
        CrateSource::Git(url) => from_git(url),
    };
    let files = OWN_FILES.into_iter().chain(FILES.iter().copied());
    let taken = format!("`--out` {shown}: it is there already; name a folder to be made");
    write_folder(out, name, files, changes, &taken)
}

/// Returns the relative path from a folder to be made to an existing folder, so that both may be
/// moved together.
fn way(from: &Path, to: &Path) -> Option<String> {
    let from = std::path::absolute(from).ok()?;
    // Only the existing folders are resolved: the rest of the path has no links yet.
    let there = from.ancestors().find(|above| above.exists())?;
    let new = from.strip_prefix(there).ok()?;
    let (from, to) = (
        there.canonicalize().ok()?.join(new),
        to.canonicalize().ok()?,
    );
    let common = from.ancestors().find(|above| to.starts_with(above))?;
    let up = from.strip_prefix(common).ok()?.iter().map(|_| "..");
    let way: PathBuf = up.chain(to.strip_prefix(common).ok()?.to_str()).collect();
    way.to_str().map(String::from)
}

/// Returns the changes for using the crates of this workspace. Nothing needs to be installed for
/// them.
fn from_folder(root: &str) -> Changes {
    // The runner is in the workspace, so the workflow need not install it.
    let install = "      - run: cargo install --locked --git /workspace tool\n";
    let changes = [
        (install, ""),
        ("ubuntu-latest", "self-hosted # where the crates are"),
        (WORKSPACE, root),
    ];
    changes.map(|(old, new)| (old.into(), new.into())).into()
}

/// Returns the changes for using the crates of a git repository.
fn from_git(url: &str) -> Changes {
    let by_path = |package| format!("path = \"{WORKSPACE}/{package}\"");
    let crates = PACKAGES.map(|package| (by_path(package), format!("git = \"{url}\"")));
    let others = [
        ("\"/workspace/scripts/boot\"", "\"fass-tool\", \"boot\""),
        ("/workspace/scripts/debug", "fass-tool debug"),
        (WORKSPACE, url),
    ];
    let others = others.map(|(old, new)| (old.into(), new.into()));
    crates.into_iter().chain(others).collect()
}

/// Returns the next steps in the new repository.
fn next_steps_there(out: &Path, source: CrateSource<'_>) -> String {
    let install = match source {
        CrateSource::Folder(_) => String::new(),
        CrateSource::Git(url) => {
            format!("cargo install --locked --git {url} tool   # once: the runner, fass-tool\n")
        }
    };
    format!(
        "\
{}{install}cd {}
cargo run               # boots it in QEMU
cargo test              # tests it on the host
cargo run -- --on linux # runs it on Linux, docs/linux.md
git init                # docs/guide.md goes on from here
",
        is_there(&out.display().to_string()),
        out.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::workspace;
    use crate::tests::rows;

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
        // Of two commands at once one makes it.
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
        // A file in the place of a folder.
        fs::write(workspace.join("apps"), "").unwrap();
        let Refusal::Failure(line) = create(&workspace, "brake-assist").unwrap_err() else {
            panic!("a file has become a folder");
        };
        assert!(line.starts_with("cannot write `") && line.contains("apps/brake-assist`: "));
        fs::remove_dir_all(workspace).unwrap();
    }

    /// Names, and the reasons for their refusal.
    const BAD: &str = "Brake_Assist | `Brake_Assist` cannot be an app's name: give small letters, digits and single hyphens, a letter first, 32 at most, as in `brake-assist`
struct | `struct` cannot be an app's name: Rust or cargo use the word themselves; add another, such as `my-`
fork-join | there is an app `fork-join` already; choose another name, or edit apps/fork-join
virtual-time | `virtual-time` cannot be an app's name: the package in fass/virtual-time has it; choose another
tool | `tool` cannot be an app's name: the package in scripts/tool has it; choose another";

    #[test]
    fn each_bad_name_is_refused_with_what_is_possible() {
        for [name, line] in rows(BAD) {
            assert_eq!(check(workspace(), &name), Err(line));
        }
        let long = "a".repeat(33);
        for name in ["", "../fork", "2nd", "brake-", "-a", "a--b", &long] {
            let said = check(workspace(), name).unwrap_err();
            let is_told = said.ends_with(", 32 at most, as in `brake-assist`");
            assert!(is_told, "{said}");
        }
        assert_eq!(check(workspace(), "brake-assist-2"), Ok(()));
    }

    /// `tests/tests/boots/new_app.rs` shows that the app builds and boots.
    #[test]
    fn from_git_the_url_is_all_that_is_named_and_from_a_folder_nothing_is_installed() {
        let url = "https://example.org/kernel.git";
        for source in [CrateSource::Git(url), CrateSource::Folder(workspace())] {
            let is_git = matches!(source, CrateSource::Git(_));
            let out = std::env::temp_dir().join(format!("from-{is_git}-{}", std::process::id()));
            create_repository(&out, "brake-assist", source).unwrap();
            let places = [
                "Cargo.toml",
                ".cargo/config.toml",
                ".github/workflows/ci.yml",
            ];
            let texts = places.map(|place| fs::read_to_string(out.join(place)).unwrap());
            let [manifest, runner, steps] = &texts;
            assert_eq!(steps.contains("install"), is_git, "{steps}");
            let way = way(&out, workspace()).unwrap();
            let kernel = out.join(&way).canonicalize();
            assert_eq!(kernel.unwrap(), workspace().canonicalize().unwrap());
            // Below `/`, the way itself ends with the folder's path.
            let root = workspace().to_str().unwrap();
            assert!(
                !texts.concat().replace(&way, "").contains(root),
                "a colleague has another folder: {texts:?}"
            );
            if is_git {
                let by_url = format!("{{ git = \"{url}\" }}");
                assert_eq!(
                    manifest.matches(&by_url).count(),
                    PACKAGES.len(),
                    "{manifest}"
                );
                let words = "runner = [\"fass-tool\", \"boot\"]\n";
                assert!(runner.ends_with(words), "{runner}");
                let install = format!("- run: cargo install --locked --git {url} tool\n");
                assert!(steps.contains(&install), "{steps}");
                assert!(!texts.concat().contains("/workspace"), "{texts:?}");
            }
            let is_there = ": it is there already; name a folder to be made";
            let packages = "boot-entry boot-link executive front linux random recording sched-dag";
            let packages = packages.split(' ');
            let packages = packages.map(|name| (name, " has it; choose another"));
            let rows = [
                ("brake", is_there),
                ("Brake", ": give small letters, digits and"),
            ];
            for (name, part) in rows.into_iter().chain(packages) {
                let folder = match name {
                    "brake" => out.clone(),
                    _ => out.join("new"),
                };
                match create_repository(&folder, name, source) {
                    Err(Refusal::Usage(line)) => assert!(line.contains(part), "{line}"),
                    other => panic!("{name}: {other:?}"),
                }
            }
            assert!(!out.join("new").exists());
            fs::remove_dir_all(out).unwrap();
        }
    }

    #[test]
    fn it_is_built_for_figures_as_in_the_workspace() {
        let profile = |manifest: &'static str| {
            let from = manifest.find("[profile.release]").unwrap();
            let lines = manifest[from..].lines().filter(|line| !line.is_empty());
            lines.collect::<Vec<_>>()
        };
        let own = profile(include_str!("../template/repository/manifest.toml"));
        let workspace = profile(include_str!("../../../Cargo.toml"));
        assert!(own.len() > 8, "{own:?}");
        assert!(own.iter().all(|line| workspace.contains(line)), "{own:?}");
    }
}
