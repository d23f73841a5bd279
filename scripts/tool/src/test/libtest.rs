//! Running libtest binaries and doctests, and reading what they say.
//!
//! Cargo compiles; the binaries are run here, one after the other, so that
//! each has a limit of its own and a name in the report. A binary's output is
//! a file that is followed: its last word is its `test result:` lines, which
//! are summed. Output is shown in full if something failed.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::crates::{self, TestBinary};
use super::tally::Tally;
use crate::child::{Child, Waited, bound_to_us};
use crate::golden;
use crate::system;
use crate::tail::Tail;

/// How long one test binary, or all doctests, may take: what hangs, and not what a busy
/// host makes slow. Each guest has a limit of its own.
const LIMIT: Duration = Duration::from_secs(3600);

/// What shall run.
pub(super) struct Plan {
    /// A part of the names of the tests wanted; `None`: all.
    pub(super) filter: Option<String>,
    /// Leave out guests, images and lints.
    pub(super) quick: bool,
    /// Show every test by name.
    pub(super) verbose: bool,
    /// Whether guests can be booted, or why not.
    pub(super) boots: Result<(), String>,
    /// The list of rewritten files, if what differs is to be rewritten.
    pub(super) blessed: Option<PathBuf>,
}

impl Plan {
    pub(super) fn wants(&self, name: &str) -> bool {
        self.filter
            .as_ref()
            .is_none_or(|filter| name.contains(filter.as_str()))
    }
}

/// Runs the tests of all packages.
pub(super) fn run_all(plan: &Plan, tally: &mut Tally) {
    println!("compiling the tests");
    let start = Instant::now();
    let (binaries, compiled) = crates::compile();
    tally.took("compiling the tests", start.elapsed());
    if let Err(why) = compiled {
        tally.add("all tests compile", Err(why));
    }
    for binary in binaries {
        let name = binary.name();
        let skipped = match &plan.boots {
            _ if !binary.boots_guests() => None,
            _ if plan.quick => Some("left out by --quick".into()),
            Err(why) => Some(why.clone()),
            Ok(()) if has_matches(plan, &binary) => binary.ensure_needs().err(),
            Ok(()) => None,
        };
        match skipped {
            Some(why) if has_matches(plan, &binary) => tally.skip(&name, &why),
            Some(_) => {}
            None => run_binary(plan, &binary, tally),
        }
    }
    if !plan.quick {
        run_doctests(plan, tally);
    }
}

/// Whether a binary that is not run has tests that the filter wants. One that
/// cannot say so counts as if it had.
fn has_matches(plan: &Plan, binary: &TestBinary) -> bool {
    let Some(filter) = &plan.filter else {
        return true;
    };
    let mut command = bound_to_us(&binary.executable);
    let listed = command.args(["--list", "--format=terse"]).arg(filter);
    match listed.stdin(Stdio::null()).stderr(Stdio::null()).output() {
        Ok(output) if output.status.success() => !output.stdout.is_empty(),
        _ => true,
    }
}

fn run_binary(plan: &Plan, binary: &TestBinary, tally: &mut Tally) {
    let mut command = bound_to_us(&binary.executable);
    // As cargo does it: tests run in their package's folder. A tool that they start is
    // called from where they start it, not from where this one was.
    command
        .current_dir(&binary.folder)
        .env("CARGO_MANIFEST_DIR", &binary.folder)
        .env_remove("TOOL_CALLED_IN");
    command.args(&plan.filter);
    run_and_read(plan, &binary.name(), command, tally);
}

fn run_doctests(plan: &Plan, tally: &mut Tally) {
    let mut command = system::cargo();
    // What the kernel on Linux shares with the kernel has examples that name the latter, where
    // they are tested; and `--doc` does not ask whether a library wants its examples tested.
    command.args([
        "test",
        "--quiet",
        "--workspace",
        "--exclude=kernel-on-linux",
        "--doc",
        "--no-fail-fast",
        "--",
    ]);
    // `--quiet` makes libtest quiet too, which would hide the names.
    command.arg("--format=pretty").args(&plan.filter);
    run_and_read(plan, "doctests", command, tally);
}

