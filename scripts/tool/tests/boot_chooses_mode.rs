//! The mode that a command takes: by the probe where KVM comes into question, with one
//! sentence where KVM is of no use.
//!
//! A script in QEMU's place plays a KVM that is of no use, and hands every other mode on
//! to QEMU; so the tests run on any host. The last one takes the host as it is.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use tool::qemu::{PROGRAM, Qemu};
use tool::tiny::{TinyEnd, tiny_image};
use tool::{image, install, probe, system};

/// A limit that no busy host reaches.
const FAR: Duration = Duration::from_secs(120);

/// As QEMU 7.2 does where the host's KVM does not know an instruction.
const STOPS: &str = "echo 'KVM internal error. Suberror: 1' >&2; exec sleep 600";
/// As QEMU 7.2 does where there is no device.
const IS_ABSENT: &str = "echo 'Could not access KVM kernel module: No such file or directory' >&2
    echo 'qemu-system-x86_64: failed to initialize kvm: No such file or directory' >&2; exit 1";

/// A folder with a program of QEMU's name that does `under_kvm` in place of KVM.
struct Stub(PathBuf);

impl Stub {
    fn new(under_kvm: &str) -> Stub {
        install::ensure_qemu().expect("QEMU");
        let folder = system::new_log("stub").expect("a folder");
        fs::create_dir(&folder).expect("a new folder");
        let real = system::find_program(PROGRAM).expect("QEMU");
        let script = format!(
            "#!/bin/sh\ncase \"$*\" in *'-accel kvm'*) {under_kvm};; esac\nexec {} \"$@\"\n",
            real.display()
        );
        let stub = folder.join(PROGRAM);
        fs::write(&stub, script).expect("the script is written");
        fs::set_permissions(&stub, fs::Permissions::from_mode(0o755)).expect("it is ours");
        Stub(folder)
    }

    fn run(&self, words: &str) -> Output {
        let path = std::env::var("PATH").expect("a PATH");
        tool(words)
            .env("PATH", format!("{}:{path}", self.0.display()))
            .output()
            .expect("the tool starts")
    }
}

impl Drop for Stub {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).expect("it is ours");
    }
}

fn tool(words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command
        .args(words.split(' '))
        .current_dir(system::workspace())
        .stdin(Stdio::null());
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn the_probe_passes_where_nothing_is_wrong() {
    install::ensure_qemu().expect("QEMU");
    let image = image::build("fork-join").expect("the image");
    assert_eq!(probe::run(&Qemu::default(), &image.path, FAR), Ok(()));
}

#[test]
fn a_failed_probe_is_told_in_words() {
    install::ensure_qemu().expect("QEMU");
    let image = system::new_log("tiny")
        .expect("a file")
        .with_extension("image");
    fs::write(&image, tiny_image("", TinyEnd::Never)).expect("the image is written");
    let limit = Duration::from_millis(500);
    let why = probe::run(&Qemu::default(), &image, limit).unwrap_err();
    assert!(
        why.starts_with("no end within 0.5 s, QEMU was killed; the host's load was "),
        "{why}"
    );
    fs::write(&image, tiny_image("", TinyEnd::Exit(0x10))).expect("the image is written");
    let why = probe::run(&Qemu::default(), &image, FAR).unwrap_err();
    assert!(why.contains("gave no verdict"), "{why}");
    fs::remove_file(&image).expect("it is ours");
}

#[test]
fn without_a_named_mode_a_useless_kvm_costs_a_sentence() {
    for (under_kvm, why) in [
        (
            STOPS,
            "KVM could not run the guest any further, QEMU was killed (KVM internal error. Suberror: 1)",
        ),
        (
            IS_ABSENT,
            "QEMU ended with status 1 (Could not access KVM kernel module: No such file or directory)",
        ),
    ] {
        let stub = Stub::new(under_kvm);
        let output = stub.run("run --jobs 2 --subtasks 2");
        let shown = text(&output.stdout);
        assert!(output.status.success(), "{shown}{}", text(&output.stderr));
        let sentence = format!("mode deterministic because KVM is of no use here: {why}\n");
        assert_eq!(
            shown.matches("KVM").count(),
            sentence.matches("KVM").count(),
            "{shown}"
        );
        assert!(shown.contains(&sentence), "{shown}");
        assert!(shown.contains("\"status\":\"success\""), "{shown}");
    }
}

#[test]
fn a_named_kvm_that_is_of_no_use_is_refused_by_every_command_that_boots() {
    let stub = Stub::new(STOPS);
    for words in [
        "run --mode kvm",
        "run --dag apps/dag-file/examples/demo.dag --mode kvm",
        "soak --short --mode kvm",
        "oracle schedules --in-kernel --mode kvm --cores-up-to 1 tests/oracle/schedules.txt",
        "bench hand-off --mode kvm",
        "bench join-latency --mode kvm --out target/no-such-folder",
    ] {
        let output = stub.run(words);
        assert_eq!(output.status.code(), Some(1), "{words}");
        let complaint = text(&output.stderr);
        assert_eq!(complaint.lines().count(), 1, "{words}: {complaint}");
        assert!(
            complaint.contains(
                "`--mode kvm`: KVM is of no use here: KVM could not run the guest any further, \
                 QEMU was killed (KVM internal error. Suberror: 1); use deterministic or threads"
            ),
            "{words}: {complaint}"
        );
    }
}

#[test]
fn a_command_settles_its_mode_on_this_host_too() {
    let output = tool("run --jobs 2 --subtasks 2 --append budget_factor=0")
        .output()
        .expect("the tool starts");
    let shown = text(&output.stdout);
    assert!(output.status.success(), "{shown}{}", text(&output.stderr));
    let settled = [
        "mode kvm because ",
        "mode deterministic because KVM is of no use here: ",
    ];
    let lines = shown
        .lines()
        .filter(|line| settled.iter().any(|start| line.starts_with(start)));
    assert_eq!(lines.count(), 1, "{shown}");
}
