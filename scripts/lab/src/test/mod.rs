//! The subcommand `test`: runs and counts every test.
//!
//! A *test* is a libtest test of any package (boot tests, which boot guests, included), a doctest,
//! or a *check*: a named property of the whole tree, such as "clippy has nothing to say". A single
//! tally counts all of them. Its last line is `N passed, M failed`, with `, K skipped` if something
//! could not run; the reasons stand above the line.
//!
//! Nothing passes by not running: a test binary counts as a failure if it does not compile, dies
//! without its result line, or exceeds its time limit.
//!
//! The checks judge the project's own packages. Other apps in the tree must pass their tests, but
//! need not follow the project's rules on lints, format and files. A package accepts the rules by
//! taking the workspace's lints.

mod apart;
mod budgets;
mod checks;
mod layers;
mod libtest;
mod nightly;
mod paths;
mod words;

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread;
use std::time::Instant;

use tool::image::{self, package_name};
use tool::options::{Command, Refusal, ValueKind, options};
use tool::{elf, files, install, system};

/// The options and the help text of `test`.
pub static TEST: Command = Command {
    invocation: "./scripts/test",
    about: "Runs every test, on the host and in QEMU, and counts them.",
    positional: Some((
        ValueKind::Text("FILTER"),
        "Run only tests and checks whose name contains this.",
    )),
    options: OPTIONS,
    notes: "\
The last line is `N passed, M failed`, or `N passed, M failed, K skipped` with
the reasons above it. Each part says when it ends how many seconds it took.

With --bless the files that were rewritten stand there, too; `git diff` shows what
has changed in them. What cannot be rewritten still fails.

exit codes: 0 nothing failed; 1 something failed; 2 a refused command line, or
a FILTER by which nothing has run
",
};

options! {
    /// Only what runs on the host: no guests, no images, no lints.
    QUICK: ValueKind::Nothing;
    /// Rewrite what a change makes wrong: fault texts and outputs in pages, baselines.
    BLESS: ValueKind::Nothing;
    /// Only tests where threads meet, under Miri of a nightly toolchain.
    MIRI: ValueKind::Nothing;
    /// Only runs on threads of Linux, under ThreadSanitizer of a nightly toolchain.
    THREAD_SANITIZER: ValueKind::Nothing;
    /// Show every test by name, not only those that fail.
    VERBOSE 'v': ValueKind::Nothing;
}

/// The tests to run.
struct TestPlan {
    /// A part of the wanted tests' names; `None`: all tests.
    filter: Option<String>,
    /// Leave out guests, images and lints.
    quick: bool,
    /// Show every test by name.
    verbose: bool,
    /// Whether guests can be booted; if not, the reason.
    boots: Result<(), String>,
    /// The list of rewritten files, if goldens are to be rewritten.
    blessed: Option<PathBuf>,
}

impl TestPlan {
    fn wants(&self, name: &str) -> bool {
        let filter = self.filter.as_deref();
        filter.is_none_or(|filter| name.contains(filter))
    }
}

/// Runs the subcommand with the words after its name.
pub fn test(words: &[OsString]) -> ExitCode {
    TEST.carry_out(words, |options| {
        // Before building: a full disk would later show up as a linker error.
        checks::check()?;
        let list = options.is_given(name::BLESS);
        let list = list.then(|| system::new_log("blessed"));
        let plan = TestPlan {
            filter: options.positional().map(String::from),
            quick: options.is_given(name::QUICK),
            verbose: options.is_given(name::VERBOSE),
            boots: install::ensure_qemu(),
            blessed: list.transpose()?,
        };
        let mut tally = Tally::default();
        let plan = &plan;
        let [miri, sanitizer] =
            [name::MIRI, name::THREAD_SANITIZER].map(|word| options.is_given(word));
        if miri {
            nightly::run_miri(plan, &mut tally)?;
        }
        if sanitizer {
            nightly::run_thread_sanitizer(plan, &mut tally)?;
        }
        if !(miri || sanitizer) {
            run_all(plan, &mut tally)?;
        }
        if let Some(list) = &plan.blessed {
            // Without a rewritten file there is no list.
            let files = fs::read_to_string(list).unwrap_or_default();
            tally.blessed = files.lines().map(String::from).collect();
            let _ = fs::remove_file(list);
        }

        // A filter without a match ends in the complaint alone: `0 passed, 0 failed` would look
        // like success.
        if !tally.is_empty() {
            print!("{tally}");
        }
        match complaint(plan.filter.as_deref(), &tally) {
            Some(line) => Err(Refusal::Usage(line)),
            None => Ok(ExitCode::from(u8::from(!tally.failures.is_empty()))),
        }
    })
}

