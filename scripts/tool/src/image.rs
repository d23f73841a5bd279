//! Builds images with cargo, finds their files, and measures their sizes.
//!
//! An *image* is a freestanding ELF file. It is linked from a package under `apps/` (or from the
//! guest side of the boot tests) and bears the package's name. Images to run are built in release,
//! images for a debugger by a profile of their own. The tool asks cargo itself for the file's path,
//! so no setting of cargo's can make the tool boot a stale image.

use std::env;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use text::quoted;

use crate::elf;
use crate::files;
use crate::install::WASM_TARGET;
use crate::options::did_you_mean;
use crate::progress::ProgressNote;
use crate::system;
use views::json::Value;

/// The most bytes of a stripped image.
pub const MOST_STRIPPED_BYTES: u64 = 984 << 10;

/// The folder of the apps.
const APPS: &str = "apps";

/// Returns the names of the apps in a folder of the workspace, sorted.
pub fn apps(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(system::workspace().join(folder));
    let folders = entries.into_iter().flatten().flatten();
    let folders = folders.map(|entry| entry.path());
    // A library for apps is not an app.
    let folders = folders.filter(|folder| folder.join("src/main.rs").is_file());
    let manifests = folders.flat_map(|folder| fs::read_to_string(folder.join("Cargo.toml")));
    let mut names: Vec<String> = manifests.filter_map(|it| package_name(&it)).collect();
    names.sort();
    names
}

/// Returns the name of a manifest's package; `None` for the manifest of a workspace alone.
pub fn package_name(manifest: &str) -> Option<String> {
    let package = manifest.split("[package]").nth(1)?;
    let line = package.lines().find(|line| line.starts_with("name"))?;
    Some(line.split('"').nth(1)?.into())
}

/// Makes sure that `name` is the name of an app.
///
/// # Errors
///
/// One line naming the rejected app and the existing apps.
pub fn check_app(name: &str) -> Result<(), String> {
    let apps = apps(APPS);
    if apps.iter().any(|app| app == name) {
        return Ok(());
    }
    let names: Vec<&str> = apps.iter().map(String::as_str).collect();
    let hint = did_you_mean(name, &names);
    Err(format!(
        "no app {}; there are: {}{hint}",
        quoted(name),
        names.join(", ")
    ))
}

/// Makes sure that a file is an image. Returns the name of its app, if the image has a note of the
/// name.
///
/// # Errors
///
/// One line with the reason, and with the place of images.
pub fn check_file(path: &Path) -> Result<Option<String>, String> {
    let app = files::read(path).and_then(|bytes| {
        let bootable = elf::check_bootable(&bytes);
        bootable.map_err(|what| format!("is no image: {what}"))?;
        Ok(elf::app_name(&bytes))
    });
    app.map_err(|why| {
        format!(
            "{why}; name what `cargo build --release -p APP` leaves in target/release, or \
             give --app instead"
        )
    })
}

/// Makes sure that a file can be an app's program for Linux, and returns the app's name.
///
/// # Errors
///
/// The errors of [`check_file`], with another remedy.
pub fn check_linux_file(path: &Path) -> Result<Option<String>, String> {
    let name = path
        .file_name()
        .and_then(|name| name.to_str()?.strip_suffix("-linux"));
    let is_image = |bytes: Vec<u8>| elf::check_bootable(&bytes).is_ok();
    // An image for the bare machine may bear such a name, too, but does not run on Linux.
    match (name, files::read(path).map(is_image)?) {
        (Some(app), false) => Ok(Some(app.into())),
        _ => Err(
            "is no app's program for Linux; name what `cargo build --profile linux -p APP \
                  --example APP-linux` leaves in target/linux/examples, or give --app instead"
                .into(),
        ),
    }
}

/// Builds the image of a package in release, and returns the image's path. Cargo prints its
/// progress and errors to standard error meanwhile.
///
/// # Errors
///
/// Cargo failed, or the package has no binary of its own name.
pub fn build(package: &str) -> Result<PathBuf, String> {
    build_target(package, "release", ["--bin", package], None)
}

/// Makes sure that an app has a program for Linux.
///
/// # Errors
///
/// One line naming the apps that have such a program.
pub fn check_linux(app: &str) -> Result<(), String> {
    let has_program = |app: &String| {
        let program = format!("{APPS}/{app}/examples/{}.rs", linux_name(app));
        system::workspace().join(program).is_file()
    };
    if has_program(&app.into()) {
        return Ok(());
    }
    let others: Vec<String> = apps(APPS).into_iter().filter(has_program).collect();
    Err(format!(
        "app {} has no program for Linux; these have: {}",
        quoted(app),
        others.join(", ")
    ))
}

/// Returns the name of an app's program for Linux.
fn linux_name(app: &str) -> String {
    format!("{app}-linux")
}

