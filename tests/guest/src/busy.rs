//! A DAG of 1 kHz without end next to one of ten jobs, for a person at the console to
//! end.

use alloc::vec;
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine};

/// Runs both until the console ends them.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    let ten = dag("ten", Duration::from_millis(25));
    ten.jobs(10);
    finish_create_dags(&[dag("endless", Duration::from_millis(1)), ten])?;
    machine.run()?;
    Err(Ending::Failure("the run has ended by itself".into()))
}

fn dag(name: &str, period: Duration) -> Dag {
    let dag = create_dag();
    dag.name(name).relative_deadline(period);
    dag.register_periodic_subtask(|| (), vec![], period, SubtaskAttributes::named(name));
    dag
}
