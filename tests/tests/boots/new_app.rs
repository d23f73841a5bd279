//! A new app as a person gets it, in a repository of its own and under `apps/`: it passes its own
//! test and the linters, boots, prints the guide's output, and learns of anything its repository
//! lacks. The README's first app does the same for a reader of the README.
//!
//! All apps share a target folder and the profiles of a new repository, so each crate is compiled
//! once; the folder stays from one run of this test to the next. An app's image is there under the
//! app's name, so booting apps need different names.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use harness::guide::{documented_output, without_numbers};
use harness::markdown::{blocks, page};
use lab::golden;
use tool::new_app::{self, CrateSource};
use tool::system::{self, workspace};

/// The guide's app.
const NAME: &str = "first-steps";

/// Returns our folder, emptied except for `target`.
fn ours() -> &'static Path {
    static OURS: OnceLock<PathBuf> = OnceLock::new();
    OURS.get_or_init(|| {
        let ours = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-app");
        fs::create_dir_all(&ours).expect("a folder of ours");
        for entry in fs::read_dir(&ours).expect("it is there").flatten() {
            if entry.path().is_dir() && entry.file_name() != "target" {
                fs::remove_dir_all(entry.path()).expect("it is ours");
            }
        }
        ours
    })
}

/// Makes an app in a repository of its own, and returns the folder.
fn repository(name: &str) -> PathBuf {
    let out = ours().join(name);
    new_app::create_repository(&out, name, CrateSource::Folder(workspace()))
        .expect("the name is free");
    share_target(&out);
    out
}

/// Makes all builds in a folder land in our target folder, whoever builds there.
fn share_target(folder: &Path) {
    let target = ours().join("target");
    fs::create_dir_all(&target).expect("a folder of ours");
    symlink(target, folder.join("target")).expect("there is none yet");
}

/// Runs cargo in a folder, and returns its exit code, its output, and its complaints.
fn try_cargo(folder: &Path, words: &str) -> (Option<i32>, String, String) {
    let (command, options) = words.split_once(' ').unwrap_or((words, ""));
    let output = system::cargo()
        .current_dir(folder)
        .args([command, "--offline"])
        .args(options.split_whitespace())
        .output()
        .expect("cargo can be started");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let code = output.status.code();
    (code, text(&output.stdout), text(&output.stderr))
}

/// Runs cargo in a folder, where cargo must succeed, and returns the output.
#[track_caller]
fn cargo(folder: &Path, words: &str) -> String {
    let (code, printed, complaints) = try_cargo(folder, words);
    assert_eq!(code, Some(0), "cargo {words}:\n{complaints}");
    printed
}

/// Runs cargo in a folder, where cargo must end with the exit code `code` and print `says`.
#[track_caller]
fn cargo_refuses(folder: &Path, words: &str, code: i32, says: &str) {
    let (found, printed, complaints) = try_cargo(folder, words);
    let said = printed + &complaints;
    assert_eq!(found, Some(code), "cargo {words}:\n{said}");
    assert!(said.contains(says), "cargo {words}:\n{said}");
}

/// Boots the app of a repository as a person does.
fn boot(repository: &Path) -> String {
    cargo(repository, "run -- --cores 2 --mode deterministic")
}

/// Cargo's line about the test of each new app, when the test passes.
const PASSES: &str = "test every_job_is_in_time_and_within_its_bound ... ok";

/// Returns an excerpt of an output. A line of `kept` stays if the output still has an equal line;
/// otherwise the output's line with the longest common beginning replaces it. Lines are equal if
/// `shown` makes the same text of both.
fn excerpt(kept: &str, output: &str, shown: impl Fn(&str) -> String) -> String {
    let common = |a: &str, b: &str| a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count();
    let line = |kept| {
        let is_said = output.lines().any(|line| shown(line) == shown(kept));
        let nearest = output.lines().max_by_key(|line| common(line, kept));
        format!("{}\n", nearest.filter(|_| !is_said).unwrap_or(kept))
    };
    kept.lines().map(line).collect()
}

