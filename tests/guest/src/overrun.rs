//! A closure looping beyond its budget; the host finds the line of the loop.

use core::hint::{black_box, spin_loop};
use core::time::Duration;

use fass::finish_create_dags;
use kernel::{AppError, Machine};

use crate::single::{named, single};

/// Runs the closure, inlined into the kernel's call, until its budget ends it.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    let attributes = named("loops").budget(Duration::from_millis(1));
    let dag = single("endless", 3, attributes, || {
        while black_box(true) {
            spin_loop();
        }
    });
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}
