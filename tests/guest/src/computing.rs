//! Functions that compute, on all cores at once, next to one that is soon done.
//!
//! Every core is to have a function that never waits: no halt, no `pause`, no look at the
//! clock. Next to them a DAG of 1 ms period has an empty function, and the highest priority.
//! The word `innocent=yes` gives each computing function a budget that it does not use up
//! by itself, but would if it had to answer for the time in which others compute.

use alloc::format;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use fork_join::compute;
use kernel::{Ending, Machine, json};
use sched_dag::DagId;

/// Of the empty function.
const PERIOD: Duration = Duration::from_millis(1);

/// The time in which all jobs are released.
const LENGTH: Duration = Duration::from_millis(300);

/// What all cores together are to compute in a period of theirs.
const ROUNDS: u64 = 120;

/// Of what computes; of which it is to take up some three quarters.
const COMPUTING_PERIOD: Duration = Duration::from_millis(5);

/// Runs them, and reports how long the quick one had to wait.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let options = machine.options();
    let is_innocent = options.choice("innocent", &[("no", false), ("yes", true)])?;
    options.finish(&["test", "innocent"])?;
    let rounds = ROUNDS / u64::from(machine.cores());
    let start_ns = fass::now_ns();
    let expected = compute(rounds, 1);
    let alone_ns = fass::now_ns() - start_ns;

    let quick = create_dag();
    quick.name("quick").relative_deadline(PERIOD).jobs(300);
    let attributes = SubtaskAttributes::named("empty").priority(0);
    // It takes next to nothing, but waits for others' turns.
    let attributes = attributes.wcet(Duration::from_micros(50));
    quick.register_periodic_subtask(|| (), vec![], PERIOD, attributes);
    let wrong = Arc::new(AtomicU64::new(0));
    let budget = is_innocent.then(|| Duration::from_nanos(alone_ns + alone_ns / 2));
    let mut dags = vec![quick];
    dags.extend((0..machine.cores()).map(|core| computing(core, rounds, expected, budget, &wrong)));
    for answer in finish_create_dags(&dags)?.answers() {
        kernel::println!("{answer}");
    }
    let run = machine.run()?;

    let quick = run.task_set().find("quick");
    let longest_ns = run.response_times_ns(quick).max().unwrap_or(0);
    let dags = (0..run.task_set().dags().len()).map(|dag| u32::try_from(dag).map_or(quick, DagId));
    let misses: Vec<u64> = dags.map(|dag| run.statistics(dag).misses).collect();
    let wrong = wrong.load(Ordering::Relaxed);
    json::emit("computing", |line| {
        line.number("cpus", machine.cores())
            .number("alone_ns", alone_ns)
            .number("longest_response_ns", longest_ns)
            .number("jobs", run.statistics(quick).completed)
            .number("misses", misses[0])
            .number("computing_misses", misses[1..].iter().sum::<u64>())
            .number("wrong", wrong)
            .number("violations", run.violations().count() as u64)
            .number("allocations", run.allocations());
    });
    if wrong > 0 {
        return Err(Ending::Failure(format!("{wrong} results are wrong")));
    }
    Ok(())
}

/// Builds a DAG of one function that computes.
fn computing(
    core: u32,
    rounds: u64,
    expected: u64,
    budget: Option<Duration>,
    wrong: &Arc<AtomicU64>,
) -> Dag {
    let dag = create_dag();
    let jobs = LENGTH.as_millis() / COMPUTING_PERIOD.as_millis();
    dag.name(&format!("computing-{core}"))
        .jobs(u64::try_from(jobs).unwrap_or(1))
        .relative_deadline(COMPUTING_PERIOD);
    let wrong = wrong.clone();
    let function = move || {
        let is_wrong = compute(rounds, 1) != expected;
        wrong.fetch_add(u64::from(is_wrong), Ordering::Relaxed);
    };
    let attributes = SubtaskAttributes::named("computes").priority(1 + core);
    let attributes = attributes.wcet(COMPUTING_PERIOD);
    let attributes = match budget {
        Some(budget) => attributes.budget(budget),
        None => attributes,
    };
    dag.register_periodic_subtask(function, vec![], COMPUTING_PERIOD, attributes);
    dag
}
