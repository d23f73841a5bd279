//! What the kernel says of its limits, brought about on purpose: output that does not
//! fit is counted, stacks that faults have cost are missed, and a budget counts
//! execution alone.

use alloc::string::ToString;
use alloc::vec;
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use kernel::{Ending, Machine, println};
use sched_dag::DagId;

const PERIOD: Duration = Duration::from_millis(20);
const JOBS: u64 = 10;

/// Returns a DAG of one subtask, of both one name.
fn alone(name: &str, jobs: u64, attributes: SubtaskAttributes, work: fn()) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(jobs).relative_deadline(PERIOD);
    dag.register_periodic_subtask(work, vec![], PERIOD, attributes);
    dag
}

/// Prints more in one job than may wait.
pub(crate) fn flood(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    let talk = || (0..20).for_each(|_| println!("{:>1000}", "much"));
    let dag = alone("talkative", 1, SubtaskAttributes::named("talk"), talk);
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}

/// Makes one DAG after the other panic, until a commit finds no memory for stacks.
pub(crate) fn spend_stacks(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    for _ in 0..1000 {
        let attributes = SubtaskAttributes::named("panics");
        let dag = alone("careless", 1, attributes, || panic!("on purpose"));
        finish_create_dags(&[dag])?;
        machine.run()?;
    }
    Err(Ending::Failure("no commit was refused".to_string()))
}

/// Keeps an instance suspended for longer than its budget.
pub(crate) fn suspend(machine: &Machine) -> Result<(), Ending> {
    const URGENT: Duration = Duration::from_millis(4);
    const LONG: Duration = Duration::from_millis(2);
    machine.options().finish(&["test"])?;
    let attributes = SubtaskAttributes::named("urgent").priority(1);
    let urgent = alone("urgent", JOBS, attributes, || {
        execute_for(URGENT, Occupation::Hold);
    });
    urgent.offset(LONG / 2);
    let attributes = SubtaskAttributes::named("long").priority(2);
    let long = alone("long", JOBS, attributes.budget(LONG * 3 / 2), || {
        execute_for(LONG, Occupation::Hold);
    });
    finish_create_dags(&[urgent, long])?;
    let run = machine.run()?;
    for job in 0..JOBS {
        let end_ns = run.record().completion_ns(DagId(1), job);
        let end = end_ns.map(Duration::from_nanos).unwrap_or_default();
        let release = PERIOD * u32::try_from(job).unwrap_or(0);
        assert!(
            end >= release + LONG + URGENT,
            "job {job} was not suspended"
        );
    }
    Ok(())
}
