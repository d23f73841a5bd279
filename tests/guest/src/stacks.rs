//! Stacks stated by subtasks, and the measured use of each.

use alloc::format;
use alloc::vec;
use core::hint::black_box;
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{AppError, Machine, json};

const PERIOD: Duration = Duration::from_millis(10);

/// An array larger than a stack of the default size.
const ARRAY_BYTES: usize = 100 << 10;

/// Runs a DAG with a large array in its second subtask and none in the two others; then commits a
/// DAG stating a larger stack.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    finish_create_dags(&[deep(256 << 10)])?;
    machine.run()?;
    let refused = finish_create_dags(&[deep(512 << 10)]).err();
    let refused = refused.map(|error| format!("{error}"));
    match refused {
        Some(text) if text.contains("512 KiB, and the first commit has settled 256 KiB") => Ok(()),
        other => Err(AppError::Failure(format!("{other:?}"))),
    }
}

fn deep(stack_bytes: u64) -> Dag {
    let dag = create_dag();
    dag.name("deep").jobs(20);
    let named = SubtaskAttributes::named;
    let source = || (1_u8,);
    dag.register_periodic_subtask(source, vec!["first"], PERIOD, named("shallow"));
    let array = |(first,): (u8,)| {
        let array = black_box([first; ARRAY_BYTES]);
        (array[ARRAY_BYTES - 1],)
    };
    let deep = named("deep").stack_bytes(stack_bytes);
    dag.register_subtask(array, vec!["first"], vec!["last"], deep);
    let sink = |(last,): (u8,)| assert_eq!(last, 1);
    dag.register_sink_subtask(sink, vec!["last"], PERIOD, named("sink"));
    dag
}

/// Commits and runs a chain of ten thousand subtasks.
pub(crate) fn chain(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    let dag = create_dag();
    dag.name("chain").jobs(2).in_flight(2);
    dag.period(Duration::from_secs(1));
    dag.relative_deadline(Duration::from_secs(1));
    let register = || dag.register_untyped_subtask(|_| (), SubtaskAttributes::default());
    let mut last = register();
    for _ in 1..10_000 {
        let next = register();
        dag.precede(&last, &next);
        last = next;
    }
    finish_create_dags(&[dag])?;
    let contexts = machine.resources().contexts;
    let run = machine.run()?;
    json::emit("stacks_of_chain", |line| {
        line.number("contexts", contexts as u64)
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}
