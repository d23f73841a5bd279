//! Properties of all commands of the tool: the refusal of unknown words, and output that no one
//! reads.

use std::fs;
use std::io::{self, BufRead};
use std::path::PathBuf;
use std::process::{Command, Stdio};

use tool::system::workspace;

use crate::PROGRAM;
use crate::support::{
    assert_explained, assert_needs_room, assert_refused, assert_visible, call,
    code_without_readers, folder, refusal,
};

/// Every command, by the words that name it.
const COMMANDS: &str = "run, boot, new-app, check-trace, trace, page, recording";

#[test]
fn every_command_explains_itself_and_names_an_unknown_option() {
    assert_explained(COMMANDS);
}

#[test]
fn that_no_one_reads_is_no_failure_and_that_there_is_no_room_is_one() {
    let folder = folder("unread");
    fs::write(folder.join("good.rec"), crate::traces::good()).expect("a file");
    let log = folder.join("good.rec").display().to_string();
    for line in [
        "run --print-dag --dag apps/dag-file/examples/converted/gnp_01.dag",
        &format!("trace {log}"),
        &format!("check-trace {log}"),
    ] {
        assert_eq!(code_without_readers(line), Some(0), "{line}");
    }
    for line in [
        "run --help",
        "run --print-dag --dag apps/dag-file/examples/demo.dag",
    ] {
        assert_needs_room("fass-tool", line);
    }
}

#[test]
fn what_does_not_fit_is_refused_with_the_remedy() {
    let rows = "
run --coers 3 | run: unknown option `--coers`; did you mean `--cores`?
run --app dag-file --mode deterministic | run: app `dag-file` runs the DAGs of a file; name one by `--dag FILE`
run --execution wcet | `--execution` needs `--dag FILE`
run --from a/1 | run: `--from` needs `--replay FILE`; give it, too
run --on linux --machine q35 | `--machine` is for the bare machine; leave
run --on linux --gdb | `--gdb` is for the bare machine; leave
run --on linux --latest 3 | `--latest` is for the bare machine; leave
run --on debian --output x | `--output` is not for `--on debian`; leave it out, or give `--on linux`
run --mechanism fifo | `--mechanism` is for Linux; leave it out, or give
run --on linux --input x | `--input FILE` is for the bare machine, which
run --input - --console | `--input -` and `--console` both
run --output - | `--output -`: standard output is
run --dag x --output y | `--output` and `--dag` exclude
run --boot bios --machine microvm | `--machine microvm`: it has no firmware
run --device edu --machine microvm | `--machine microvm`: it has no PCI, which `--device` needs; give --machine q35, or leave --device out
run --on linux --device edu | `--device` is for the bare machine; leave
run --boot uefi --mode deterministic | give --mode threads
new-app | new-app: which name? give one, such as `./scripts/new-app brake-assist`
new-app fork-join | new-app: there is an app `fork-join` already; choose another name, or edit apps/fork-join
new-app one two | new-app: `two`: only one NAME is allowed, and `one` is one
new-app one --git https://example.org | new-app: `--git` is for a repository; add its folder, `--out DIR`";
    assert_refused(workspace(), rows);
    assert!(!workspace().join("apps/one").exists());
    let seed = format!("seed={}", "1".repeat(2100));
    let words = ["run", "--mode", "deterministic", "--append", &seed];
    let expected = "run: the guest's command line has 2137 bytes, and 2048 is the most that it \
                    takes; give fewer or shorter words";
    assert_eq!(refusal(workspace(), words), expected);
}

/// In each line, a word stands for a character that a terminal would obey.
#[test]
fn what_a_message_repeats_cannot_rewrite_the_terminal() {
    assert_visible(&[
        "run --cores WORD",
        "run WORD",
        "run --app WORD",
        "run --set WORD=",
        "run --dag WORD",
        "run --dag apps/dag-file/examples/demo.dag --graph WORD",
        "run --dag apps/dag-file/examples/demo.dag --clusters 1WORD1",
        "run --image WORD",
        "check-trace WORD",
        "new-app WORD",
    ]);
    assert!(refusal(workspace(), ["run", "--set", "gain=1\n2"]).contains("\\n"));
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
    let line = said.and_then(|said| said.lines().next());
    let line = line.expect("it says something").expect("UTF-8");
    // It waits for us now; it is cargo by then, by the same process id.
    child.kill().expect("it runs");
    child.wait().expect("it was killed");
    let folder = folder.display();
    let waiting = format!("waiting for another command, which builds in {folder}");
    assert_eq!(line, waiting);

    // A tool that is built answers while the lock is held.
    fs::copy(PROGRAM, target.join("tool/fass-tool")).expect("the folder takes a program");
    let output = run_help().output().expect("the script can be started");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(output.stderr, b"");
    assert!(output.stdout.starts_with(b"Builds an app, "), "{output:?}");
}

#[test]
fn boot_runs_what_is_no_image_as_it_is() {
    let program = call(workspace(), "boot /bin/echo --help me".split(' '));
    let found = (program.code, program.out.as_str());
    assert_eq!(found, (Some(0), "--help me\n"));
    let nothing = call(workspace(), ["boot", "./no-such-program"]);
    assert_eq!(nothing.code, Some(1), "{}", nothing.complaint);
    let words = "boot: cannot start ./no-such-program: ";
    assert!(nothing.complaint.starts_with(words));
}
