//! The mode that a command chooses: by the probe where KVM is possible, with one sentence where KVM
//! does not work.
//!
//! A script in QEMU's place acts as a KVM that does not work, and passes every other mode on to
//! QEMU; so the tests run on any host. The last test uses the host as it is.

use std::fs;
use std::time::Duration;

use tool::qemu::Qemu;
use tool::{image, install, probe, system};

use crate::support::{STOPS, assert_kvm_refused, call_by, folder, stub, succeed};
use crate::tiny::{TinyEnd, tiny_image};

/// A limit that no busy host reaches.
const FAR: Duration = Duration::from_secs(120);

/// As QEMU 7.2 does where there is no device.
const IS_ABSENT: &str = "echo 'Could not access KVM kernel module: No such file or directory' >&2
    echo 'qemu-system-x86_64: failed to initialize kvm: No such file or directory' >&2; exit 1";

#[test]
fn the_probe_passes_where_nothing_is_wrong() {
    install::ensure_qemu().expect("QEMU");
    let image = image::build("fork-join").expect("the image");
    assert_eq!(probe::run(&Qemu::default(), &image, FAR), Ok(()));
}

#[test]
fn a_failed_probe_is_told_in_words() {
    install::ensure_qemu().expect("QEMU");
    let image = folder("probed").join("tiny.image");
    fs::write(&image, tiny_image("", TinyEnd::Never)).expect("the image is written");
    let limit = Duration::from_millis(500);
    let why = probe::run(&Qemu::default(), &image, limit).unwrap_err();
    let is_told = why.starts_with("no end within 0.5 s, QEMU was killed; the host's load was ");
    assert!(is_told, "{why}");
    fs::write(&image, tiny_image("", TinyEnd::Exit(0x10))).expect("the image is written");
    let why = probe::run(&Qemu::default(), &image, FAR).unwrap_err();
    assert!(why.contains("gave no verdict"), "{why}");
}

#[test]
fn without_a_named_mode_a_useless_kvm_costs_a_sentence() {
    let stopped = "KVM could not run the guest any further, QEMU was killed (KVM internal error. \
                   Suberror: 1)";
    let absent = "QEMU ended with status 1 (Could not access KVM kernel module: No such file or \
                  directory)";
    for (under_kvm, why) in [(STOPS, stopped), (IS_ABSENT, absent)] {
        let called = call_by(&stub("useless", under_kvm), "run --jobs 2 --subtasks 2");
        let shown = called.out;
        assert_eq!(called.code, Some(0), "{shown}{}", called.complaint);
        let sentence = format!("mode deterministic because KVM is of no use here: {why}\n");
        let told = shown.matches("KVM").count();
        assert_eq!(told, sentence.matches("KVM").count(), "{shown}");
        assert!(shown.contains(&sentence), "{shown}");
        assert!(shown.contains("\"status\":\"success\""), "{shown}");
    }
}

#[test]
fn a_named_kvm_that_is_of_no_use_is_refused_by_every_command_that_boots() {
    assert_kvm_refused(&[
        "run --mode kvm",
        "run --dag apps/dag-file/examples/demo.dag --mode kvm",
    ]);
}

#[test]
fn a_command_settles_its_mode_on_this_host_too() {
    let line = "run --jobs 2 --subtasks 2 --append budget_factor=0";
    let shown = succeed(system::workspace(), line);
    let useless = shown.matches("\nmode deterministic because KVM is of no use here: ");
    let useful = shown.matches("\nmode kvm because ");
    assert_eq!(useless.count() + useful.count(), 1, "{shown}");
}

#[test]
fn a_missing_qemu_is_named() {
    let qemu = Qemu {
        program: "/no/such/qemu".into(),
        ..Qemu::default()
    };
    let error = qemu.start("image".as_ref(), "log".as_ref()).unwrap_err();
    assert!(error.contains("no program `/no/such/qemu`"), "{error}");
}