#[test]
fn in_a_repository_of_its_own_it_passes_its_test_and_boots_and_says_what_the_guide_shows() {
    let app = repository(NAME);
    let said = cargo(&app, "test");
    assert!(said.contains(PASSES), "{said}");

    let said = boot(&app);
    let documented = documented_output("new-app");
    // The bound does not depend on the kernel's speed, so it is exact.
    let shown = |line: &str| match line.contains("takes at most") {
        true => line.into(),
        false => without_numbers(line),
    };
    let (below, now) = (
        "```text output-new-app\n",
        excerpt(&documented, &said, shown),
    );
    golden::assert_is("docs/guide.md", below, &documented, &now);

    // The same lines on Linux, whatever it takes there. Without preemption the bound is another.
    let said = cargo(&app, "run --quiet -- --on linux --jobs 20");
    for part in [
        "takes at most",
        "20 jobs complete, ",
        "{\"kind\":\"verdict\",\"status\":\"success\"}\n",
    ] {
        assert!(said.contains(part), "{said}");
    }

    // Started on the host by mistake, the image says what to do.
    let image = ours().join("target/debug").join(NAME);
    let output = Command::new(image).output().expect("the host loads it");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.ends_with("boot it by `./scripts/boot FILE`, or by `fass-tool boot FILE`\n"));
}

#[test]
fn its_report_is_of_all_jobs_also_of_those_whose_events_are_gone() {
    let app = repository("long-run");
    let library = app.join("src/lib.rs");
    let text = fs::read_to_string(&library).expect("the new app's");
    // The first of a hundred jobs is the longest.
    let first = text.replace("work(800)", "work(if distance == 100 { 900 } else { 100 })");
    assert_ne!(first, text);
    fs::write(&library, first).expect("it is ours");
    let words = "run -- --cores 2 --mode deterministic --append trace_events=200";
    let said = cargo(&app, words);
    let line = said.lines().find(|line| line.contains("response time: "));
    let line = line.expect("the app reports").replace("4.9", "LONG");
    assert!(
        line.contains("median 4.") && line.contains("at most LONG"),
        "{said}"
    );
}

#[test]
fn in_its_repository_a_run_is_recorded_and_replayed_and_advice_is_for_there() {
    let app = repository("replayed");
    let file = app.join("run.rec").display().to_string();
    let record = format!("run -- --mode deterministic --keep {file}");
    cargo(&app, &record);
    let there = app.join("linux.rec").display().to_string();
    let said = cargo(&app, &format!("run -- --on linux --keep {there}"));
    assert!(said.contains("on Linux, "), "{said}");
    // What either has recorded, the other repeats.
    for (place, file) in [("--on linux", &file), ("--mode deterministic", &there)] {
        let said = cargo(&app, &format!("run -- {place} --replay {file}"));
        let replayed = "\"kind\":\"replayed\",\"compared\":0,\"uncompared\":0";
        assert!(said.contains(replayed), "{place}: {said}");
    }
    let replay = format!("run --profile linux --example replay -- {file}");
    let said = cargo(&app, &replay);
    assert_eq!(said, "0 values are compared: nothing differs\n");
    let said = cargo(&app, &format!("{replay} --until replayed/17"));
    assert!(said.contains("    gives `distance`: 82\n"), "{said}");

    let library = app.join("src/lib.rs");
    let text = fs::read_to_string(&library).expect("the new app's");
    let careless = text.replace("force > 80", "force > 81");
    assert_ne!(careless, text);
    fs::write(&library, careless).expect("it is ours");
    for (words, code, says) in [
        ("", 1, "`cargo run --profile linux --example replay -- "),
        (" --prove --seeds 2", 1, "leave `--seeds` out"),
    ] {
        let words = format!("run -- --mode deterministic{words}");
        cargo_refuses(&app, &words, code, says);
    }
}

#[test]
fn what_its_repository_lacks_is_named_with_the_remedy() {
    let app = repository("brake-assist");
    for (file, line, command, remedy) in [
        (
            "src/main.rs",
            "#![no_std]",
            "check",
            "lacks `#![no_std]`; write it above all items",
        ),
        (
            "src/main.rs",
            "#![no_main]",
            "check",
            "lacks `#![no_main]`; write it above all items",
        ),
        (
            "build.rs",
            "boot_link::link_image();",
            "check",
            "let `build.rs` call `boot_link::link_image()`",
        ),
        (
            "Cargo.toml",
            "\ntest = false",
            "check --all-targets",
            "write `test = false` below `[[bin]]`",
        ),
        (
            "Cargo.toml",
            "[profile.dev]\npanic = \"abort\"\n",
            "check",
            "write `panic = \"abort\"` below `[profile.dev]`",
        ),
    ] {
        let path = app.join(file);
        let whole = fs::read_to_string(&path).expect("it is there");
        assert!(whole.contains(line), "{file} has no `{line}`");
        fs::write(&path, whole.replace(line, "")).expect("it is ours");
        cargo_refuses(&app, command, 101, remedy);
        fs::write(&path, whole).expect("it is ours");
    }
}

