//! The tool's own way of starting, reading and ending QEMU, shown on a guest
//! of a few instructions: no kernel is needed, so a failure here is the
//! tool's or the host's.

use std::fs;
use std::time::Duration;

use tool::outcome::{Outcome, boot};
use tool::protocol::Status;
use tool::qemu::{Ending, Machine, Mode, Qemu};
use tool::{install, system};

use crate::tiny::{TinyEnd, tiny_image};

/// A limit that no busy host reaches.
const FAR: Duration = Duration::from_secs(300);

const VERDICT: &str = "{\"kind\":\"verdict\",\"status\":\"success\",\"reason\":\"\"}\n";

fn boot_tiny(qemu: &Qemu, text: &str, end: TinyEnd, limit: Duration) -> (Outcome, Vec<String>) {
    install::ensure_qemu().expect("QEMU");
    let log = system::new_log("tiny").expect("a log");
    let image = log.with_extension("image");
    fs::write(&image, tiny_image(text, end)).expect("the image is written");
    let mut shown = Vec::new();
    let outcome = boot(qemu, &image, &log, limit, |line| {
        shown.push(line.to_string())
    });
    fs::remove_file(&image).expect("the image is removed");
    fs::remove_file(&log).expect("the log is removed");
    (outcome.expect("QEMU starts"), shown)
}

fn quick(qemu: &Qemu, text: &str, end: TinyEnd) -> (Outcome, Vec<String>) {
    boot_tiny(qemu, text, end, FAR)
}

#[test]
fn every_machine_and_emulated_mode_runs_a_guest() {
    for machine in [Machine::Microvm, Machine::Q35] {
        for mode in [Mode::Deterministic, Mode::Threads] {
            let qemu = Qemu {
                machine,
                mode,
                ..Qemu::default()
            };
            let (outcome, shown) = quick(&qemu, &format!("hello\n{VERDICT}"), TinyEnd::Exit(0x10));
            assert_eq!(outcome.judge(), Ok(()), "{machine} {mode}: {outcome:?}");
            assert_eq!(shown, ["hello", VERDICT.trim_end()]);
            assert_eq!(outcome.complaints, "");
        }
    }
}

#[test]
fn the_byte_at_the_exit_port_becomes_the_ending() {
    for (byte, ending) in [
        (0x10, Ending::Guest(Status::Success)),
        (0x11, Ending::Guest(Status::Failure)),
        (0x12, Ending::Guest(Status::Usage)),
        (0x13, Ending::Status(39)),
        (0x00, Ending::Status(1)),
    ] {
        let (outcome, _) = quick(&Qemu::default(), "", TinyEnd::Exit(byte));
        assert_eq!(outcome.ending, ending);
        // Without a verdict even a good ending is a failure.
        assert!(outcome.judge().is_err());
    }
}

#[test]
fn a_guest_that_does_not_end_is_killed() {
    for mode in [Mode::Deterministic, Mode::Threads] {
        let qemu = Qemu {
            mode,
            ..Qemu::default()
        };
        // A busy host may not get as far as the text within the first limit.
        let mut limit = Duration::from_millis(500);
        let shown = loop {
            let (outcome, shown) = boot_tiny(&qemu, "no line end", TinyEnd::Never, limit);
            let Ending::TimedOut { limit: over, load } = &outcome.ending else {
                panic!("{outcome:?}");
            };
            assert_eq!(*over, limit);
            assert!(load.starts_with("the host's load was "), "{load}");
            if !shown.is_empty() || limit > Duration::from_secs(100) {
                break shown;
            }
            limit *= 4;
        };
        assert_eq!(shown, ["no line end"]);
    }
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
