//! DAGs without a limit of jobs, for a person at the console to look at, to set and to end.
//!
//! `left` is a fork-join each millisecond. Its source passes on the number of its runs, and its
//! sink checks that this number only grows: a DAG may rest, but no earlier value may come after.
//! `loop` is a chain every 5 ms, and its source reads parameters. `ten` has ten jobs.

use alloc::vec;
use core::time::Duration;

use fass::shared::Parameter;
use fass::{Dag, Occupation, create_dag, execute_for, finish_create_dags};
use kernel::{AppError, Machine, json};

use crate::single::{named, single};

const EXECUTION: Duration = Duration::from_micros(100);

/// Runs the DAGs until the console ends the run.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let gain = Parameter::new("gain", 0.5, 0.0..=2.0);
    let steps = Parameter::new("steps", 3_u32, 1..=9);
    machine.offer(&[&gain, &steps])?;
    machine.show_topics();
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let ten = single("ten", 10, named("ten"), || ());
    let dags = [left(), tuned(&gain, &steps), ten];
    machine.spread(&dags);
    finish_create_dags(&dags)?;
    machine.run()?;
    Err(AppError::Failure("the run has ended by itself".into()))
}

fn left() -> Dag {
    let (dag, period) = (create_dag(), Duration::from_millis(1));
    dag.name("left");
    let mut count = 0_u64;
    let counts = move || {
        count += 1;
        (count,)
    };
    dag.register_periodic_subtask(counts, vec!["l"], period, named("source"));
    for (name, output) in [("a", "l-a"), ("b", "l-b")] {
        let execute = |(count,): (u64,)| {
            execute_for(EXECUTION, Occupation::Hold);
            (count,)
        };
        let attributes = named(name).wcet(2 * EXECUTION);
        dag.register_subtask(execute, vec!["l"], vec![output], attributes);
    }
    let mut last = 0;
    let join = move |(a, b): (u64, u64)| {
        assert_eq!((a, b), (last + 1, a), "each value comes once, to its job");
        last = a;
    };
    dag.register_sink_subtask(join, vec!["l-a", "l-b"], period, named("sink"));
    dag
}

/// Makes the chain with parameters. It prints each new pair of values found by a job.
fn tuned(gain: &Parameter<f64>, steps: &Parameter<u32>) -> Dag {
    let (dag, period) = (create_dag(), Duration::from_millis(5));
    dag.name("loop").record::<f64>("gain");
    let read = |both: (f64, u32)| (both,);
    dag.period(period)
        .using((gain.reading(), steps.reading()))
        .source(read)
        .writes(&["both"])
        .register(named("read"));
    let part = |(both,): ((f64, u32),)| both;
    dag.register_subtask(part, vec!["both"], vec!["gain", "steps"], named("part"));
    let mut last = None;
    let show = move |now: (f64, u32)| {
        if last.replace(now) != Some(now) {
            json::emit("tuned", |line| {
                line.text("gain", now.0).number("steps", now.1);
            });
        }
    };
    dag.register_sink_subtask(show, vec!["gain", "steps"], period, named("show"));
    dag
}