/// Runs one command and counts what its output says.
fn run_and_read(plan: &Plan, name: &str, mut command: Command, tally: &mut Tally) {
    let ran = system::new_log("test").and_then(|log| {
        let ran = run_logged(plan, &mut command, &log);
        let _ = fs::remove_file(&log);
        ran
    });
    let (waited, output, elapsed) = match ran {
        Ok(ran) => ran,
        Err(why) => return tally.add(name, Err(why)),
    };
    tally.took(name, elapsed);
    let report = Report::read(&output);
    for (test, why) in &report.ignored {
        tally.skip(test, why);
    }
    for test in &report.failed {
        tally.fail(&format!("{name}: {test}"), "see its output above");
    }
    tally.pass(report.passed);

    let died = match waited {
        Waited::Ended(status) if !status.success() && report.failed.is_empty() => {
            Some(format!("ended with {status} although no test failed"))
        }
        Waited::Ended(_) if report.results == 0 => Some("printed no `test result:` line".into()),
        Waited::Ended(_) => None,
        Waited::TimedOut | Waited::GivenUp | Waited::Killed => Some(format!(
            "did not end within {} s and was killed; {}",
            LIMIT.as_secs(),
            system::host_load()
        )),
    };
    if died.is_some() || !report.failed.is_empty() {
        println!("{output}");
    }
    if let Some(why) = died {
        return tally.add(name, Err(why));
    }
    if report.passed > 0 || !report.failed.is_empty() {
        println!(
            "{name}: {} passed, {} failed in {:.1} s",
            report.passed,
            report.failed.len(),
            elapsed.as_secs_f64()
        );
    }
}

fn run_logged(
    plan: &Plan,
    command: &mut Command,
    log: &Path,
) -> Result<(Waited, String, Duration), String> {
    let error = |error| format!("`{}`: {error}", log.display());
    let file = File::options()
        .create(true)
        .append(true)
        .open(log)
        .map_err(error)?;
    let same = file.try_clone().map_err(error)?;
    command.stdin(Stdio::null()).stdout(file).stderr(same);
    command.envs(plan.blessed.iter().map(|list| (golden::BLESSED, list)));
    let program = command.get_program().display().to_string();
    let started = Child::start(command);
    let mut child = started.map_err(|error| format!("cannot start `{program}`: {error}"))?;

    let mut tail = Tail::new(log);
    let mut show = |line: &str| {
        if plan.verbose && line.starts_with("test ") {
            println!("{line}");
        }
    };
    let waited = child.wait(LIMIT, || {
        tail.follow(&mut show);
        true
    });
    tail.finish(&mut show);
    let output = fs::read(log).map_err(error)?;
    let output = String::from_utf8_lossy(&output).into_owned();
    Ok((waited, output, child.elapsed()))
}

/// What libtest's output says.
#[derive(Debug, Default, PartialEq, Eq)]
struct Report {
    passed: u64,
    failed: Vec<String>,
    /// Names and reasons.
    ignored: Vec<(String, String)>,
    /// The number of `test result:` lines.
    results: usize,
}

impl Report {
    fn read(output: &str) -> Report {
        let mut report = Report::default();
        // A name that stands in the result's count, but in no line of its own.
        let mut unnamed = 0;
        for line in output.lines() {
            if let Some(result) = line.strip_prefix("test result: ") {
                report.results += 1;
                report.passed += count(result, " passed");
                unnamed += count(result, " failed");
            } else if let Some((name, how)) = test_line(line) {
                match how.split_once(", ") {
                    Some(("ignored", why)) => report.ignored.push((name.into(), why.into())),
                    _ if how == "ignored" => {
                        report.ignored.push((name.into(), "marked `ignore`".into()));
                    }
                    _ if how.starts_with("FAILED") => report.failed.push(name.into()),
                    _ => {}
                }
            }
        }
        let named = u64::try_from(report.failed.len()).unwrap_or(u64::MAX);
        for _ in named..unnamed {
            report
                .failed
                .push("a test without a line of its own".into());
        }
        report
    }
}

/// Reads `test NAME ... HOW`.
fn test_line(line: &str) -> Option<(&str, &str)> {
    line.strip_prefix("test ")?.split_once(" ... ")
}

/// Reads the number before a word in `ok. 3 passed; 0 failed; ...`.
fn count(result: &str, word: &str) -> u64 {
    let parts = result.split([';', '.']).map(str::trim);
    let numbers = parts.filter_map(|part| part.strip_suffix(word)?.parse::<u64>().ok());
    numbers.sum()
}

#[cfg(test)]
mod tests {
    use super::Report;

    const SAID: &str = "\
running 4 tests
test a::one ... ok
test a::two ... ignored, waits for two
test a::three ... ignored
test a::four ... FAILED

test result: FAILED. 1 passed; 1 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.1s

test result: ok. 40 passed; 0 failed; 0 ignored; 0 measured; 9 filtered out; finished in 0.00s
";

    #[test]
    fn results_are_summed_and_names_kept() {
        let report = Report::read(SAID);
        let ignored = [("a::two", "waits for two"), ("a::three", "marked `ignore`")];
        let ignored = ignored.map(|(name, why)| (name.into(), why.into()));
        assert_eq!((report.passed, report.results), (41, 2));
        assert_eq!(
            (report.failed, report.ignored),
            (vec!["a::four".into()], ignored.into())
        );
        // A failure without a line counts, too.
        let report = Report::read("test result: FAILED. 0 passed; 2 failed; 0 ignored\n");
        assert_eq!(report.failed.len(), 2);
        assert_eq!(Report::read("thread panicked\n"), Report::default());
    }
}
