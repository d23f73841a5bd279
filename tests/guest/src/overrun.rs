//! A closure that loops beyond its budget, for the host to find its line.

use core::hint::{black_box, spin_loop};
use core::time::Duration;

use fass::finish_create_dags;
use kernel::{AppError, Machine};

use crate::single::{named, single};

/// Runs it, inlined into the kernel's call of it, until its budget ends it.
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
