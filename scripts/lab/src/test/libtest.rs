//! The tests of all packages: run by cargo, counted from libtest's output.
//!
//! Two cargo calls run at a time, for the programs booting guests and for all others: while guests
//! boot, other tests compute. `scripts/lab/program`, cargo's runner, names each program and limits
//! its time. A program ends with `test result:` lines; their counts are summed. If something
//! failed, the program's output is shown in full.

use std::fs::{self, File};
use std::mem;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use super::{Tally, TestPlan};
use crate::golden;
use tool::child::{Child, WaitEnd};
use tool::install::{self, HostNeed};
use tool::progress::ProgressNote;
use tool::system;

/// The programs needed by modules of boot tests, besides QEMU.
const NEEDS: [(&str, &[&HostNeed]); 4] = [
    ("debugger::", &[&install::GDB]),
    ("on_screen::", &[&install::GRUB, &install::OVMF]),
    ("by_grub::", &[&install::GRUB, &install::OVMF]),
    ("in_bochs::", &[&install::GRUB, &install::BOCHS]),
];

/// The modules of host tests running the page's engine, each with the program needed.
const OF_PAGE: [(&str, &HostNeed); 2] = [
    ("in_node::", &install::NODE),
    ("in_chromium::", &install::CHROMIUM),
];

/// The modules of host tests for converting YAML, and for asking the checker proven right in Coq.
const CONVERT: &str = "by_convert::";
const PROVEN: &str = "proven::";

/// A function that makes sure of a prerequisite.
type Ensure = fn() -> Result<(), String>;

/// The modules of boot tests with needs beyond programs: a Zenoh router in Python, and the page's
/// engine.
const BY_MORE: [(&str, Ensure); 2] = [
    ("with_router::", || install::python().map(drop)),
    ("live_page::", install::ensure_wasm),
];

/// Compiles the tests of all packages, and returns the names of the wanted boot tests. Cargo's
/// errors go to standard error.
///
/// # Errors
///
/// In words: something did not compile.
pub(super) fn compile(plan: &TestPlan) -> Result<Vec<String>, String> {
    println!("compiling the tests");
    let _lasting = ProgressNote::new("compiling the tests");
    let mut command = programs("--quiet", "boots", plan);
    let listed = system::run(command.arg("--list").stderr(Stdio::inherit()))?;
    let tests = listed.lines().filter(|line| line.ends_with(": test"));
    Ok(tests.map(String::from).collect())
}

/// Runs the tests of all packages; `boots` lists the boot tests.
pub(super) fn run_all(plan: &TestPlan, boots: &[String], tally: &mut Tally) {
    let boots = boot(plan, boots, tally);
    thread::scope(|scope| {
        let booted = scope.spawn(|| {
            let mut tally = Tally::default();
            if let Some(command) = boots {
                run(plan, "tests that boot", command, &mut tally);
            }
            tally
        });
        let mut host = programs("--no-fail-fast", "host", plan);
        for (module, need) in OF_PAGE.into_iter().filter(|(module, _)| plan.wants(module)) {
            let there = install::ensure(need).and_then(|()| install::ensure_wasm());
            leave_out(module, there, &mut host, tally);
        }
        if plan.wants(CONVERT) {
            leave_out(CONVERT, install::ensure_yaml(), &mut host, tally);
        }
        if plan.wants(PROVEN) {
            leave_out(PROVEN, install::ensure(&install::COQ), &mut host, tally);
        }
        run(plan, "tests on the host", host, tally);
        // Cargo compiles each doctest separately, which is not quick.
        if !plan.quick {
            // The kernel on Linux shares sources with the kernel; their examples name the latter
            // and are tested there, and `--doc` ignores a library's wish not to test examples.
            let words = "test --workspace --exclude=kernel-on-linux --doc --no-fail-fast --";
            run(plan, "doctests", cargo(&[], words, plan), tally);
        }
        match booted.join() {
            Ok(booted) => tally.add(booted),
            Err(_) => tally.fail("the tests", "a thread that runs them panicked"),
        }
    });
}

