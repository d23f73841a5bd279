//! Boot tests as a Linux program: the tests able to run there, and the suite of scenarios for a
//! mechanism found only in a guest.

extern crate alloc;
extern crate kernel_on_linux as kernel;

use std::process::ExitCode;

use kernel::{AppError, Machine};

#[path = "../src/every_call.rs"]
mod every_call;
#[path = "../src/scenarios.rs"]
mod suite;

kernel::entry!(run);

fn run(machine: &Machine) -> Result<(), AppError> {
    let tests = [
        ("scenarios", suite::run as fn(&Machine) -> _),
        ("every_call", every_call::run),
    ];
    machine.options().choice("test", &tests)?(machine)
}

fn main() -> ExitCode {
    program()
}
