//! Runs one boot test in the guest: the one that `test=NAME` names.

#![no_std]
#![no_main]

extern crate alloc;

mod attacks;
mod busy;
mod checksum;
mod cluster_scale;
mod clusters;
mod computing;
mod deaf;
mod endless;
mod exceeded;
#[allow(unsafe_code, reason = "what the kernel must report")]
mod kernel_crimes;
mod large;
mod left;
mod limits;
mod occupation;
mod overrun;
mod preemption;
mod recorded;
mod scenarios;
mod sharing;
mod stacks;
mod stalled;
mod storm;
mod times;
mod tuned;
mod unnoticed;
#[allow(unsafe_code, reason = "registers that the compiler would spill")]
mod upper_halves;
mod values;

use faults::crimes::{CRIMES, Unpunished};
use kernel::{Ending, Machine, json};

kernel::entry!(main);

/// A test: it prints its findings and fails by its ending, or by a panic.
type Test = fn(&Machine) -> Result<(), Ending>;

const TESTS: [(&str, Test); 43] = [
    ("attack", attacks::run),
    ("commit_faults", commit_faults),
    ("panic", crime),
    ("null_write", crime),
    ("stack_overflow", crime),
    ("write_to_code", crime),
    ("undefined_instruction", crime),
    ("avx", |_| unpunished(kernel_crimes::use_avx())),
    ("nmi", |_| unpunished(kernel_crimes::raise_nmi())),
    ("machine_check", |_| {
        unpunished(kernel_crimes::raise_machine_check())
    }),
    (
        "double_fault",
        |_| unpunished(kernel_crimes::fault_doubly()),
    ),
    (
        "exit_port",
        |_| unpunished(kernel_crimes::end_the_machine()),
    ),
    ("clusters", clusters::run),
    ("cluster_scale", cluster_scale::run),
    ("clusters_auto", clusters::auto),
    ("computing", computing::run),
    ("deaf_alone", deaf::alone),
    ("deaf_beside", deaf::beside),
    ("preemption", preemption::run),
    ("occupation", occupation::run),
    ("busy", busy::run),
    ("endless", endless::run),
    ("exceeded", exceeded::run),
    ("flood", limits::flood),
    ("large", large::run),
    ("overrun", overrun::run),
    ("recorded", recorded::run),
    ("recorded_crash", recorded::crash),
    ("recorded_long", recorded::long),
    ("scenarios", scenarios::run),
    ("sharing", sharing::run),
    ("stacks", stacks::run),
    ("stacks_of_chain", stacks::chain),
    ("stalled", stalled::run),
    ("left", left::keep),
    ("drop_panics", |machine| left::behind(machine, false)),
    ("drop_loops", |machine| left::behind(machine, true)),
    ("spend_stacks", limits::spend_stacks),
    ("storm", storm::run),
    ("suspend", limits::suspend),
    ("tuned", tuned::run),
    ("unnoticed", unnoticed::run),
    ("values", values::run),
];

fn main(machine: &Machine) -> Result<(), Ending> {
    let test: Test = machine.options().choice("test", &TESTS)?;
    test(machine)
}

/// Commits every faulty DAG and prints what the commit says of it.
fn commit_faults(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    guest_tests::faults::provoke(|case, fault, message| {
        json::emit("provoked", |line| {
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
    let crime = CRIMES.iter().find(|(crime, _)| Some(*crime) == name);
    crime.map_or(Ok(()), |(_, crime)| unpunished(crime()))
}

fn unpunished(Unpunished: Unpunished) -> Result<(), Ending> {
    Err(Ending::Failure("the crime was not stopped".into()))
}