/// Returns a cargo command with the given options and words, for the wanted tests.
fn cargo(options: &[&str], words: &str, plan: &TestPlan) -> Command {
    let mut command = system::cargo();
    let words = words.split_whitespace();
    command.args(options).args(words).args(&plan.filter);
    // A tool started by tests must resolve paths from the tests' folder, not from the caller's.
    command.env_remove("TOOL_CALLED_IN");
    command
}

/// Returns the command for the wanted tests in a kind of program: `boots` or `host`.
fn programs(option: &str, kind: &str, plan: &TestPlan) -> Command {
    // Examples, which cargo would compile without `--tests`, are built where a test runs them.
    let words = format!("test --workspace --tests {option} --");
    let runner = system::workspace().join("scripts/lab/program");
    // An environment variable would also reach the cargo calls made by tests.
    let runner = format!("target.'cfg(unix)'.runner = [{runner:?}, {kind:?}]");
    cargo(&["--config", &runner], &words, plan)
}

/// Returns the command for the tests able to boot their guests; `None` if no test is wanted or none
/// can boot. Tests that cannot boot are counted as skipped: a guest unable to boot must not pass
/// silently.
fn boot(plan: &TestPlan, tests: &[String], tally: &mut Tally) -> Option<Command> {
    let obstacle = match plan.quick {
        true => Err("left out by --quick".into()),
        false => plan.boots.clone(),
    };
    if tests.is_empty() {
        return None;
    } else if let Err(why) = obstacle {
        tally.skip("tests that boot", &why);
        return None;
    }
    let mut command = programs("--no-fail-fast", "boots", plan);
    for (module, needs) in NEEDS {
        // Needs are installed beforehand, as only a single package manager can run at a time.
        let is_wanted = tests.iter().any(|test| test.starts_with(module));
        let mut needs = needs.iter().filter(|_| is_wanted);
        let there = needs.try_for_each(|need| install::ensure(need));
        leave_out(module, there, &mut command, tally);
    }
    for (module, ensure) in BY_MORE {
        if tests.iter().any(|test| test.starts_with(module)) {
            leave_out(module, ensure(), &mut command, tally);
        }
    }
    Some(command)
}

/// Leaves out a module of tests lacking something, and counts the module as skipped.
fn leave_out(module: &str, there: Result<(), String>, command: &mut Command, tally: &mut Tally) {
    if let Err(why) = there {
        tally.skip(module, &why);
        command.args(["--skip", module]);
    }
}

/// Runs a command, and counts the test results in its output.
pub(super) fn run(plan: &TestPlan, name: &str, command: Command, tally: &mut Tally) {
    let before = tally.failures.len();
    let mut program = TestProgram::new(name);
    // Cargo itself prints no result line.
    program.has_result = true;
    let ended = follow(plan, command, &mut |line| {
        let line = line.trim_end();
        if line.starts_with("program: ") || line.starts_with("   Doc-tests ") {
            let name = line.trim_start().trim_start_matches("program: ");
            mem::replace(&mut program, TestProgram::new(name)).finish(tally);
        } else {
            program.read_line(plan.verbose, line, tally);
        }
    });
    program.finish(tally);
    if let Err(why) = ended
        && tally.failures.len() == before
    {
        tally.fail(name, &why);
    }
}

