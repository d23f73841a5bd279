//! The kernel boots with one processor and with many, on both boards.

use std::fs;
use std::time::Duration;

use harness::file::File;
use harness::{Guest, Members, Said};
use tool::qemu::RunEnd;
use tool::{Machine, Mode, Outcome};
use views::protocol::{MachineLine, Status, Transcript};

/// Describes the demo, short.
fn demo(cores: u64) -> Guest {
    let guest = Guest::new("fork-join").cores(cores);
    guest.word("jobs=2 subtasks=2")
}

/// Boots a guest, and returns its `boot` line about the machine.
#[track_caller]
fn booted(guest: &Guest) -> MachineLine {
    guest.succeed().only("boot").clone()
}

#[test]
fn one_to_sixty_four_processors_on_both_boards() {
    for (cores, machine, mode) in [
        (1, Machine::Microvm, Mode::Deterministic),
        (2, Machine::Microvm, Mode::Deterministic),
        (8, Machine::Microvm, Mode::Deterministic),
        (64, Machine::Microvm, Mode::Deterministic),
        (4, Machine::Q35, Mode::Deterministic),
        (4, Machine::Microvm, Mode::Threads),
        (4, Machine::Q35, Mode::Threads),
    ] {
        let guest = demo(cores).machine(machine).mode(mode);
        let memory_mib = if cores > 8 { 128 } else { 32 };
        // In real time a busy host may hold a core back for longer than any budget.
        let boot = booted(&guest.memory_mib(memory_mib).word("budget_factor=0"));
        boot.has([("cpus", cores)]);
        boot.reads([("app", "fork-join")]);
    }
}

/// Describes a machine without a device for the exit status, like a PC.
fn endless(cores: u64) -> Guest {
    demo(cores).altered(&[("iobase=0xf4", "iobase=0xf8")], "")
}

/// Checks the guest's verdict; its exit status tells nothing here.
#[track_caller]
fn succeeds(outcome: &Outcome) {
    let verdict = outcome.transcript.verdict();
    let status = verdict.map(|verdict| verdict.status);
    assert_eq!(status, Ok(Status::Success), "{}", outcome.tail());
}