#[test]
fn the_linters_are_content_with_a_new_app_wherever_it_is() {
    let of_its_own = repository("linted");
    let clippy = "clippy --all-targets -- -D warnings";
    cargo(&of_its_own, clippy);

    // A workspace that has our crates and no app but the new one, so that nothing is copied.
    let manifest = page("Cargo.toml");
    let (manifest, _) = manifest.split_once("[profile.dev]").expect("the profiles");
    let (_, manifest) = manifest.split_once("\n]\n").expect("the members");
    let paths = format!("path = \"{}/", workspace().display());
    let profiles = fs::read_to_string(of_its_own.join("Cargo.toml")).expect("the new app's");
    let (_, profiles) = profiles.split_once("[profile.dev]").expect("the profiles");
    let manifest = format!(
        "[workspace]\nresolver = \"3\"\nmembers = [\"apps/*\"]\n{}\n[profile.dev]{profiles}",
        manifest.replace("path = \"", &paths)
    );
    let small = ours().join("small");
    fs::create_dir_all(&small).expect("a folder of ours");
    fs::write(small.join("Cargo.toml"), manifest).expect("it is ours");
    let app = new_app::create(&small, NAME).expect("the name is free");
    assert_eq!(app, small.join("apps").join(NAME));
    share_target(&small);
    cargo(&app, clippy);
    let format = system::cargo()
        .current_dir(&app)
        .args(["fmt", "--check"])
        .status();
    assert!(format.expect("cargo can be started").success());
}

#[test]
fn the_readmes_first_app_is_the_one_that_its_test_runs_and_that_boots() {
    let readme = page("README.md");
    let blocks = blocks(&readme);
    let code = blocks.iter().find(|block| block.info.starts_with("rust"));
    let code = &code.expect("the app's code").text;
    let place = "`src/lib.rs`. Keep everything up to `#![forbid(unsafe_code)]`";
    assert!(readme.contains(place), "the README puts it elsewhere");
    let app = repository("vision");
    let library = app.join("src/lib.rs");
    let template = fs::read_to_string(&library).expect("the new app's");
    let (head, _) = template
        .split_once("#![forbid(unsafe_code)]\n")
        .expect("the place that the README names");
    let put = |code: &str| {
        let text = format!("{head}#![forbid(unsafe_code)]\n\n{code}");
        fs::write(&library, text).expect("it is ours");
    };

    // A mistake in the DAG is one that the app's test sees: it runs this very DAG.
    let wrong = code.replace("frame * 100", "frame * 101");
    assert_ne!(&wrong, code);
    put(&wrong);
    cargo_refuses(&app, "test", 101, "assertion `left == right` failed");

    put(code);
    let said = cargo(&app, "test");
    assert!(said.contains(PASSES), "{said}");
    let shown = (blocks.iter().map(|block| &block.text))
        .find(|text| text.contains("vision: "))
        .expect("what the app says");
    let now = excerpt(shown, &boot(&app), str::to_string);
    golden::assert_is("README.md", place, shown, &now);
}

#[test]
fn the_driver_of_the_page_answers_by_messages_and_copies_repeat() {
    let page = page("docs/driver.md");
    let blocks = blocks(&page);
    let code = blocks.iter().filter(|block| block.info == "rust");
    let code: Vec<&str> = code.map(|block| &*block.text).collect();
    let app = repository("edu");
    fs::write(app.join("src/main.rs"), code.join("\n")).expect("it is ours");
    // As the page says, for the linters look at all of the app.
    fs::remove_file(app.join("examples/edu-linux.rs")).expect("the new app has it");
    cargo(&app, "clippy --all-targets -- -D warnings");

    let said = cargo(&app, "run --quiet -- --device edu --mode threads");
    let shown = blocks.iter().find(|block| block.info == "console");
    let shown = &shown.expect("the commands").text;
    let shown: Vec<&str> = shown
        .lines()
        .filter(|line| !line.starts_with('$'))
        .collect();
    assert_eq!(shown.len(), 3);
    assert!(said.contains(&shown.join("\n")), "{said}");

    let copy = "run --quiet -- --quiet --device edu --mode deterministic --append work=copy";
    let said = cargo(&app, copy);
    assert!(said.contains("4: Ok(4)\n5: Ok(5)\n6: Ok(6)\n"), "{said}");
    assert_eq!(cargo(&app, copy), said);
}
