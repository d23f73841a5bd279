//! The image boots from an ISO in Bochs, an emulator stricter about a PC's hardware than QEMU.

use harness::{Members, Said, bochs};
use views::protocol::MachineLine;

const SKYLAKE: &str = "corei7_skylake_x";

/// Boots the demo after a command of GRUB's, and returns the guest's `boot` line about the PC.
fn booted(command: &str, word: &str, model: &str, cores: u64) -> MachineLine {
    let words = format!("{word} jobs=2 subtasks=2");
    let transcript = bochs::succeed(command, "fork-join", &words, model, cores);
    transcript.line("fork_join").has([("joins", 2)]);
    let boot = transcript.line("boot").clone();
    boot.has([("cpus", cores)]);
    boot
}

/// The probe asks each core for its timer's interrupt and for another core's interrupt. Both come
/// only if the local APIC was enabled before its timer was unmasked.
#[test]
fn two_processors_take_interrupts() {
    let transcript = bochs::succeed("", "fork-join", "probe=on", SKYLAKE, 2);
    transcript.line("probe").has([("steps", 4)]);
}

/// Firmware leaves PCs with many processors in this mode. The processor states the counter's rate
/// without the crystal's, so another clock has to check the rate.
#[test]
fn two_processors_by_x2apic() {
    let boot = booted("", "x2apic=on", SKYLAKE, 2);
    for part in [
        "\"x2apic\":true",
        "\"counter_invariant\":true,\"timer_in_halt\":true",
        "\"clock_undisputed\":true",
    ] {
        assert!(boot.text.contains(part), "{}", boot.text);
    }
    boot.reads([("clock", "acpi-pm-timer"), ("clock_check", "hpet")]);
}

/// Like some firmware for many processors, GRUB leaves the boot processor's local APIC in x2APIC
/// mode, by the register with the APIC's address. No word asks for this mode.
#[test]
fn x2apic_that_was_left_on_is_used() {
    let boot = booted("wrmsr 0x1b 0xfee00d00", "", SKYLAKE, 2);
    assert!(boot.text.contains("\"x2apic\":true"), "{}", boot.text);
}

#[test]
fn four_processors() {
    booted("", "", "ryzen", 4);
}

/// Bochs refuses to restore registers not saved by the manual's rules.
#[test]
fn preempted_instances_keep_256_bits_of_each_register() {
    let words = "test=preemption rounds=1 ms=40";
    let transcript = bochs::succeed("", "guest-tests", words, SKYLAKE, 2);
    let line = transcript.line("preemption");
    assert!(line.text.contains("\"avx\":true"), "{}", line.text);
    line.has([("diverged", 0)]);
    assert!(line.number("preemptions") > 0, "{}", line.text);
}
