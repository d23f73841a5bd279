//! A closure that loops beyond its budget, for the host to find its line.

use alloc::vec;
use core::hint::{black_box, spin_loop};
use core::time::Duration;

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine};

/// Runs it, inlined into the kernel's call of it, until its budget ends it.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let period = Duration::from_millis(10);
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    let dag = create_dag();
    dag.name("endless").jobs(3).relative_deadline(period);
    let loops = || {
        while black_box(true) {
            spin_loop();
        }
    };
    let attributes = SubtaskAttributes::named("loops").budget(Duration::from_millis(1));
    dag.register_periodic_subtask(loops, vec![], period, attributes);
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}
