//! A subtask that does not return, next to a DAG that ends well.

use alloc::vec;
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use kernel::{Ending, Machine};

/// Runs both until the budget ends the one, long after it has been noticed.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    let holds = SubtaskAttributes::named("holds").budget(Duration::from_secs(10));
    let hold = || execute_for(Duration::MAX, Occupation::Hold);
    let returns = SubtaskAttributes::named("returns");
    finish_create_dags(&[dag("good", returns, || ()), dag("endless", holds, hold)])?;
    machine.run().map(drop)
}

fn dag(name: &str, attributes: SubtaskAttributes, body: impl FnMut() + Send + 'static) -> Dag {
    let period = Duration::from_millis(10);
    let dag = create_dag();
    dag.name(name).jobs(3).relative_deadline(period);
    dag.register_periodic_subtask(body, vec![], period, attributes);
    dag
}
