//! The kernel boots with one processor and with many, on both boards.

use std::fs;
use std::path::Path;
use std::time::Duration;

use harness::Guest;
use harness::altered::{qemu_and, qemu_with};
use tool::protocol::{Status, Transcript};
use tool::qemu::Ending;
use tool::{Machine, Mode, system};

/// Boots the demo, short, and checks that all processors came up.
fn boots_with(guest: Guest, cores: u64) {
    let guest = guest.cores(cores).word("jobs=4").word("subtasks=2");
    let outcome = guest.succeed();
    let boots: Vec<_> = outcome.transcript.of_kind("boot").collect();
    assert_eq!(boots.len(), 1, "one boot line is due\n{}", outcome.tail());
    assert_eq!(boots[0].number_at("cpus"), Some(cores), "{}", boots[0].text);
    assert_eq!(boots[0].text_at("app"), Some("fork-join"));
}

#[test]
fn one_processor() {
    boots_with(Guest::new("fork-join"), 1);
}

#[test]
fn two_processors() {
    boots_with(Guest::new("fork-join"), 2);
}

#[test]
fn four_processors() {
    boots_with(Guest::new("fork-join"), 4);
}

#[test]
fn eight_processors() {
    boots_with(Guest::new("fork-join"), 8);
}

#[test]
fn sixty_four_processors() {
    boots_with(Guest::new("fork-join").memory_mib(128), 64);
}

#[test]
fn four_processors_on_a_q35() {
    boots_with(Guest::new("fork-join").machine(Machine::Q35), 4);
}

#[test]
fn four_processors_in_real_time() {
    boots_with(Guest::new("fork-join").in_real_time(), 4);
}

#[test]
fn four_processors_in_real_time_on_a_q35() {
    let guest = Guest::new("fork-join").in_real_time();
    boots_with(guest.machine(Machine::Q35), 4);
}

/// Where nothing takes the status, as on a PC, idle time is skipped until the limit: a core
/// that still looked after the others would have said so by then. A host too busy for the
/// verdict is given more time.
#[test]
fn a_machine_that_cannot_be_ended_stays_silent_after_its_verdict() {
    let endless = qemu_with("iobase=0xf4", "iobase=0xf8");
    let guest = Guest::new("fork-join").cores(2).program(&endless);
    let guest = guest.word("jobs=2").word("subtasks=2");
    let mut outcome = guest.clone().limit(Duration::from_secs(8)).boot();
    for seconds in [60, 600] {
        if outcome.tail().contains(r#""kind":"verdict""#) {
            break;
        }
        let limit = Duration::from_secs(seconds);
        outcome = guest.clone().limit(limit).boot();
    }
    fs::remove_file(&endless).expect("it is ours");
    let ended = matches!(outcome.ending, Ending::TimedOut { .. });
    assert!(ended, "{}\n{}", outcome.ending, outcome.tail());
    let verdict = outcome.transcript.verdict();
    let status = verdict.map(|verdict| verdict.status);
    assert_eq!(status, Ok(Status::Success), "{}", outcome.tail());
}

/// From the first of 64 bits to those of today, of both makers.
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
        let program = qemu_with("#max", model);
        let guest = Guest::new("fork-join").in_real_time().program(&program);
        boots_with(guest.machine(Machine::Q35), 2);
        fs::remove_file(&program).expect("it is ours");
    }
}

#[test]
fn a_processor_without_64_bits_is_refused() {
    let program = qemu_with("#max", "qemu32");
    let outcome = Guest::new("fork-join").program(&program).boot();
    fs::remove_file(&program).expect("it is ours");
    let line = "this processor has no 64-bit mode, which the image needs\r\n";
    assert_eq!(outcome.serial, line, "{}", outcome.ending);
    assert_eq!(outcome.ending, Ending::Guest(Status::Failure));
}