/// Runs all tests and checks.
fn run_all(plan: &TestPlan, tally: &mut Tally) -> Result<(), String> {
    let sources = &sources()[..];
    let panicked = |_| "a thread of the tests panicked".to_string();
    thread::scope(|scope| {
        // Cargo builds images, tests and lints in a folder each, and so at the same time.
        let linted = scope.spawn(move || checks::lint_all(plan, sources));
        let compiled = scope.spawn(move || libtest::compile(plan));
        build_images(plan, sources, tally);
        match compiled.join().map_err(panicked)? {
            Ok(boots) => libtest::run_all(plan, &boots, tally),
            Err(why) => tally.fail("all tests compile", &why),
        }
        checks::run_all(plan, sources, tally);
        tally.add(linted.join().map_err(panicked)?);
        Ok(())
    })
}

/// Returns a complaint if the filter left nothing to run.
fn complaint(filter: Option<&str>, tally: &Tally) -> Option<String> {
    let filter = filter.filter(|_| !tally.has_run())?;
    if tally.is_empty() {
        return Some(format!(
            "no test or check has `{filter}` in its name; give a part of a name, as \
             `./scripts/test --verbose` shows them"
        ));
    }
    Some(format!(
        "all that has `{filter}` in its name was skipped, for the reasons above"
    ))
}

/// Builds the images before their tests boot them: the tests' time limits then need not cover
/// compilation. The image of an app of the project must also be small.
fn build_images(plan: &TestPlan, sources: &[SourceFile], tally: &mut Tally) {
    if plan.quick {
        return;
    }
    let own = packages(sources);
    for app in ["apps", "apps/lab"].into_iter().flat_map(image::apps) {
        let most = own.contains(&app).then_some(image::MOST_STRIPPED_BYTES);
        let name = match most {
            Some(most) => format!("image of {app} weighs at most {} KiB", most >> 10),
            None => format!("image of {app} builds"),
        };
        if plan.wants(&name) {
            tally.run(&name, || Ok(build_image(&app, most.unwrap_or(u64::MAX))?));
        }
    }
}

fn build_image(app: &str, most: u64) -> Result<(), String> {
    let bytes = elf::stripped_bytes(&files::read_at(&image::build(app)?)?)?;
    println!("image of {app}: {bytes} bytes stripped");
    if bytes <= most {
        return Ok(());
    }
    Err(format!("it weighs {bytes} bytes, {most} are allowed"))
}

/// The reason why a check has not passed.
#[derive(Clone, Debug, PartialEq, Eq)]
enum CheckFailure {
    /// The check failed.
    Failed(String),
    /// The check could not run.
    Skipped(String),
}

impl From<String> for CheckFailure {
    fn from(why: String) -> CheckFailure {
        CheckFailure::Failed(why)
    }
}

/// Returns an error listing the faults, if there are any.
fn none_of(faults: Vec<String>) -> Result<(), String> {
    match faults.is_empty() {
        true => Ok(()),
        false => Err(faults.join("; ")),
    }
}

/// A file: its name, relative to the workspace's root, and its text.
#[derive(Debug, PartialEq, Eq)]
struct SourceFile {
    name: String,
    text: String,
}

#[cfg(test)]
mod made {
    /// Makes a file.
    pub(super) fn file(name: &str, text: &str) -> super::SourceFile {
        let [name, text] = [name, text].map(String::from);
        super::SourceFile { name, text }
    }
}

/// Returns all files of the workspace, sorted, except generated files and packages other than the
/// project's own.
fn sources() -> Vec<SourceFile> {
    below(system::workspace())
}

/// Returns the names of the packages containing the given files, sorted.
fn packages(sources: &[SourceFile]) -> Vec<String> {
    let manifests = sources.iter().filter(|it| it.name.ends_with("Cargo.toml"));
    let mut names: Vec<String> = manifests.filter_map(|it| package_name(&it.text)).collect();
    names.sort();
    names
}

fn below(root: &Path) -> Vec<SourceFile> {
    let files = system::files_below(root, |folder| {
        let manifest = fs::read_to_string(folder.join("Cargo.toml"));
        manifest.map_or(true, |text| {
            package_name(&text).is_none() || takes_lints(&text)
        })
    });
    let source = |file: &Path| SourceFile {
        name: file
            .strip_prefix(root)
            .unwrap_or(file)
            .display()
            .to_string(),
        // A file that cannot be read counts as empty, and so lacks its essay.
        text: String::from_utf8_lossy(&fs::read(file).unwrap_or_default()).into_owned(),
    };
    files.iter().map(|file| source(file)).collect()
}

fn takes_lints(manifest: &str) -> bool {
    let lints = manifest.split("\n[lints]").nth(1);
    let lines = lints.into_iter().flat_map(str::lines);
    let mut of_lints = lines.skip(1).take_while(|line| !line.starts_with('['));
    of_lints.any(|line| line.replace(' ', "") == "workspace=true")
}

/// The counts, and the names of failures and skipped tests.
#[derive(Debug, Default)]
struct Tally {
    passed: u64,
    failures: Vec<String>,
    skips: Vec<String>,
    blessed: BTreeSet<String>,
}

