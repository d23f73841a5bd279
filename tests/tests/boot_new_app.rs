//! A new app as a person gets it: made in a copy of the workspace, it passes its
//! own test and the linters, boots, and says what the guide shows. So does the README's
//! first app, when the README is followed.
//!
//! The copy and its target folder stay from one run of this test to the next, and
//! only files that have changed are written, so that only the first run compiles
//! everything.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::OnceLock;

use harness::Guest;
use harness::guide::{documented_output, without_numbers};
use tool::markdown::blocks;
use tool::system::{self, workspace};
use tool::{Outcome, new_app};

/// The guide's app.
const NAME: &str = "first-steps";

/// The README's app.
const README_NAME: &str = "vision";

/// Makes the apps in the copy, once, and returns the copy's folder.
fn copy() -> &'static Path {
    static COPY: OnceLock<PathBuf> = OnceLock::new();
    COPY.get_or_init(|| {
        let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-app");
        let apps = [NAME, README_NAME].map(|name| (name, copy.join("apps").join(name)));
        for (_, app) in &apps {
            if app.exists() {
                fs::remove_dir_all(app).expect("the copy is ours");
            }
        }
        synchronize(workspace(), &copy);
        for (name, app) in apps {
            let made = new_app::create(&copy, name).expect("the name is free");
            assert_eq!(made, app);
        }
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
        // Somebody may have followed the guide or the README already.
        let is_theirs = [NAME, README_NAME].map(|app| workspace().join("apps").join(app));
        let is_theirs = is_theirs.contains(&path);
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

/// Runs cargo in the copy, where it must succeed.
fn cargo(words: &str) -> Output {
    let output = try_cargo(words);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {words}:\n{said}");
    output
}

fn try_cargo(words: &str) -> Output {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-app-target");
    system::cargo()
        .current_dir(copy())
        .env("CARGO_TARGET_DIR", target)
        .args(words.split(' '))
        .output()
        .expect("cargo can be started")
}

/// Builds an app's image in the copy and boots it.
fn boot(name: &str) -> Outcome {
    cargo(&format!(
        "build --offline --quiet --release --package {name} --bin {name}"
    ));
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-app-target");
    let image = target.join("release").join(name);
    Guest::new(name).image(&image).cores(2).succeed()
}

/// What cargo says of the test that each new app has, when it passes.
const PASSES: &str = "test every_job_is_in_time_and_within_its_bound ... ok";

#[test]
fn it_passes_its_own_test_and_the_linters() {
    let output = cargo(&format!("test --offline --package {NAME}"));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains(PASSES), "{said}");
    let clippy = format!("clippy --offline --quiet --package {NAME} --all-targets");
    cargo(&format!("{clippy} -- -D warnings"));
    cargo(&format!("fmt --package {NAME} --check"));
}

#[test]
fn it_boots_and_says_what_the_guide_shows() {
    let outcome = boot(NAME);
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
fn the_readmes_first_app_is_the_one_that_its_test_runs_and_that_boots() {
    let readme = fs::read_to_string(workspace().join("README.md")).expect("the page");
    let blocks = blocks(&readme);
    let code = blocks.iter().find(|block| block.info.starts_with("rust"));
    let code = &code.expect("the app's code").text;
    let place = "`apps/vision/src/lib.rs`, in place of what follows\n`#![forbid(unsafe_code)]`";
    assert!(readme.contains(place), "the README puts it elsewhere");
    let library = copy().join("apps").join(README_NAME).join("src/lib.rs");
    let template = fs::read_to_string(&library).expect("the new app's");
    let (head, _) = template
        .split_once("#![forbid(unsafe_code)]\n")
        .expect("the place that the README names");
    let put = |code: &str| {
        let text = format!("{head}#![forbid(unsafe_code)]\n\n{code}");
        fs::write(&library, text).expect("the copy is ours");
    };
    let test = format!("test --offline --package {README_NAME}");

    // A mistake in the DAG is one that the app's test sees: it runs this very DAG.
    let wrong = code.replace("frame * 100", "frame * 101");
    assert_ne!(&wrong, code);
    put(&wrong);
    let output = try_cargo(&test);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(!output.status.success(), "{said}");
    assert!(said.contains("assertion `left == right` failed"), "{said}");

    put(code);
    let said = String::from_utf8_lossy(&cargo(&test).stdout).into_owned();
    assert!(said.contains(PASSES), "{said}");
    let shown = (blocks.iter().map(|block| &block.text))
        .find(|text| text.contains("vision: "))
        .expect("what the app says");
    let outcome = boot(README_NAME);
    for line in shown.lines() {
        let is_said = outcome.serial.lines().any(|said| said == line);
        assert!(is_said, "`{line}` is not in:\n{}", outcome.serial);
    }
}
