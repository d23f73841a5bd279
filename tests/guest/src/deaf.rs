//! A subtask that takes no interrupts any more, for another core to notice.

use alloc::vec;
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use kernel::{Ending, Machine};

use crate::kernel_crimes;

/// Runs it on the first core that the scheduler gives.
pub(crate) fn alone(machine: &Machine) -> Result<(), Ending> {
    run(machine, &[deaf()])
}

/// Runs it on another one: the first holds.
pub(crate) fn beside(machine: &Machine) -> Result<(), Ending> {
    let hold = || execute_for(Duration::from_secs(60), Occupation::Hold);
    run(machine, &[dag("holds", hold), deaf()])
}

fn run(machine: &Machine, dags: &[Dag]) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    finish_create_dags(dags)?;
    machine.run().map(drop)
}

fn deaf() -> Dag {
    dag("deaf", || {
        kernel_crimes::take_no_interrupts();
    })
}

fn dag(name: &str, body: impl FnMut() + Send + 'static) -> Dag {
    let period = Duration::from_millis(10);
    let dag = create_dag();
    dag.name(name).jobs(1).relative_deadline(period);
    dag.register_periodic_subtask(body, vec![], period, SubtaskAttributes::named(name));
    dag
}
