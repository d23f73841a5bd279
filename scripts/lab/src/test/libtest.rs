//! The tests of all packages: compiled by cargo, run here, counted by libtest's output.
//!
//! The binaries are run here, two at a time, so that each has a limit of its own and a name in the
//! report, and guests are booted only where they can be. A binary's last word is its `test
//! result:` lines, which are summed. Output is shown in full if something failed.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::thread;
use std::time::Duration;

use super::{CheckFailure, Tally, TestPlan};
use crate::golden;
use tool::child::{Child, Waited, bound_to_us};
use tool::install::{self, Need};
use tool::json::Value;
use tool::progress::Lasting;
use tool::system;

/// The limit for one test binary, or for all doctests: for tests that hang, far beyond a busy
/// host's delays. Each guest has a limit of its own.
const LIMIT: Duration = Duration::from_secs(3600);

/// The number of test binaries that run at a time. Many tests wait, for a guest or for the time of
/// a job, while another can compute.
const AT_ONCE: usize = 2;

/// The integration test of a package that boots guests; no other does.
const BOOTS: &str = "boots";

/// The programs that modules of boot tests need besides QEMU.
const NEEDS: [(&str, &[&Need]); 4] = [
    ("debugger::", &[&install::GDB]),
    ("on_screen::", &[&install::GRUB, &install::OVMF]),
    ("by_grub::", &[&install::GRUB, &install::OVMF]),
    ("in_bochs::", &[&install::GRUB, &install::BOCHS]),
];

/// A compiled libtest binary.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct TestBinary {
    /// The package's folder.
    folder: PathBuf,
    /// The target: the library's or the integration test's name.
    target: String,
    executable: PathBuf,
}

/// The test binaries, and whether all have compiled.
pub(super) type Compiled = (Vec<TestBinary>, Result<(), String>);

/// Runs the tests of all packages.
pub(super) fn run_all(plan: &TestPlan, (binaries, compiled): Compiled, tally: &mut Tally) {
    if let Err(why) = compiled {
        tally.run("all tests compile", || Err(why.into()));
    }
    // What they need is installed before, by one package manager at a time.
    let prepare = |binary: TestBinary| Some((binary.name(), binary.prepare(plan, tally)?));
    let prepared: Vec<_> = binaries.into_iter().filter_map(prepare).collect();
    let queue = Mutex::new(prepared.into_iter());
    let take = || queue.lock().ok()?.next();
    let lane = || {
        let mut tally = Tally::default();
        while let Some((name, command)) = take() {
            run(plan, &name, command, &mut tally);
        }
        tally
    };
    thread::scope(|scope| {
        for lane in [(); AT_ONCE].map(|()| scope.spawn(lane)) {
            match lane.join() {
                Ok(of_lane) => tally.add(of_lane),
                Err(_) => tally.fail("the tests", "a thread that runs them panicked"),
            }
        }
    });
    // Doctests need cargo to compile each, which is not quick.
    if !plan.quick {
        run(plan, "doctests", doctests(plan), tally);
    }
}

/// Compiles the tests of all packages. Cargo's errors go to standard error.
pub(super) fn compile() -> Compiled {
    println!("compiling the tests");
    let _lasting = Lasting::new("compiling the tests");
    let mut command = system::cargo();
    // Examples, which cargo would compile here as well, are built where a test runs them.
    let words = "test --workspace --tests --no-run --no-fail-fast --quiet \
                 --message-format=json-render-diagnostics";
    command.args(words.split_whitespace());
    let (messages, compiled) = system::messages_of(&mut command);
    let mut binaries: Vec<TestBinary> = messages.iter().filter_map(TestBinary::read).collect();
    // Fast ones first: a mistake shows early.
    binaries.sort_by_key(|binary| (binary.boots_guests(), binary.name()));
    (binaries, compiled)
}

impl TestBinary {
    /// Reads one of cargo's messages: the test binary, if it announces one.
    fn read(message: &Value) -> Option<TestBinary> {
        let text = |path: &[&str]| message.at(path).and_then(Value::as_text);
        let is_test = message.at(&["profile", "test"]).and_then(Value::as_bool);
        if is_test != Some(true) {
            return None;
        }
        let target = text(&["target", "name"])?;
        let kind = message.at(&["target", "kind"])?.elements().first()?;
        let target = match kind.as_text()? {
            // The tool's package has a library and a program of the same name.
            "bin" => format!("{target} (program)"),
            _ => target.into(),
        };
        Some(TestBinary {
            folder: PathBuf::from(text(&["manifest_path"])?).parent()?.into(),
            target,
            executable: text(&["executable"])?.into(),
        })
    }

    /// Names it for people: the package's folder and the target.
    fn name(&self) -> String {
        let folder = self.folder.strip_prefix(system::workspace());
        let folder = folder.unwrap_or(&self.folder).display();
        format!("{folder}: {}", self.target)
    }

