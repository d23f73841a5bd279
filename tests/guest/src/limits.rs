//! The kernel at its limits, brought there on purpose: output that does not fit is counted,
//! the stacks that faults have taken come back, and a budget counts execution alone.

use alloc::format;
use alloc::vec;
use alloc::vec::Vec;
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

/// Makes many DAGs panic at once that no stack was made for, as they cannot be suspended: again
/// and again.
pub(crate) fn spend_stacks(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    let mut first = None;
    for _ in 0..4 {
        let careless = |number: u32| {
            let attributes = SubtaskAttributes::named("panics");
            alone(
                &format!("careless-{number}"),
                1,
                attributes.non_preemptive(),
                || panic!("on purpose"),
            )
        };
        finish_create_dags(&(0..40).map(careless).collect::<Vec<_>>())?;
        let run = machine.run()?;
        assert!((0..40).all(|dag| run.statistics(DagId(dag)).faults == 1));
        let now = machine.resources();
        let stacks = (now.contexts, now.contexts_free);
        assert_eq!((stacks.0, *first.get_or_insert(stacks)), (stacks.1, stacks));
    }
    Ok(())
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
    let long = run.task_set().find("long");
    for job in 0..JOBS {
        let end_ns = run.record().completion_ns(long, job);
        let end = end_ns.map(Duration::from_nanos).unwrap_or_default();
        let release = PERIOD * u32::try_from(job).unwrap_or(0);
        assert!(
            end >= release + LONG + URGENT,
            "job {job} was not suspended"
        );
    }
    Ok(())
}
