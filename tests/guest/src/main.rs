//! Runs one boot test in the guest, named by `test=NAME`.

#![no_std]
#![no_main]

extern crate alloc;

mod attacks;
mod checksum;
mod cluster_scale;
mod delays;
#[allow(unsafe_code, reason = "a device may send messages")]
mod devices;
mod endless;
mod every_call;
mod input;
#[allow(unsafe_code, reason = "what the kernel must report")]
mod kernel_crimes;
mod large;
mod network;
mod occupation;
mod overrun;
mod preemption;
mod recorded;
mod scenarios;
mod single;
mod soak;
mod stacks;
mod storm;
#[allow(unsafe_code, reason = "registers that the compiler would spill")]
mod upper_halves;
mod values;
mod waits;
mod wires;

use faults::crimes::{Crime, Unpunished};
use kernel::{AppError, Machine};

kernel::entry!(main);

/// A test: it prints its findings. It fails by its result, or by a panic.
type Test = fn(&Machine) -> Result<(), AppError>;

const TESTS: &[(&str, Test)] = &[
    ("attack", attacks::run),
    ("crime", crime),
    ("cluster_scale", cluster_scale::run),
    ("delays", delays::run),
    ("devices", devices::run),
    ("devices_answer", devices::ask),
    ("starved", delays::starved),
    ("events", delays::events),
    ("deaf_alone", |machine| single::deaf(machine, false)),
    ("deaf_beside", |machine| single::deaf(machine, true)),
    ("preemption", preemption::run),
    ("occupation", occupation::run),
    ("endless", endless::run),
    ("every_call", every_call::run),
    ("exceeded", single::exceeded),
    ("input", input::run),
    ("large", large::run),
    ("network", network::run),
    ("overrun", overrun::run),
    ("recorded", recorded::run),
    ("stamped", recorded::stamped),
    ("recorded_long", recorded::long),
    ("scenarios", scenarios::run),
    ("soak", soak::run),
    ("stacks", stacks::run),
    ("stacks_of_chain", stacks::chain),
    ("stalled", single::stalled),
    ("left", single::keep),
    ("drop_panics", |machine| single::leave(machine, false)),
    ("drop_loops", |machine| single::leave(machine, true)),
    ("spend_stacks", single::spend_stacks),
    ("storm", storm::run),
    ("talkative", single::talkative),
    ("unnoticed", single::unnoticed),
    ("values", values::run),
    ("wires", wires::run),
    ("waits_cost", waits::cost),
    ("waits_wire", waits::wire),
];

fn main(machine: &Machine) -> Result<(), AppError> {
    let test: Test = machine.options().choice("test", TESTS)?;
    test(machine)
}

/// Commits the crime named by the command line, outside any subtask.
fn crime(machine: &Machine) -> Result<(), AppError> {
    let crimes: [&[(&str, Crime)]; 2] = [&faults::crimes::CRIMES, &kernel_crimes::CRIMES];
    let crime = machine.options().choice("crime", &crimes.concat())?;
    machine.options().finish(&["test", "crime"])?;
    let Unpunished = crime();
    Err(AppError::Failure("the crime was not stopped".into()))
}