/// The hardware of one core fails, by a word to QEMU's monitor, which has the way in.
#[test]
fn a_machine_check_is_reported() {
    let port = (
        "stdio,id=console,signal=off,logfile=",
        "file,id=console,path=",
    );
    let program = qemu_and(&[port], "-monitor stdio");
    for core in [0, 1] {
        let guest = Guest::new("fork-join").in_real_time().cores(2);
        let guest = guest.program(&program).word("jobs=100000");
        // Bank 4 has an error that is valid, uncorrected and enabled, and says where.
        let command = format!("mce {core} 4 0xb400000000000135 5 0x12340 0");
        let guest = guest.typing(&[("\"boot\"", &command)]);
        let outcome = guest.end_in(Status::Failure);
        let exceptions: Vec<_> = outcome.transcript.of_kind("exception").collect();
        let [exception] = exceptions[..] else {
            panic!("not one exception\n{}", outcome.tail());
        };
        assert_eq!(exception.number_at("cpu"), Some(core), "{}", exception.text);
        let message = exception.text_at("message").unwrap_or_default();
        let says = "machine check, bank 4: 0xb400000000000135 at 0x12340";
        assert!(message.starts_with(says), "{message}");
    }
    fs::remove_file(&program).expect("it is ours");
}

#[test]
fn a_machine_is_powered_off_or_reset_as_its_tables_say() {
    let endless = qemu_with("iobase=0xf4", "iobase=0xf8");
    for machine in [Machine::Microvm, Machine::Q35] {
        // A reset ends QEMU, too: it was told not to boot again.
        for word in ["end=off", "end=reset"] {
            let guest = Guest::new("fork-join").cores(2).machine(machine);
            let guest = guest.program(&endless).word("jobs=2").word("subtasks=2");
            let outcome = guest.word(word).boot();
            let what = format!("{machine}, {word}: {}\n", outcome.ending) + &outcome.tail();
            assert_eq!(outcome.ending, Ending::Status(0), "{what}");
            let verdict = outcome.transcript.verdict();
            let status = verdict.map(|verdict| verdict.status);
            assert_eq!(status, Ok(Status::Success), "{what}");
        }
    }
    fs::remove_file(&endless).expect("it is ours");
}

/// What would be printed goes nowhere, at once. The absent port is never ready here, and two
/// devices in its place show what is sent all the same: in counted time, without a wait.
#[test]
fn a_machine_without_a_serial_port_runs() {
    let bytes = system::new_log("bytes").expect("a file");
    let never_ready =
        "-chardev null,id=none -device isa-debugcon,iobase=0x3fd,readback=0,chardev=none";
    let more = format!(
        "{never_ready} -chardev file,id=bytes,path={} \
         -device isa-debugcon,iobase=0x3f8,readback=0,chardev=bytes",
        bytes.display()
    );
    let mute = qemu_and(&[("#microvm", "microvm,isa-serial=off")], &more);
    let guest = Guest::new("fork-join").cores(2).program(&mute);
    let guest = guest.word("jobs=2").word("subtasks=2");
    let outcome = guest.boot();
    fs::remove_file(&mute).expect("it is ours");
    assert_eq!(outcome.ending, Ending::Guest(Status::Success));
    assert_eq!(outcome.serial, "");
    let sent = fs::read_to_string(&bytes).expect("what was sent");
    fs::remove_file(&bytes).expect("it is ours");
    // The port's divisor comes first.
    let sent = Transcript::read(sent.trim_start_matches('\u{1}'));
    let number = |kind, member| sent.of_kind(kind).next()?.number_at(member);
    let ready_ns = number("boot", "ready_ns").expect("a boot line");
    let first_ns = number("fork_join", "first_release_ns").expect("a result");
    assert!(first_ns - ready_ns < 10_000_000, "{ready_ns}, {first_ns}");
}

