//! A fault in an app that does not look at faults.

use alloc::vec;
use core::time::Duration;

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine};

/// Runs a DAG whose subtask panics in its job 1, and is content.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let period = Duration::from_millis(10);
    machine.options().finish(&["test"])?;
    let dag = create_dag();
    dag.name("careless").jobs(3).relative_deadline(period);
    let mut jobs = 0;
    let panics = move || {
        jobs += 1;
        assert_eq!(jobs, 1, "a panic on purpose");
    };
    dag.register_periodic_subtask(panics, vec![], period, SubtaskAttributes::named("panics"));
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}
