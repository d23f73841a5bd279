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

#[test]
fn four_processors() {
    let transcript = bochs::succeed("fork-join", "jobs=2 subtasks=2", "ryzen", 4);
    let boot = transcript.of_kind("boot").next().expect("a boot line");
    assert_eq!(boot.number_at("cpus"), Some(4), "{}", boot.text);
    let run = transcript.of_kind("fork_join").next().expect("a result");
    assert_eq!(run.number_at("joins"), Some(2), "{}", run.text);
}
