//! What holds for every command of the tool alike: how it refuses what it does not know,
//! and that it does not mind who reads.

use std::fs;
use std::io::{self, BufRead};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use tool::system::workspace;

/// Every command, by the words that name it.
const COMMANDS: &[&str] = &[
    "run",
    "boot",
    "test",
    "new-app",
    "check-trace",
    "trace",
    "recording",
    "soak",
    "bench",
    "bench hand-off",
    "bench join-latency",
    "bench native",
    "bench sizes",
    "oracle",
    "oracle bounds",
    "oracle responses",
    "oracle schedules",
    "oracle schedules --in-kernel",
    "oracle synchronizer",
];

fn tool(words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.args(words.split(' ')).stdin(Stdio::null());
    command
}

fn output(words: &str) -> Output {
    tool(words).output().expect("the tool can be started")
}

/// Runs the tool with the other ends of both its outputs closed; returns its exit code.
fn code_without_readers(words: &str) -> Option<i32> {
    let closed = || {
        let (reader, writer) = io::pipe().expect("a pipe");
        drop(reader);
        writer
    };
    let mut command = tool(words);
    command.stdout(closed()).stderr(closed());
    let status = command.status().expect("the tool can be started");
    status.code()
}

#[test]
fn an_unknown_option_is_named_and_2() {
    for name in COMMANDS {
        let output = output(&format!("{name} --frobnicate"));
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{name}: {said}");
        assert_eq!(output.stdout, b"", "{name}");
        let words = format!("{name}: unknown option `--frobnicate`; ");
        assert!(said.starts_with(&words), "{said}");
        assert!(said.trim_end().ends_with("--help"), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

#[test]
fn the_nearest_option_or_word_is_suggested() {
    for (words, said) in [
        (
            "run --coers 3",
            "run: unknown option `--coers`; did you mean `--cores`?\n",
        ),
        (
            "oracle schedules --in-kernal",
            "oracle schedules: unknown option `--in-kernal`; did you mean `--in-kernel`?\n",
        ),
        (
            "bench hand-of",
            "bench: unknown WHAT `hand-of`; did you mean `hand-off`?\n",
        ),
        (
            "oracle bound",
            "oracle: unknown KIND `bound`; did you mean `bounds`?\n",
        ),
        (
            "tset",
            "fass-tool: unknown SUBCOMMAND `tset`; did you mean `test`?\n",
        ),
    ] {
        let output = output(words);
        let found = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{found}");
        assert_eq!(found, said);
    }
}

#[test]
fn a_newline_in_a_value_breaks_no_message() {
    for words in [
        "run --set gain\n=",
        "run --set gain=1\n2",
        "run --app fork\njoin",
        "run --dag apps/dag-file/examples/demo.dag --graph a\nb",
        "run --dag apps/dag-file/examples/demo.dag --clusters 1\n1",
        "bench join-latency --policies fass\nexact",
    ] {
        let output = tool(words).current_dir(workspace()).output();
        let output = output.expect("the tool can be started");
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{words}: {said}");
        assert_eq!(said.lines().count(), 1, "{words}: {said}");
        assert!(said.contains("\\n"), "{words}: {said}");
    }
}

#[test]
fn what_is_no_image_is_2_before_anything_boots() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let text = folder.join("image.txt");
    fs::write(&text, "no image").expect("the test's folder takes a file");
    let tool = PathBuf::from(env!("CARGO_BIN_EXE_fass-tool"));
    for (path, why) in [
        (
            &text,
            "is no image: not a 64-bit little-endian ELF file; name what `cargo",
        ),
        (
            &tool,
            "is no image: it has no PVH note, by which QEMU would enter it; name",
        ),
        (&folder, "cannot be read: "),
        (&folder.join("none"), "cannot be read: "),
    ] {
        let output = output(&format!("run --image {}", path.display()));
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{said}");
        let words = format!("run: `--image {}`: {why}", path.display());
        assert!(said.starts_with(&words), "{said}  not: {words}");
    }
}

#[test]
fn that_another_command_builds_is_said_and_help_does_not_wait_for_it() {
    let target = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("locked");
    let folder = target.join("tool");
    let _ = fs::remove_dir_all(&target);
    fs::create_dir_all(&folder).expect("the test's folder takes one");
    let lock = fs::File::create(folder.join(".cargo-lock")).expect("a file in it");
    lock.lock().expect("nobody else has it");
    let run_help = || {
        let mut command = Command::new(workspace().join("scripts/run"));
        command.arg("--help").env("CARGO_TARGET_DIR", &target);
        command.stdin(Stdio::null()).stderr(Stdio::piped());
        command
    };
    let mut child = run_help().stdout(Stdio::null()).spawn();
    let child = child.as_mut().expect("the script can be started");
    let said = child.stderr.take().map(io::BufReader::new);
    let line = said
        .and_then(|said| said.lines().next())
        .expect("it says something");
    // It waits for us now; it is cargo by then, by the same process id.
    child.kill().expect("it runs");
    child.wait().expect("it was killed");
    let expected = format!(
        "waiting for another command, which builds in {}",
        folder.display()
    );
    assert_eq!(line.expect("UTF-8"), expected);

    // A tool that is built, and newer than its sources, answers while the lock is held.
    let built = env!("CARGO_BIN_EXE_fass-tool");
    fs::copy(built, folder.join("fass-tool")).expect("the folder takes a program");
    let output = run_help().output().expect("the script can be started");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(output.stderr, b"");
    assert!(output.stdout.starts_with(b"Builds an app, "), "{output:?}");
}

#[test]
fn what_cannot_be_written_is_1_and_said() {
    let demo = workspace().join("apps/dag-file/examples/demo.dag");
    let cases = workspace().join("tests/oracle/synchronizer.txt");
    for words in [
        "run --help".into(),
        format!("run --print-dag --dag {}", demo.display()),
        format!("oracle synchronizer {}", cases.display()),
    ] {
        let full = fs::File::create("/dev/full").expect("the device is there");
        let output = tool(&words).stdout(full).output().expect("it starts");
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(1), "{words}: {said}");
        let words = "fass-tool: standard output could not be written: No space left on device";
        assert!(said.starts_with(words), "{said}");
    }
}

#[test]
fn a_dag_files_app_is_refused_without_a_file() {
    let output = output("run --app dag-file --mode deterministic");
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{said}");
    let words = "run: app `dag-file` runs the DAGs of a file; name one by `--dag FILE`\n";
    assert_eq!(said, words);
}

#[test]
fn every_command_explains_itself() {
    for name in COMMANDS {
        let output = output(&format!("{name} --help"));
        let said = String::from_utf8(output.stdout).expect("UTF-8");
        assert_eq!(output.status.code(), Some(0), "{name}");
        let usage = format!("usage: ./scripts/{name} ");
        assert!(said.contains(&usage), "{name}: {said}");
        let mut words = name.split(' ');
        let script = words.next().unwrap_or_default();
        assert!(workspace().join("scripts").join(script).is_file(), "{name}");
    }
}

#[test]
fn that_no_one_reads_is_no_failure() {
    for name in COMMANDS {
        assert_eq!(
            code_without_readers(&format!("{name} --help")),
            Some(0),
            "{name}"
        );
        assert_eq!(
            code_without_readers(&format!("{name} --frobnicate")),
            Some(2),
            "{name}"
        );
    }
    let cases = workspace().join("tests/oracle/synchronizer.txt");
    let words = format!("oracle synchronizer {}", cases.display());
    assert_eq!(code_without_readers(&words), Some(0));
    let file = workspace().join("apps/dag-file/examples/rd-gen/gnp_01.yaml");
    let words = format!("run --print-dag --dag {}", file.display());
    assert_eq!(code_without_readers(&words), Some(0));
}

#[test]
fn a_name_that_no_app_can_have_is_2() {
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
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
        (
            &["one", "--git", "https://example.org"],
            "new-app: `--git` is for a repository; add its folder, `--out DIR`\n",
        ),
    ] {
        let output = run(words);
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        assert_eq!(String::from_utf8_lossy(&output.stderr), line);
    }
    assert!(!workspace().join("apps/one").exists());
}

#[test]
fn boot_runs_what_is_no_image_as_it_is() {
    let program = output("boot /bin/echo --help me");
    assert_eq!(program.status.code(), Some(0));
    assert_eq!(program.stdout, b"--help me\n");
    let nothing = output("boot ./no-such-program");
    let said = String::from_utf8_lossy(&nothing.stderr).into_owned();
    assert_eq!(nothing.status.code(), Some(1), "{said}");
    assert!(
        said.starts_with("boot: cannot start ./no-such-program: "),
        "{said}"
    );
}
