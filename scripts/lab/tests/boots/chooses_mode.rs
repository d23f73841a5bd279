//! The mode that a command of the laboratory uses, as the tool's own tests hold it of its commands.

use crate::support::assert_kvm_refused;

#[test]
fn a_named_kvm_that_is_of_no_use_is_refused_by_every_command_that_boots() {
    assert_kvm_refused(&[
        "soak --short --mode kvm",
        "oracle schedules --in-kernel --mode kvm --cores-up-to 1 tests/oracle/schedules.txt",
        "bench hand-off --mode kvm",
        "bench join-latency --mode kvm --out target/no-such-folder",
    ]);
}