/// Idle time is skipped until the limit: a core still looking after the others would have printed
/// by then. A host too busy for the verdict gets more time.
#[test]
fn a_machine_that_cannot_be_ended_stays_silent_after_its_verdict() {
    let limits = [8, 60, 600].map(Duration::from_secs).into_iter();
    let mut outcomes = limits.map(|limit| endless(2).limit(limit).boot());
    let has_ended = |outcome: &Outcome| outcome.tail().contains(r#""kind":"verdict""#);
    let outcome = outcomes.find(has_ended).expect("it gives a verdict");
    let ended = matches!(outcome.ending, RunEnd::TimedOut { .. });
    assert!(ended, "{}\n{}", outcome.ending, outcome.tail());
    succeeds(&outcome);
}

/// The models reach from the first 64-bit processors to today's, of both makers.
#[test]
fn nine_models_of_processors() {
    for model in [
        "qemu64",
        "core2duo",
        "Nehalem",
        "Haswell",
        "Skylake-Server",
        "Denverton",
        "EPYC",
        "EPYC-Milan",
        "Opteron_G5",
    ] {
        let guest = demo(2).in_real_time().machine(Machine::Q35);
        booted(&guest.model(model)).has([("cpus", 2)]);
    }
}

#[test]
fn a_processor_without_64_bits_is_refused() {
    let outcome = demo(1).model("qemu32").boot();
    let line = "this processor has no 64-bit mode, which the image needs\r\n";
    assert_eq!(outcome.serial, line, "{}", outcome.ending);
    assert_eq!(outcome.ending, RunEnd::Guest(Status::Failure));
}

/// The hardware of one core fails on request, by a word to QEMU's monitor. The monitor has the way
/// into the guest.
#[test]
fn a_machine_check_is_reported() {
    let port = (
        "stdio,id=console,signal=off,logfile=",
        "file,id=console,path=",
    );
    for core in [0, 1] {
        let guest = Guest::new("fork-join").in_real_time().cores(2);
        let guest = guest.altered(&[port], "-monitor stdio").word("jobs=100000");
        // Bank 4 has an error that is valid, uncorrected and enabled, and says where.
        let command = format!("mce {core} 4 0xb400000000000135 5 0x12340 0");
        let guest = guest.typing(&[("\"boot\"", &command)]);
        let outcome = guest.end_in(Status::Failure);
        let exception = outcome.only("panic");
        exception.has([("cpu", core)]);
        let message = exception.member("message");
        let says = "machine check, bank 4: 0xb400000000000135 at 0x12340";
        assert!(message.starts_with(says), "{message}");
    }
}

#[test]
fn a_machine_is_powered_off_or_reset_as_its_tables_say() {
    for machine in [Machine::Microvm, Machine::Q35] {
        // A reset ends QEMU, too: it was told not to boot again.
        for word in ["end=off", "end=reset"] {
            let outcome = endless(2).machine(machine).word(word).boot();
            assert_eq!(outcome.ending, RunEnd::Status(0), "{machine}, {word}");
            succeeds(&outcome);
        }
    }
}

/// Output goes nowhere, at once. The absent port is never ready here, and two devices in its place
/// show all sent bytes: in counted time, without a wait.
#[test]
fn a_machine_without_a_serial_port_runs() {
    let bytes = File::new("bytes", "out");
    let never_ready =
        "-chardev null,id=none -device isa-debugcon,iobase=0x3fd,readback=0,chardev=none";
    let more = format!(
        "{never_ready} -chardev file,id=bytes,path={} \
         -device isa-debugcon,iobase=0x3f8,readback=0,chardev=bytes",
        bytes.0.display()
    );
    let mute = demo(2).altered(&[("#microvm", "microvm,isa-serial=off")], &more);
    let outcome = mute.boot();
    assert_eq!(outcome.ending, RunEnd::Guest(Status::Success));
    assert_eq!(outcome.serial, "");
    let sent = fs::read_to_string(&bytes.0).expect("what was sent");
    // The port's divisor comes first.
    let sent = Transcript::read(sent.trim_start_matches('\u{1}'));
    let ready_ns = sent.line("boot").number("ready_ns");
    let first_ns = sent.line("fork_join").number("first_release_ns");
    assert!(first_ns - ready_ns < 10_000_000, "{ready_ns}, {first_ns}");
}

/// Here all clocks follow the same count, so all must find the same rate.
#[test]
fn time_is_measured_by_the_clock_that_is_asked_for() {
    for (clock, check) in [
        ("acpi-pm-timer", "hpet"),
        ("hpet", "acpi-pm-timer"),
        ("local-apic-1ghz", "acpi-pm-timer"),
        ("pit", "acpi-pm-timer"),
    ] {
        let guest = demo(2).machine(Machine::Q35);
        let boot = booted(&guest.word(&format!("clock={clock}")));
        boot.reads([("clock", clock), ("clock_check", check)]);
        assert!(boot.text.contains("\"clock_undisputed\":true"));
        for rate in ["counter_khz", "clock_check_khz"] {
            assert!(boot.number(rate).abs_diff(1_000_000) < 100, "{}", boot.text);
        }
        boot.has([("skew_ns", 0)]);
    }
}

/// The board has no ACPI timer, and the processor hides that it is QEMU's.
#[test]
fn a_machine_with_no_clock_but_the_first_pcs_runs() {
    let boot = booted(&demo(2).model("max,-hypervisor"));
    boot.reads([("clock", "pit")]);
}

#[test]
fn what_a_machine_lacks_is_named() {
    let (apic, board) = (("#max", "max,-apic"), ("#microvm", "microvm,acpi=off"));
    let clocks = [("#max", "max,-hypervisor"), ("#microvm", "microvm,pit=off")];
    for (changes, word, why) in [
        (
            &[("#max", "max,-nx")][..],
            "",
            "the processor has no no-execute pages (NX, XD); ",
        ),
        (&[apic], "", "the processor has no local APIC; "),
        (&[board], "", "the machine has no ACPI root pointer; "),
        (
            &clocks,
            "",
            "no clock of known rate: any does not count here; ",
        ),
        (
            &[],
            "clock=hpet",
            "no clock of known rate: hpet does not count here; ",
        ),
        (
            &[("#max", "max,-x2apic")],
            "x2apic=on",
            "the processor has no x2APIC",
        ),
    ] {
        let guest = demo(2).altered(changes, "").word(word);
        let outcome = guest.end_in(Status::Failure);
        let message = outcome.line("panic").member("message");
        assert!(message.starts_with(why), "{message}");
    }
}

/// `boots/in_bochs.rs` has a processor with x2APIC.
#[test]
fn a_processor_without_x2apic_is_left_without() {
    let boot = booted(&demo(2).model("max,-x2apic"));
    assert!(boot.text.contains("\"x2apic\":false"), "{}", boot.text);
}

/// Processors state their siblings in several ways.
#[test]
fn siblings_are_said_and_left_out_on_demand() {
    let warning = "warning: 2 of 4 cores share a physical core with another";
    for model in ["max", "core2duo"] {
        let guest = demo(4).altered(&[("#max", model)], "-smp 4,cores=2,threads=2");
        for (words, cores, siblings) in [
            ("", 4, 2),
            ("smt=off", 2, 0),
            ("smt=off cores=0,1,3", 2, 0),
            ("cores=0,2-3", 3, 1),
        ] {
            let outcome = guest.clone().word(words).succeed();
            let boot = outcome.only("boot");
            boot.has([("cpus", cores), ("siblings", siblings)]);
            let warns = outcome.serial.contains("warning: ");
            assert_eq!(warns, siblings > 0, "{model}: {}", outcome.serial);
            let says_so = outcome.serial.contains(warning);
            assert_eq!(says_so, words.is_empty(), "{model}: {words}");
        }
    }
}

#[test]
fn a_list_of_cores_that_are_not_there_is_refused() {
    for list in ["1-3", "0-4", "4"] {
        let outcome = demo(4).word(&format!("cores={list}"));
        let outcome = outcome.end_in(Status::Usage);
        let why = format!("`cores={list}`: allowed are numbers and ranges such as 0-3,6");
        assert!(outcome.serial.contains(&why), "{}", outcome.serial);
    }
}

/// Without a hypervisor the kernel believes the processor. If the processor does not promise that
/// its timer goes on during halts, no core halts, and still all goes on.
#[test]
fn what_a_processor_does_not_promise_is_said() {
    let guest = demo(2).in_real_time().machine(Machine::Q35);
    let guest = guest.model("max,-hypervisor,-arat");
    for (word, stay_awake) in [("", true), ("idle=halt", false)] {
        let outcome = guest.clone().word(word).succeed();
        let boot = outcome.only("boot");
        let promised = "\"counter_invariant\":false,\"timer_in_halt\":false";
        assert!(boot.text.contains(promised), "{}", boot.text);
        let rate = "warning: the processor does not state that its counter keeps one rate";
        assert!(outcome.serial.contains(rate), "{}", outcome.serial);
        let awake = outcome.serial.contains("so idle cores stay awake");
        assert_eq!(awake, stay_awake, "{}", outcome.serial);
    }
}

#[test]
fn the_probe_passes_in_every_emulated_mode() {
    for mode in [Mode::Deterministic, Mode::Threads] {
        for (machine, cores) in [
            (Machine::Microvm, 1),
            (Machine::Q35, 2),
            (Machine::Microvm, 4),
        ] {
            let guest = Guest::new("fork-join").mode(mode).machine(machine);
            let outcome = guest.cores(cores).word("probe=on").succeed();
            outcome.only("probe").has([("steps", 2 * cores)]);
            assert_eq!(outcome.lines("fork_join").len(), 0);
        }
    }
}
