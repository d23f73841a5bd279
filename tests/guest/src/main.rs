//! Runs one boot test in the guest: the one that `test=NAME` names.

#![no_std]
#![no_main]

extern crate alloc;

mod checksum;
mod preemption;
mod storm;

use alloc::format;

use faults::crimes::{CRIMES, Unpunished};
use kernel::{Ending, Machine, json};

kernel::entry!(main);

/// A test: it prints its findings and fails by its ending, or by a panic.
type Test = fn(&Machine) -> Result<(), Ending>;

const TESTS: [(&str, Test); 8] = [
    ("commit_faults", commit_faults),
    ("panic", crime),
    ("null_write", crime),
    ("stack_overflow", crime),
    ("write_to_code", crime),
    ("undefined_instruction", crime),
    ("preemption", preemption::run),
    ("storm", storm::run),
];

fn main(machine: &Machine) -> Result<(), Ending> {
    let test: Test = machine.options().choice("test", &TESTS)?;
    test(machine)
}

/// Commits every faulty DAG and prints what the commit says of it.
fn commit_faults(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    guest_tests::faults::provoke(|case, fault, message| {
        json::emit("commit_fault", |line| {
            line.text("case", case)
                .text("fault", fault)
                .text("message", message);
        });
    });
    Ok(())
}

/// Commits the crime that the test is named after, outside any subtask.
fn crime(machine: &Machine) -> Result<(), Ending> {
    let name = machine.options().text("test");
    if let Some((name, crime)) = CRIMES.iter().find(|(crime, _)| Some(*crime) == name) {
        let Unpunished = crime();
        return Err(Ending::Failure(format!(
            "the crime `{name}` was not stopped"
        )));
    }
    Ok(())
}
