//! The image boots from an ISO in Bochs, which is stricter about a PC's hardware than QEMU.

use harness::bochs;

/// Boots the demo with so many processors, whose timers all have to work: a subtask holds its
/// core until its core's timer ends that.
fn all_cores_work(model: &str, cores: u64) {
    let transcript = bochs::succeed("fork-join", "jobs=2 subtasks=2", model, cores);
    let boot = transcript.of_kind("boot").next().expect("a boot line");
    assert_eq!(boot.number_at("cpus"), Some(cores), "{}", boot.text);
    let run = transcript.of_kind("fork_join").next().expect("a result");
    assert_eq!(run.number_at("joins"), Some(2), "{}", run.text);
}

#[test]
fn two_processors() {
    all_cores_work("corei7_skylake_x", 2);
}

#[test]
fn four_processors() {
    all_cores_work("ryzen", 4);
}
