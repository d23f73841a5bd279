//! A subtask that takes longer than its WCET says, in jobs 2 and 3 of 5, where a bound
//! was demanded and proven.

use alloc::vec;
use core::time::Duration;

use fass::{Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use kernel::{Ending, Machine};

/// Runs it and is content; with `accept=yes` it says so beforehand.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let ms = Duration::from_millis;
    let accepts = (machine.options()).choice("accept", &[("no", false), ("yes", true)])?;
    machine.options().finish(&["test", "accept"])?;
    if accepts {
        machine.accept_exceeded_bounds();
    }
    let dag = create_dag();
    dag.name("guess").jobs(5).relative_deadline(ms(10));
    dag.demand_proof();
    let mut job = 0;
    let takes = move || {
        job += 1;
        let time = [ms(0), ms(0), ms(3), ms(4), ms(0)][job - 1];
        execute_for(time, Occupation::Hold);
    };
    let attributes = SubtaskAttributes::named("takes").wcet(ms(1));
    dag.register_periodic_subtask(takes, vec![], ms(10), attributes);
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}
