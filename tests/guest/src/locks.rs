//! A lock that the least urgent DAGs enter again and again, one on each core, next to a DAG that is
//! proven.

use alloc::boxed::Box;
use alloc::format;
use alloc::vec::Vec;
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for};
use kernel::{AppError, Lock, Machine, json};

use crate::single::named;

/// How many jobs the proven DAG has.
const JOBS: u64 = 200;

const fn us(us: u64) -> Duration {
    Duration::from_micros(us)
}

/// The time of each section, in microseconds, which is a little less than the lock states.
const SECTION_US: u64 = 300;

/// Runs them.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.offer_overheads()?;
    machine.options().finish(&["test", "overheads"])?;
    let lock = Lock::new("registers", 0_u64).longest(us(SECTION_US + 10));
    let lock: &'static Lock<u64> = Box::leak(Box::new(lock));
    let enter = move || {
        lock.with(|count| {
            execute_for(us(SECTION_US), Occupation::Hold);
            *count += 1;
        });
    };
    let mut dags = Vec::from([proven(lock, enter, us(SECTION_US))]);
    for core in 0..machine.cores() {
        let attributes = named("low").priority(9).wcet(us(3 * SECTION_US + 30));
        let dag = create_dag();
        // It comes a little later in each job of the proven one.
        let period = us(16_013 + u64::from(core));
        dag.name(&format!("low{core}")).jobs(JOBS);
        dag.period(period).relative_deadline(period);
        dag.using(lock.entering(3))
            .source(move |()| (0..3).for_each(|_| enter()))
            .register(attributes);
        dags.push(dag);
    }
    let commit = fass::finish_create_dags(&dags)?;
    let answer = commit.answer("proven");
    let bound_ns = answer.verdict.bound().map_or(0, |bound| bound.as_nanos());
    let run = machine.run()?;
    json::emit("locks", |line| {
        line.number("bound_ns", u64::try_from(bound_ns).unwrap_or(u64::MAX))
            .number(
                "longest_ns",
                run.response_times_ns("proven").max().unwrap_or(0),
            )
            .number("entered", lock.with(|count| *count))
            .number("allocations", run.allocations())
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}

/// Builds the most urgent DAG: a source, two in parallel, and a join that enters a section.
fn proven(lock: &'static Lock<u64>, enter: impl Fn() + Send + 'static, section: Duration) -> Dag {
    let dag = create_dag();
    dag.name("proven").jobs(JOBS);
    dag.period(us(16_000)).relative_deadline(us(16_000));
    // The others come from before it to behind it.
    dag.offset(us(1_000));
    let attributes = |name: &str, more| {
        SubtaskAttributes::named(name)
            .priority(0)
            .wcet(us(42) + more)
    };
    let hold = |_| execute_for(us(40), Occupation::Hold);
    let source = dag.register_untyped_subtask(hold, attributes("source", Duration::ZERO));
    let join = dag.using(lock.entering(1));
    let join = join.register_untyped_subtask(move |(), _| enter(), attributes("join", section));
    for name in ["left", "right"] {
        let side = dag.register_untyped_subtask(hold, attributes(name, Duration::ZERO));
        dag.precede(&source, &side).precede(&side, &join);
    }
    dag
}
