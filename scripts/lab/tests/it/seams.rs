//! The changes that pages show: all diffs apply to one copy of the tree, and their tests pass there.
//!
//! A diff is an example, with tests on the host called `shown_...`: in `tests/seams` of each kind of
//! change, in `docs/policy-lab` of policies, which stand upon the example of a policy.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tool::system;

/// The test programs of the packages that the diffs change.
const TESTS: [&str; 2] = ["-p kernel -p lab -p sched-dag --lib", "-p fass --test it"];

/// Settings that compile them soonest; they compute next to nothing.
const PROFILE: [&str; 4] = [
    "codegen-units=1",
    "debug-assertions=false",
    "overflow-checks=false",
    "package.recording.opt-level=0",
];

/// The folders of diffs in the order of application, each with its page, and the most lines of a diff.
const FOLDERS: [(&str, &str, usize); 2] = [
    ("tests/seams", "CONTRIBUTING.md", usize::MAX),
    ("docs/policy-lab", "docs/policy-lab.md", 60),
];

/// The beginning of the names of the diffs' tests.
const SHOWN: &str = "shown_";

#[test]
fn each_change_that_a_page_shows_applies_and_works() {
    let folder = system::workspace().join("target/seams");
    let tree = folder.join("tree");
    copy(system::workspace(), &tree);
    let mut expected = Vec::new();
    for (diffs, page, most_lines) in FOLDERS {
        let shown = fs::read_to_string(tree.join(page)).expect("the page");
        let entries = fs::read_dir(tree.join(diffs)).expect("the diffs");
        let paths = entries.map(|entry| entry.expect("a diff").path());
        let mut paths: Vec<PathBuf> = paths.collect();
        paths.sort();
        for path in paths {
            let file = path.file_name().expect("a name").display().to_string();
            let is_shown = shown.contains(&format!("/{file})"));
            assert!(is_shown, "{page} does not show {diffs}/{file}; add it");
            // The copy is no part of the repository around it, in which nothing is to change.
            let mut git = Command::new("git");
            git.args(["apply", "-C1"]).arg(&path);
            git.env("GIT_CEILING_DIRECTORIES", &folder);
            if let Err(why) = output(git.current_dir(&tree)) {
                panic!(
                    "{diffs}/{file} does not apply any more; make its change by hand, see that it \
                     is still as short as {page} says, and write it anew by `git diff -U1`:\n{why}"
                );
            }
            let diff = fs::read_to_string(&path).expect("a text");
            let count = diff.lines().count();
            assert!(count <= most_lines, "{diffs}/{file} has {count} lines");
            let lines = diff.lines().filter(|line| line.starts_with('+'));
            let tests = lines.filter_map(|line| line.split_once("fn ")?.1.strip_suffix("() {"));
            let tests = tests.filter(|test| test.starts_with(SHOWN));
            let tests: Vec<String> = tests.map(String::from).collect();
            let has_test = !tests.is_empty();
            assert!(
                has_test,
                "{diffs}/{file} has no test called {SHOWN}..; add one"
            );
            expected.extend(tests);
        }
    }
    let said: String = TESTS.map(|words| run(words, &tree)).concat();
    for test in expected {
        let has_passed = said.contains(&format!("{test} ... ok"));
        assert!(has_passed, "{test} has not run:\n{said}");
    }
}

/// Runs tests of the diffs, and returns what they say.
fn run(words: &str, tree: &Path) -> String {
    let mut cargo = system::cargo();
    cargo.args(["test", "--profile", "tool"]);
    for setting in PROFILE {
        cargo.args(["--config", &format!("profile.tool.{setting}")]);
    }
    cargo.args(words.split(' ')).arg(SHOWN);
    // In a folder of their own: cargo would take what is compiled of the copy for the tree's.
    cargo.env("CARGO_TARGET_DIR", tree.with_file_name("target"));
    cargo
        .env("CARGO_INCREMENTAL", "0")
        .env_remove("TOOL_WORKSPACE");
    output(cargo.current_dir(tree)).unwrap_or_else(|why| panic!("{why}"))
}

/// Returns the standard output of a command.
///
/// # Errors
///
/// It failed; all that it said.
fn output(command: &mut Command) -> Result<String, String> {
    let output = command.output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    match output.status.success() {
        true => Ok(said),
        false => Err(said + &String::from_utf8_lossy(&output.stderr)),
    }
}

/// Makes a new copy of the tree.
fn copy(root: &Path, tree: &Path) {
    // What a run before has left, if there was one.
    let _ = fs::remove_dir_all(tree);
    let mut git = Command::new("git");
    git.args(["ls-files", "-co", "--exclude-standard"]);
    let files = output(git.current_dir(root)).unwrap_or_else(|why| panic!("{why}"));
    for file in files.lines().filter(|file| root.join(file).is_file()) {
        let to = tree.join(file);
        fs::create_dir_all(to.parent().expect("a folder")).expect("a folder");
        fs::copy(root.join(file), to).expect("a copy");
    }
}