    /// Reports whether its tests need QEMU; the target's name says so.
    fn boots_guests(&self) -> bool {
        self.target == BOOTS
    }

    /// Returns the command for the wanted tests. As with cargo, tests run in their package's
    /// folder. A tool that they start must resolve paths from there, so `TOOL_CALLED_IN` is unset.
    fn command(&self, plan: &TestPlan) -> Command {
        let mut command = bound_to_us(&self.executable);
        command.current_dir(&self.folder).args(&plan.filter);
        command.env("CARGO_MANIFEST_DIR", &self.folder);
        command.env_remove("TOOL_CALLED_IN");
        command
    }

    /// Returns the command for those of the wanted tests that can run; the others are skipped.
    fn prepare(&self, plan: &TestPlan, tally: &mut Tally) -> Option<Command> {
        let mut command = self.command(plan);
        if !self.boots_guests() {
            return Some(command);
        }
        let (name, tests) = (self.name(), self.wanted(plan)?);
        let obstacle = match plan.quick {
            true => Err("left out by --quick".into()),
            false => plan.boots.clone(),
        };
        // Skipped and counted as such: a guest that cannot boot must not pass silently.
        if let Err(why) = obstacle {
            tally.skip(&name, &why);
            return None;
        }
        for (module, why) in lacking(&tests) {
            tally.skip(&format!("{name}: {module}"), &why);
            command.args(["--skip", module]);
        }
        Some(command)
    }

    /// Lists the wanted tests; `None` if there are none. A program that cannot list them counts as
    /// having some.
    fn wanted(&self, plan: &TestPlan) -> Option<String> {
        let mut listed = self.command(plan);
        listed.args(["--list", "--format=terse"]);
        match listed.stdin(Stdio::null()).stderr(Stdio::null()).output() {
            Ok(output) if output.status.success() => {
                let tests = String::from_utf8_lossy(&output.stdout).into_owned();
                (!tests.is_empty()).then_some(tests)
            }
            _ => Some(String::new()),
        }
    }
}

/// Installs what these tests need besides QEMU. Returns the modules whose needs cannot be met, with
/// the reasons.
fn lacking(tests: &str) -> Vec<(&'static str, String)> {
    let is_there = |module| tests.lines().any(|test| test.starts_with(module));
    let needed = NEEDS.iter().filter(|(module, _)| is_there(*module));
    let lacks = needed.filter_map(|(module, needs)| {
        let had = needs.iter().try_for_each(|need| install::ensure(need));
        had.err().map(|why| (*module, why))
    });
    lacks.collect()
}

/// Returns the command for the examples in the documentation.
fn doctests(plan: &TestPlan) -> Command {
    let mut command = system::cargo();
    // The kernel on Linux shares sources with the kernel; their examples name the latter and are
    // tested there, and `--doc` ignores a library's wish not to test examples. `--quiet` reaches
    // libtest, too, and would hide the names.
    let words = "test --quiet --workspace --exclude=kernel-on-linux --doc --no-fail-fast -- \
                 --format=pretty";
    command.args(words.split_whitespace()).args(&plan.filter);
    command
}

/// Runs one command and counts the results in its output.
pub(super) fn run(plan: &TestPlan, name: &str, command: Command, tally: &mut Tally) {
    let mut report = LibtestReport::default();
    let (waited, elapsed) = match follow(plan, command, &mut report) {
        Ok(ended) => ended,
        Err(why) => return tally.run(name, || Err(why.into())),
    };
    for (test, why) in &report.ignored {
        tally.skip(test, why);
    }
    let failed = report.failed();
    for test in &failed {
        tally.fail(&format!("{name}: {test}"), "see its output above");
    }
    tally.passed += report.passed;

    let died = match waited {
        // A crash, or an exit without the result line, is a failure that no test reports.
        Waited::Ended(status) if !status.success() && failed.is_empty() => {
            Some(format!("ended with {status} although no test failed"))
        }
        Waited::Ended(_) if !report.has_result => Some("printed no `test result:` line".into()),
        Waited::Ended(_) => None,
        Waited::TimedOut | Waited::GivenUp | Waited::Killed => Some(format!(
            "did not end within {} s and was killed; {}",
            LIMIT.as_secs(),
            system::host_load()
        )),
    };
    if died.is_some() || !failed.is_empty() {
        println!("{}", report.output);
    }
    if let Some(why) = died {
        tally.run(name, || Err(CheckFailure::Failed(why)));
    } else if report.passed > 0 || !failed.is_empty() {
        let (passed, failed, seconds) = (report.passed, failed.len(), elapsed.as_secs_f64());
        println!("{name}: {passed} passed, {failed} failed in {seconds:.1} s");
    }
}