impl Tally {
    /// Runs a check, counts it, and prints its result and its time.
    fn run(&mut self, name: &str, check: impl FnOnce() -> Result<(), CheckFailure>) {
        let start = Instant::now();
        let result = check();
        let seconds = start.elapsed().as_secs_f64();
        match result {
            Ok(()) => {
                println!("{name}: ok in {seconds:.1} s");
                self.passed += 1;
            }
            Err(CheckFailure::Failed(why)) => {
                println!("{name}: FAILED: {why}");
                self.fail(name, &why);
            }
            Err(CheckFailure::Skipped(why)) => self.skip(name, &why),
        }
    }

    /// Adds the counts of another tally.
    fn add(&mut self, other: Tally) {
        self.passed += other.passed;
        self.failures.extend(other.failures);
        self.skips.extend(other.skips);
    }

    /// Counts a failure.
    fn fail(&mut self, name: &str, why: &str) {
        // One line for the summary; the whole reason stands above.
        let first = why.lines().next().unwrap_or_default();
        self.failures.push(format!("{name}: {first}"));
    }

    /// Counts something unable to run.
    fn skip(&mut self, name: &str, why: &str) {
        self.skips.push(format!("{name}: {why}"));
    }

    /// Returns whether anything passed or failed, rather than being skipped.
    fn has_run(&self) -> bool {
        self.passed > 0 || !self.failures.is_empty()
    }

    /// Returns whether nothing was counted at all.
    fn is_empty(&self) -> bool {
        !self.has_run() && self.skips.is_empty()
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f)?;
        for skip in &self.skips {
            writeln!(f, "skipped: {skip}")?;
        }
        for failure in &self.failures {
            writeln!(f, "failed: {failure}")?;
        }
        for file in &self.blessed {
            writeln!(f, "blessed: {file}; read `git diff`")?;
        }
        write!(f, "{} passed, {} failed", self.passed, self.failures.len())?;
        match self.skips.len() {
            0 => writeln!(f),
            skipped => writeln!(f, ", {skipped} skipped"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_app_of_ones_own_is_not_judged_and_all_packages_of_the_project_are() {
        let root = std::env::temp_dir().join(format!("own-{}", std::process::id()));
        for (name, lints) in [("ours", "[lints]\nworkspace = true\n"), ("theirs", "")] {
            let folder = root.join("apps").join(name);
            fs::create_dir_all(folder.join("src")).unwrap();
            let manifest = format!("[package]\nname = \"{name}\"\n\n{lints}");
            fs::write(folder.join("Cargo.toml"), manifest).unwrap();
            fs::write(folder.join("src/lib.rs"), "").unwrap();
        }
        let found = below(&root);
        assert_eq!(packages(&found), ["ours"]);
        let names: Vec<&str> = found.iter().map(|source| &*source.name).collect();
        assert_eq!(names, ["apps/ours/Cargo.toml", "apps/ours/src/lib.rs"]);
        fs::remove_dir_all(root).unwrap();

        let packages = packages(&sources());
        let some = "sched-dag fass kernel boot-link tool lab harness fork-join";
        let mut names = some.split(' ');
        let missing = names.find(|name| !packages.iter().any(|own| own == name));
        assert_eq!(missing, None, "{packages:?}");
        let template = include_str!("../../../tool/template/manifest.toml");
        assert!(!super::takes_lints(template));
    }

    #[test]
    fn a_filter_by_which_nothing_has_run_is_named() {
        let mut tally = Tally::default();
        let line = complaint(Some("frob"), &tally).unwrap();
        assert!(line.starts_with("no test or check has `frob` in its name; "));
        tally.skip("a: boots", "left out by --quick");
        let line = complaint(Some("boot"), &tally).unwrap();
        assert!(line.starts_with("all that has `boot` in its name was skipped, "));
        assert_eq!(complaint(None, &tally), None);
        tally.fail("a", "b");
        assert_eq!(complaint(Some("boot"), &tally), None);
    }

    #[test]
    fn the_last_line_counts_and_the_reasons_stand_above() {
        let mut tally = Tally::default();
        assert!(tally.is_empty());
        tally.passed = 12;
        assert!(!tally.is_empty());
        assert_eq!(tally.to_string(), "\n12 passed, 0 failed\n");
        tally.run("a check", || Ok(()));
        tally.run("a::b", || Err("left is not right\nmore".to_string().into()));
        tally.run("c", || {
            Err(CheckFailure::Skipped("there is no /dev/kvm".into()))
        });
        tally.blessed = ["b.md", "a.md"].map(String::from).into();
        let expected = "\nskipped: c: there is no /dev/kvm\nfailed: a::b: left is not right\n\
                        blessed: a.md; read `git diff`\nblessed: b.md; read `git diff`\n\
                        13 passed, 1 failed, 1 skipped\n";
        assert_eq!(tally.to_string(), expected);
    }
}
