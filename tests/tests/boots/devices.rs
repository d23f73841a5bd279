//! Devices of PCI, with messages to a core.

use harness::{Guest, Members, Said};
use tool::qemu::Machine;
use views::protocol::Status;

#[test]
fn each_message_of_a_device_takes_one_interrupt_on_its_core() {
    for cores in [1, 2] {
        let guest = Guest::test("devices").machine(Machine::Q35).cores(cores);
        let outcome = guest.altered(&[], "-device edu").succeed();
        let lines: Vec<_> = outcome.transcript.of_kind("devices").collect();
        assert_eq!(lines.len(), usize::try_from(cores).unwrap());
        for line in lines {
            let number = |name| line.number(name);
            assert_eq!(
                [number("came"), number("releases"), number("elsewhere")],
                [500, 500, 0]
            );
            // The message's own interrupt has released the DAG. Two cores take time slices, by
            // their timers.
            let timer_interrupts = number("timer_interrupts");
            assert!(cores > 1 || timer_interrupts < 100, "{timer_interrupts}");
        }
        for said in [
            "PCI function 00:01.0 has no MSI-X or MSI of that number; use a device that has",
            &format!(
                "PCI function 00:01.0 finds no core 9; tie it to one of 0 to {}",
                cores - 1
            ),
            "PCI function 00:01.0 finds all 8 lines of devices taken; use fewer devices",
        ] {
            assert!(outcome.serial.contains(said), "{}", outcome.serial);
        }
    }
}

#[test]
fn a_message_ends_a_wait_on_whichever_core_it_comes() {
    let guest = Guest::test("devices_answer").machine(Machine::Q35).cores(2);
    let outcome = guest.altered(&[], "-device edu").succeed();
    let answered = outcome.lines("answered");
    let answered = answered.iter().map(|line| line.number("answered"));
    let answered: Vec<u64> = answered.collect();
    assert_eq!(answered, [20, 20]);
}

#[test]
fn a_machine_without_devices_says_what_it_lacks() {
    let edu = Guest::test("devices");
    for (guest, remedy) in [
        (
            edu.clone(),
            "no PCI configuration space in memory; boot a PC with PCI Express, in QEMU by `--machine q35`, with a network by `--net user`",
        ),
        (
            edu.machine(Machine::Q35),
            "no PCI function 1234:11e8; add the device, in QEMU by `--device NAME`",
        ),
    ] {
        let reason = guest.end_in(Status::Failure).reason();
        assert_eq!(reason, format!("the machine has {remedy}"));
    }
}