/// Builds an app's program for Linux, as [`build`] builds the image. `folder` is the folder of a
/// package elsewhere; `None` means this workspace.
///
/// # Errors
///
/// Cargo failed, or the package has no such program.
pub fn build_linux(app: &str, folder: Option<&Path>) -> Result<PathBuf, String> {
    build_target(app, "linux", ["--example", &linux_name(app)], folder)
}

/// Builds the program that runs DAG files in virtual time.
///
/// # Errors
///
/// Cargo failed.
pub(crate) fn build_host() -> Result<PathBuf, String> {
    build_target("dag-file", "linux", ["--example", "dag-file-host"], None)
}

/// The profile of the page's engine, whose target is neither this computer nor the bare machine.
pub(crate) const PAGE_PROFILE: &str = "page";

/// Compiler flags beyond the profile's, to make images small. Addresses are constants, since the
/// linker script fixes them; loops are not padded; jump tables need at least eight cases.
const FOR_IMAGES: [&str; 4] = [
    "--",
    "-Crelocation-model=static",
    "-Cllvm-args=-align-loops=1",
    "-Cllvm-args=-min-jump-table-entries=8",
];

/// Builds one target of a package by a profile; `target` is its kind and name, in cargo's notation.
///
/// # Errors
///
/// Cargo failed, or the package has no such target.
pub fn build_target(
    package: &str,
    profile: &str,
    target: [&str; 2],
    folder: Option<&Path>,
) -> Result<PathBuf, String> {
    let [kind, name] = target;
    let (verb, flags) = match kind {
        _ if profile == PAGE_PROFILE => ("build", &["--target", WASM_TARGET][..]),
        // Only `cargo rustc` takes flags for the last crate alone.
        "--bin" => ("rustc", &FOR_IMAGES[..]),
        // Only the default features bring the kernel, for which such a program has no use.
        _ if name.ends_with("-host") => ("build", &["--no-default-features"][..]),
        _ => ("build", &[][..]),
    };
    let failed = |why: &str| format!("cannot build `{name}`: {why}");
    let mut command = system::cargo();
    folder.map(|folder| command.current_dir(folder));
    command.args([verb, "--profile", profile, "--quiet", "-p", package]);
    command.args(target);
    command.arg("--message-format=json-render-diagnostics");
    command.args(flags);
    say_if_cargo_waits(profile);
    let _lasting = ProgressNote::new(&format!("building `{package}`"));
    let (messages, ended) = system::messages_of(&mut command);
    ended.map_err(|why| failed(&why))?;
    let mut paths = messages.iter().filter_map(|it| executable(it, name));
    let path = paths.next_back();
    path.ok_or_else(|| failed("cargo built no binary of that name"))
}

/// Reports on standard error if another command is building images: cargo would wait silently.
fn say_if_cargo_waits(profile: &str) {
    let target = env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
    let folder = system::workspace().join(target).join(profile);
    if is_locked(&folder.join(".cargo-lock")) {
        let folder = folder.display();
        eprintln!("waiting for another command, which builds in {folder}");
    }
}

fn is_locked(file: &Path) -> bool {
    // Without the file no process can hold the lock.
    let locked = File::open(file).map(|file| file.try_lock_shared());
    matches!(locked, Ok(Err(TryLockError::WouldBlock)))
}

/// Returns the executable announced by one of cargo's messages, if it is the wanted target.
fn executable(message: &Value, package: &str) -> Option<PathBuf> {
    let name = message.at(&["target", "name"]).and_then(Value::as_text)?;
    let path = message.get("executable").and_then(Value::as_text)?;
    (name == package).then(|| path.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use views::json;

    #[test]
    fn an_unknown_app_is_named_with_those_there_are() {
        assert_eq!(check_app("fork-join"), Ok(()));
        let text = check_app("fork-jion").expect_err("there is no such app");
        let begins = text.starts_with("no app `fork-jion`; there are: ");
        let ends = text.ends_with("; did you mean `fork-join`?");
        assert!(begins && ends, "{text}");
    }

    #[test]
    fn a_build_by_others_is_seen_by_its_lock() {
        let path = crate::system::new_log("lock").unwrap();
        assert!(!is_locked(&path));
        let file = File::create(&path).unwrap();
        assert!(!is_locked(&path));
        file.lock().unwrap();
        assert!(is_locked(&path));
        drop(file);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn cargo_says_where_the_image_lies() {
        let message = r#"{"reason":"compiler-artifact","target":{"name":"a"},"executable":"/x/a"}"#;
        let message = json::parse(message).unwrap();
        assert_eq!(executable(&message, "a"), Some(PathBuf::from("/x/a")));
        assert_eq!(executable(&message, "b"), None);
    }
}
