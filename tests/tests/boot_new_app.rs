//! A new app as a person gets it: made in a copy of the workspace, it passes its
//! own test and the linters, boots, and says what the guide shows.
//!
//! The copy and its target folder stay from one run of this test to the next, and
//! only files that have changed are written, so that only the first run compiles
//! everything.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use harness::guide::{documented_output, without_numbers};
use harness::system::{self, workspace};
use harness::{Guest, new_app};

const NAME: &str = "first-steps";

/// Makes the app in the copy, once, and returns the copy's folder.
fn copy() -> &'static Path {
    static COPY: OnceLock<PathBuf> = OnceLock::new();
    COPY.get_or_init(|| {
        let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-app");
        let app = copy.join("apps").join(NAME);
        if app.exists() {
            fs::remove_dir_all(&app).expect("the copy is ours");
        }
        synchronize(workspace(), &copy);
        let made = new_app::create(&copy, NAME).expect("the name is free");
        assert_eq!(made, app);
        copy
    })
}

/// Makes one folder's files those of another, and leaves alone what is equal.
fn synchronize(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder of ours");
    for entry in fs::read_dir(to).expect("a folder of ours").flatten() {
        let path = entry.path();
        if from.join(entry.file_name()).exists() {
            continue;
        }
        let removed = match path.is_dir() {
            true => fs::remove_dir_all(&path),
            false => fs::remove_file(&path),
        };
        removed.expect("the copy is ours");
    }
    for entry in fs::read_dir(from).expect("the workspace").flatten() {
        let name = entry.file_name();
        let (path, copied) = (entry.path(), to.join(&name));
        // Somebody may have followed the guide already.
        let is_theirs = path == workspace().join("apps").join(NAME);
        if is_theirs || name == "target" || name.to_string_lossy().starts_with('.') {
            continue;
        }
        if path.is_dir() {
            synchronize(&path, &copied);
        } else if fs::read(&path).ok() != fs::read(&copied).ok() {
            fs::copy(&path, &copied).expect("the copy is ours");
        }
    }
}

/// Runs cargo in the copy.
fn cargo(words: &str) -> Output {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-app-target");
    let output = system::cargo()
        .current_dir(copy())
        .env("CARGO_TARGET_DIR", target)
        .args(words.split(' '))
        .output()
        .expect("cargo can be started");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {words}:\n{said}");
    output
}

#[test]
fn it_passes_its_own_test_and_the_linters() {
    let output = cargo(&format!("test --offline --package {NAME}"));
    let said = String::from_utf8_lossy(&output.stdout);
    let test = "test every_job_is_in_time_and_within_its_bound ... ok";
    assert!(said.contains(test), "{said}");
    let clippy = format!("clippy --offline --quiet --package {NAME} --all-targets");
    cargo(&format!("{clippy} -- -D warnings"));
    cargo(&format!("fmt --package {NAME} --check"));
}

#[test]
fn it_boots_and_says_what_the_guide_shows() {
    cargo(&format!(
        "build --offline --quiet --release --package {NAME} --bin {NAME}"
    ));
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-app-target");
    let image = target.join("release").join(NAME);
    let outcome = Guest::new(NAME).image(&image).cores(2).succeed();
    let documented = documented_output("new-app").expect("the guide shows it");
    // The bound does not depend on the kernel's speed, so it is exact.
    let bound = documented.lines().next().expect("the bound");
    assert!(bound.contains("takes at most"), "{bound}");
    assert!(outcome.serial.lines().any(|line| line == bound), "{bound}");
    let said: Vec<String> = outcome.serial.lines().map(without_numbers).collect();
    for line in documented.lines().map(without_numbers) {
        assert!(
            said.contains(&line),
            "the guide shows `{line}`, the app says:\n{}",
            said.join("\n")
        );
    }
}

#[test]
fn refused_command_lines_are_2_and_help_is_0() {
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
        let output = command.arg("new-app").args(words).output();
        output.expect("the tool can be started")
    };
    let help = run(&["--help"]);
    assert_eq!(help.status.code(), Some(0));
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    assert!(
        help.contains("usage: ./scripts/new-app [NAME] [options]"),
        "{help}"
    );
    for (words, line) in [
        (
            &[][..],
            "new-app: which name? give one, such as `./scripts/new-app brake-assist`\n",
        ),
        (
            &["fork-join"],
            "new-app: there is an app `fork-join` already; choose another name, or edit \
             apps/fork-join\n",
        ),
        (
            &["Fork Join"],
            "new-app: `Fork Join` cannot be an app's name: 'F' is in it; use small letters, digits \
             and hyphens, as in `fork-join`\n",
        ),
        (
            &["one", "two"],
            "new-app: `two`: only one NAME is allowed, and `one` is one\n",
        ),
    ] {
        let output = run(words);
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        assert_eq!(String::from_utf8_lossy(&output.stderr), line);
    }
    assert!(!workspace().join("apps/one").exists());
}