/// Runs a command to its end, and shows its output line by line.
fn follow(plan: &TestPlan, mut command: Command, show: &mut dyn FnMut(&str)) -> Result<(), String> {
    let log = system::new_log("test")?;
    let error = |error| format!("`{}`: {error}", log.display());
    let file = File::create(&log).map_err(error)?;
    command.stderr(file.try_clone().map_err(error)?);
    command.stdin(Stdio::null()).stdout(file);
    command.envs(plan.blessed.iter().map(|list| (golden::BLESSED, list)));
    let mut child = Child::start(&mut command).map_err(error)?;
    // Each program has a limit of its own in the runner; this limit is for doctests, and for cargo
    // itself.
    let limit = Duration::from_secs(4 * 3600);
    match child.follow(limit, &log, show, None, |_| Some(0))?.waited {
        WaitEnd::Ended(status) if status.success() => {
            // Failing to remove our own file harms nothing.
            let _ = fs::remove_file(&log);
            Ok(())
        }
        ended => Err(format!("{ended:?}; its output is in {}", log.display())),
    }
}

/// A test program, and its output so far.
#[derive(Default)]
struct TestProgram {
    name: String,
    output: String,
    /// The last list of names: right before a result, the names of the failed tests.
    listed: Vec<String>,
    has_failed: bool,
    has_result: bool,
}

impl TestProgram {
    fn new(name: &str) -> TestProgram {
        TestProgram {
            name: name.into(),
            ..TestProgram::default()
        }
    }

    fn read_line(&mut self, is_verbose: bool, line: &str, tally: &mut Tally) {
        self.output += line;
        self.output.push('\n');
        if let Some((test, how)) = line
            .strip_prefix("test ")
            .and_then(|it| it.split_once(" ... "))
        {
            if let Some(why) = how.strip_prefix("ignored") {
                tally.skip(test, &format!("marked `ignore`{why}"));
            }
            if is_verbose {
                println!("{line}");
            }
        } else if let Some(name) = line.strip_prefix("    ") {
            self.listed.push(name.into());
        } else if line == "failures:" {
            self.listed.clear();
        } else if let Some(result) = line.strip_prefix("test result: ") {
            let passed = result.split(' ').nth(1).and_then(|it| it.parse().ok());
            tally.passed += passed.unwrap_or(0);
            let is_failure = result.starts_with("FAILED");
            let failed = self.listed.drain(..).filter(|_| is_failure);
            failed.for_each(|it| tally.fail(&format!("{}: {it}", self.name), "see its output"));
            self.has_failed |= is_failure;
            self.has_result = true;
            // With a filter, most programs have no wanted test: their lines would be noise.
            if !result.starts_with("ok. 0 passed") {
                println!("{}: {result}", self.name);
            }
        }
    }

    /// Counts a missing result as a failure, and shows the output if something failed.
    fn finish(self, tally: &mut Tally) {
        if !self.has_result {
            tally.fail(
                &self.name,
                "no line `test result:`, or no end within an hour",
            );
        }
        if self.has_failed || !self.has_result {
            println!("{}", self.output);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Tally, TestProgram};

    const SAID: &str = "\
running 4 tests
test a::one ... ok
test a::two ... ignored, waits for two
test a::three ... ignored
test a::four ... it says this
FAILED

failures:

---- a::four stdout ----
    four
failures:
    a::four

test result: FAILED. 1 passed; 1 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.1s

test result: ok. 40 passed; 0 failed; 0 ignored; 0 measured; 9 filtered out; finished in 0.00s
";

    #[test]
    fn results_are_summed_and_names_kept() {
        let mut tally = Tally::default();
        let mut program = TestProgram::new("p: it");
        SAID.lines()
            .for_each(|line| program.read_line(false, line, &mut tally));
        // Its output is not shown here: it would count for this program's own.
        assert!(program.has_failed && program.has_result);
        let [failed] = &tally.failures[..] else {
            panic!("{tally}");
        };
        assert_eq!(failed, "p: it: a::four: see its output");
        assert_eq!(tally.passed, 41);
        let skips = [
            "a::two: marked `ignore`, waits for two",
            "a::three: marked `ignore`",
        ];
        assert_eq!(tally.skips, skips.map(String::from));
        // A program that dies without its result has failed.
        TestProgram::new("p: it").finish(&mut tally);
        assert_eq!(tally.failures.len(), 2);
    }
}