/// Here all clocks follow one count, so that all must find the same rate.
#[test]
fn time_is_measured_by_the_clock_that_is_asked_for() {
    for (clock, check) in [
        ("acpi-pm-timer", "hpet"),
        ("hpet", "acpi-pm-timer"),
        ("local-apic-1ghz", "acpi-pm-timer"),
        ("pit", "acpi-pm-timer"),
    ] {
        let guest = Guest::new("fork-join").cores(2).machine(Machine::Q35);
        let guest = guest.word("jobs=2").word("subtasks=2");
        let outcome = guest.word(&format!("clock={clock}")).succeed();
        let boot = outcome.transcript.of_kind("boot").next().expect("a line");
        assert_eq!(boot.text_at("clock"), Some(clock), "{}", boot.text);
        assert_eq!(boot.text_at("clock_check"), Some(check), "{}", boot.text);
        assert!(boot.text.contains("\"clock_undisputed\":true"));
        for rate in ["counter_khz", "clock_check_khz"] {
            let khz = boot.number_at(rate).expect("a rate");
            assert!(khz.abs_diff(1_000_000) < 100, "{}", boot.text);
        }
        assert_eq!(boot.number_at("skew_ns"), Some(0), "{}", boot.text);
    }
}

/// The board has no ACPI timer, and the processor does not say that it is QEMU's.
#[test]
fn a_machine_with_no_clock_but_the_first_pcs_runs() {
    let unknown = qemu_with("#max", "max,-hypervisor");
    let guest = Guest::new("fork-join").cores(2).program(&unknown);
    let outcome = guest.word("jobs=2").word("subtasks=2").succeed();
    fs::remove_file(&unknown).expect("it is ours");
    let boot = outcome.transcript.of_kind("boot").next().expect("a line");
    assert_eq!(boot.text_at("clock"), Some("pit"), "{}", boot.text);
}

/// Boots a guest that must fail before it runs, and returns what it says.
fn refusal(guest: &Guest) -> String {
    let outcome = guest.end_in(Status::Failure);
    let panic = outcome.transcript.of_kind("panic").next();
    let panic = panic.expect("a report");
    panic.text_at("message").unwrap_or_default().into()
}

#[test]
fn a_machine_without_a_clock_of_known_rate_is_refused() {
    let changes = [("#max", "max,-hypervisor"), ("#microvm", "microvm,pit=off")];
    let unknown = qemu_and(&changes, "");
    let message = refusal(&Guest::new("fork-join").program(&unknown));
    fs::remove_file(&unknown).expect("it is ours");
    let expected = "no clock of known rate: any does not count here; ";
    assert!(message.starts_with(expected), "{message}");
    let message = refusal(&Guest::new("fork-join").word("clock=hpet"));
    let expected = "no clock of known rate: hpet does not count here; ";
    assert!(message.starts_with(expected), "{message}");
}

#[test]
fn what_a_machine_lacks_is_named() {
    for (other, word, why) in [
        (
            "#max",
            "max,-nx",
            "the processor has no no-execute pages (NX, XD); ",
        ),
        ("#max", "max,-apic", "the processor has no local APIC; "),
        (
            "#microvm",
            "microvm,acpi=off",
            "the machine has no ACPI root pointer; ",
        ),
    ] {
        let program = qemu_with(other, word);
        let message = refusal(&Guest::new("fork-join").program(&program));
        fs::remove_file(&program).expect("it is ours");
        assert!(message.starts_with(why), "{message}");
    }
}

/// `boot_in_bochs.rs` has a processor with x2APIC.
#[test]
fn x2apic_is_refused_where_the_processor_lacks_it() {
    let without = qemu_with("#max", "max,-x2apic");
    let guest = Guest::new("fork-join").cores(2).program(&without);
    let message = refusal(&guest.clone().word("x2apic=on"));
    assert!(
        message.starts_with("the processor has no x2APIC"),
        "{message}"
    );
    let outcome = guest.word("jobs=2").word("subtasks=2").succeed();
    fs::remove_file(&without).expect("it is ours");
    let boot = outcome.transcript.of_kind("boot").next().expect("a line");
    assert!(boot.text.contains("\"x2apic\":false"), "{}", boot.text);
}