/// Runs one command to its end, and reads its output line by line.
fn follow(
    plan: &TestPlan,
    mut command: Command,
    report: &mut LibtestReport,
) -> Result<(Waited, Duration), String> {
    let log = system::new_log("test")?;
    let error = |error| format!("`{}`: {error}", log.display());
    let file = File::create(&log).map_err(error)?;
    let same = file.try_clone().map_err(error)?;
    command.stdin(Stdio::null()).stdout(file).stderr(same);
    command.envs(plan.blessed.iter().map(|list| (golden::BLESSED, list)));
    let program = command.get_program().display().to_string();
    let started = Child::start(&mut command);
    let mut child = started.map_err(|error| format!("cannot start `{program}`: {error}"))?;

    let mut show = |line: &str| {
        if plan.verbose && line.starts_with("test ") {
            println!("{line}");
        }
        report.read_line(line);
    };
    let followed = child.follow(LIMIT, &log, &mut show, None, |_| Some(0));
    // The file is ours; one that cannot be removed harms nothing.
    let _ = fs::remove_file(&log);
    Ok((followed?.waited, child.elapsed()))
}

/// The results in libtest's output.
#[derive(Default)]
struct LibtestReport {
    output: String,
    passed: u64,
    /// The number of failures, and the names of those with a line of their own.
    failures: u64,
    named: Vec<String>,
    /// Names and reasons.
    ignored: Vec<(String, String)>,
    has_result: bool,
}

impl LibtestReport {
    fn read_line(&mut self, line: &str) {
        self.output += line;
        self.output.push('\n');
        if let Some(result) = line.strip_prefix("test result: ") {
            self.has_result = true;
            self.passed += count(result, " passed");
            self.failures += count(result, " failed");
        }
        let test = line.strip_prefix("test ");
        let Some((name, how)) = test.and_then(|test| test.split_once(" ... ")) else {
            return;
        };
        if let Some(why) = how.strip_prefix("ignored") {
            let why = format!("marked `ignore`{why}");
            self.ignored.push((name.into(), why));
        } else if how.starts_with("FAILED") {
            self.named.push(name.into());
        }
    }

    /// Returns the names of the failed tests.
    fn failed(&self) -> Vec<&str> {
        // A test that prints in the middle of its line hides its name; the sum still counts it.
        let unnamed = self.failures.saturating_sub(self.named.len() as u64);
        let unnamed = (0..unnamed).map(|_| "a test without a line of its own");
        self.named
            .iter()
            .map(String::as_str)
            .chain(unnamed)
            .collect()
    }
}

/// Reads the number before a word in `ok. 3 passed; 0 failed; ...`.
fn count(result: &str, word: &str) -> u64 {
    let mut parts = result.split([';', '.']).map(str::trim);
    let number = parts.find_map(|part| part.strip_suffix(word)?.parse().ok());
    number.unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::{LibtestReport, TestBinary};
    use tool::json::parse;

    const SAID: &str = "\
running 4 tests
test a::one ... ok
test a::two ... ignored, waits for two
test a::three ... ignored
test a::four ... FAILED

test result: FAILED. 1 passed; 1 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.1s

test result: ok. 40 passed; 0 failed; 0 ignored; 0 measured; 9 filtered out; finished in 0.00s
";

    fn report(said: &str) -> LibtestReport {
        let mut report = LibtestReport::default();
        said.lines().for_each(|line| report.read_line(line));
        assert_eq!(report.output, said);
        report
    }

    #[test]
    fn results_are_summed_and_names_kept() {
        let said = report(SAID);
        let ignored = [
            ("a::two", "marked `ignore`, waits for two"),
            ("a::three", "marked `ignore`"),
        ];
        let ignored = ignored.map(|(name, why)| (name.into(), why.into()));
        assert!(said.passed == 41 && said.has_result);
        assert_eq!(said.failed(), ["a::four"]);
        assert_eq!(said.ignored, ignored);
        // A failure without a line counts, too.
        let said = report("test result: FAILED. 0 passed; 2 failed; 0 ignored\n");
        assert_eq!(said.failed().len(), 2);
        let said = report("thread panicked\n");
        assert!(said.failed().is_empty() && !said.has_result);
    }

    #[test]
    fn a_message_about_a_test_binary_is_told_from_others() {
        let message = r#"{"reason":"compiler-artifact","manifest_path":"/w/a/Cargo.toml",
            "target":{"kind":["test"],"name":"boots"},
            "profile":{"test":true},"executable":"/w/target/boots-1"}"#;
        let found = TestBinary::read(&parse(message).unwrap()).unwrap();
        assert!(found.name() == "/w/a: boots" && found.boots_guests());
        let of_product = message.replace("true", "false");
        for other in [&of_product, r#"{"reason":"build-finished","success":true}"#] {
            assert_eq!(TestBinary::read(&parse(other).unwrap()), None);
        }
    }
}
