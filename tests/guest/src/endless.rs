//! Two DAGs without a limit of jobs, for a person at the console to end.
//!
//! `left` is a fork-join every 5 ms, `right` a chain every 7 ms. Each source
//! hands on how often it has run, and each sink checks that this only grows: a
//! DAG may rest, and no value of before may come after.

use alloc::vec;
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use kernel::{Ending, Machine};

const EXECUTION: Duration = Duration::from_micros(300);

/// Runs both until the console ends them.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let dags = [left(), right()];
    machine.spread(&dags);
    finish_create_dags(&dags)?;
    machine.run()?;
    Err(Ending::Failure("the run has ended by itself".into()))
}

fn left() -> Dag {
    let (dag, period) = (create_dag(), Duration::from_millis(5));
    dag.name("left");
    let named = SubtaskAttributes::named;
    dag.register_periodic_subtask(counter(), vec!["l"], period, named("source"));
    let execute = |(count,): (u64,)| {
        execute_for(EXECUTION, Occupation::Hold);
        (count,)
    };
    dag.register_subtask(
        execute,
        vec!["l"],
        vec!["l-a"],
        named("a").wcet(2 * EXECUTION),
    );
    dag.register_subtask(
        execute,
        vec!["l"],
        vec!["l-b"],
        named("b").wcet(2 * EXECUTION),
    );
    let mut check = growing();
    let join = move |(a, b): (u64, u64)| {
        assert_eq!(a, b, "a join of values of one job");
        check(a);
    };
    dag.register_sink_subtask(join, vec!["l-a", "l-b"], period, named("sink"));
    dag
}

fn right() -> Dag {
    let (dag, period) = (create_dag(), Duration::from_millis(7));
    dag.name("right");
    let named = SubtaskAttributes::named;
    dag.register_periodic_subtask(counter(), vec!["r"], period, named("source"));
    let mut check = growing();
    let sink = move |(count,): (u64,)| check(count);
    dag.register_sink_subtask(sink, vec!["r"], period, named("sink"));
    dag
}

fn counter() -> impl FnMut() -> (u64,) + Send {
    let mut count = 0u64;
    move || {
        count += 1;
        (count,)
    }
}

fn growing() -> impl FnMut(u64) + Send {
    let mut last = 0;
    move |count| {
        assert_eq!(count, last + 1, "each value comes once");
        last = count;
    }
}