/// Boots two cores of two siblings each, with these words, and returns what it prints and how
/// many cores and siblings there are.
fn of_siblings(program: &Path, words: &[&str]) -> (String, [Option<u64>; 2]) {
    let mut guest = Guest::new("fork-join").cores(4).program(program);
    for word in ["jobs=2", "subtasks=2"].iter().chain(words) {
        guest = guest.word(word);
    }
    let outcome = guest.succeed();
    let boot = outcome.transcript.of_kind("boot").next().expect("a line");
    let numbers = ["cpus", "siblings"].map(|member| boot.number_at(member));
    (outcome.serial, numbers)
}

/// Processors state their siblings in several ways.
#[test]
fn siblings_are_said_and_left_out_on_demand() {
    for model in ["max", "core2duo"] {
        let program = qemu_and(&[("#max", model)], "-smp 4,cores=2,threads=2");
        let (serial, numbers) = of_siblings(&program, &[]);
        assert_eq!(numbers, [Some(4), Some(2)], "{model}");
        let warning = "warning: 2 of 4 cores share a physical core with another";
        assert!(serial.contains(warning), "{model}: {serial}");
        let (serial, numbers) = of_siblings(&program, &["smt=off"]);
        assert_eq!(numbers, [Some(2), Some(0)], "{model}");
        assert!(!serial.contains("warning: "), "{model}: {serial}");
        let (_, numbers) = of_siblings(&program, &["smt=off", "cores=0,1,3"]);
        assert_eq!(numbers, [Some(2), Some(0)], "{model}");
        let (_, numbers) = of_siblings(&program, &["cores=0,2-3"]);
        assert_eq!(numbers, [Some(3), Some(1)], "{model}");
        fs::remove_file(&program).expect("it is ours");
    }
}

#[test]
fn a_list_of_cores_that_are_not_there_is_refused() {
    for list in ["1-3", "0-4", "4"] {
        let word = format!("cores={list}");
        let outcome = Guest::new("fork-join").cores(4).word(&word);
        let outcome = outcome.end_in(Status::Usage);
        let why = format!("`cores={list}`: allowed are numbers and ranges such as 0-3,6");
        assert!(outcome.serial.contains(&why), "{}", outcome.serial);
    }
}

/// On no hypervisor the processor is believed. Where it does not say that its timer goes on while
/// it halts, no core halts, and still all goes on.
#[test]
fn what_a_processor_does_not_promise_is_said() {
    let mute = qemu_with("#max", "max,-hypervisor,-arat");
    let guest = Guest::new("fork-join")
        .in_real_time()
        .cores(2)
        .program(&mute);
    let guest = guest
        .machine(Machine::Q35)
        .word("jobs=2")
        .word("subtasks=2");
    let boots = |guest: &Guest| {
        let outcome = guest.succeed();
        let boot = outcome.transcript.of_kind("boot").next().expect("a line");
        assert!(
            boot.text
                .contains("\"counter_invariant\":false,\"timer_in_halt\":false")
        );
        let rate = "warning: the processor does not state that its counter keeps one rate";
        assert!(outcome.serial.contains(rate), "{}", outcome.serial);
        outcome.serial.contains("so idle cores stay awake")
    };
    assert!(boots(&guest));
    assert!(!boots(&guest.word("idle=halt")));
    fs::remove_file(&mute).expect("it is ours");
}

#[test]
fn the_probe_passes_in_every_emulated_mode() {
    for (mode, machine, cores) in [
        (Mode::Deterministic, Machine::Microvm, 1),
        (Mode::Deterministic, Machine::Q35, 2),
        (Mode::Deterministic, Machine::Microvm, 4),
        (Mode::Threads, Machine::Microvm, 1),
        (Mode::Threads, Machine::Q35, 2),
        (Mode::Threads, Machine::Microvm, 4),
    ] {
        let outcome = Guest::new("fork-join")
            .mode(mode)
            .machine(machine)
            .cores(cores)
            .word("probe=on")
            .succeed();
        let line = outcome
            .transcript
            .of_kind("probe")
            .next()
            .expect("a probe line");
        assert_eq!(
            line.number_at("steps"),
            Some(2 * cores),
            "{mode}, {machine}"
        );
        assert_eq!(outcome.transcript.of_kind("fork_join").count(), 0);
    }
}
