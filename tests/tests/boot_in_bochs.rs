//! The image boots from an ISO in Bochs, which is stricter about a PC's hardware than QEMU.

use harness::bochs;

/// The probe asks each core for its timer's interrupt and for another core's, which comes of
/// a local APIC that was enabled before its timer was unmasked.
#[test]
fn two_processors_take_interrupts() {
    let transcript = bochs::succeed("fork-join", "probe=on", "corei7_skylake_x", 2);
    let probe = transcript.of_kind("probe").next().expect("a probe line");
    assert_eq!(probe.number_at("steps"), Some(4), "{}", probe.text);
}

/// As a firmware leaves it on a PC with many processors. The rate of the counter that this
/// processor states lacks the crystal, so another clock has to check it.
#[test]
fn two_processors_by_x2apic() {
    let words = "x2apic=on jobs=2 subtasks=2";
    let transcript = bochs::succeed("fork-join", words, "corei7_skylake_x", 2);
    let boot = transcript.of_kind("boot").next().expect("a boot line");
    assert!(boot.text.contains("\"x2apic\":true"), "{}", boot.text);
    let promised = "\"counter_invariant\":true,\"timer_in_halt\":true";
    assert!(boot.text.contains(promised), "{}", boot.text);
    assert_eq!(boot.text_at("clock"), Some("acpi-pm-timer"));
    assert_eq!(boot.text_at("clock_check"), Some("hpet"), "{}", boot.text);
    assert!(
        boot.text.contains("\"clock_undisputed\":true"),
        "{}",
        boot.text
    );
    let run = transcript.of_kind("fork_join").next().expect("a result");
    assert_eq!(run.number_at("joins"), Some(2), "{}", run.text);
}

/// As some firmware does for many processors, GRUB leaves the boot processor's local APIC in
/// x2APIC mode, by the register that says where it is. No word asks for that.
#[test]
fn x2apic_that_was_left_on_is_used() {
    let left_on = "wrmsr 0x1b 0xfee00d00";
    let words = "jobs=2 subtasks=2";
    let model = "corei7_skylake_x";
    let transcript = bochs::succeed_after(left_on, "fork-join", words, model, 2);
    let boot = transcript.of_kind("boot").next().expect("a boot line");
    assert!(boot.text.contains("\"x2apic\":true"), "{}", boot.text);
    assert_eq!(boot.number_at("cpus"), Some(2), "{}", boot.text);
    let run = transcript.of_kind("fork_join").next().expect("a result");
    assert_eq!(run.number_at("joins"), Some(2), "{}", run.text);
}

#[test]
fn four_processors() {
    let transcript = bochs::succeed("fork-join", "jobs=2 subtasks=2", "ryzen", 4);
    let boot = transcript.of_kind("boot").next().expect("a boot line");
    assert_eq!(boot.number_at("cpus"), Some(4), "{}", boot.text);
    let run = transcript.of_kind("fork_join").next().expect("a result");
    assert_eq!(run.number_at("joins"), Some(2), "{}", run.text);
}

/// Bochs refuses to restore what was not saved as the manual says.
#[test]
fn preempted_instances_keep_256_bits_of_each_register() {
    let words = "test=preemption work=halves rounds=1 ms=40";
    let transcript = bochs::succeed("guest-tests", words, "corei7_skylake_x", 2);
    let line = transcript.of_kind("preemption").next().expect("a result");
    assert!(line.text.contains("\"avx\":true"), "{}", line.text);
    assert_eq!(line.number_at("diverged"), Some(0), "{}", line.text);
    assert!(line.number_at("preemptions") > Some(0), "{}", line.text);
}
