//! What the tests of a run's life need: DAGs that tick, DAGs that ask, and what is told of both.

#![allow(dead_code, reason = "one test program uses this")]

use fass::{Dag, Switch};
use virtual_time::Report;

use super::sharing::{every, named, work};

/// A DAG of one subtask that executes for 1 ms, every 10 ms.
pub(crate) fn ticking(name: &str, jobs: u64) -> Dag {
    let dag = every(10, name);
    if jobs > 0 {
        dag.jobs(jobs);
    }
    dag.register_untyped_subtask(|_job| work(1), named("tick"));
    dag
}

/// A DAG of one subtask that executes for so many milliseconds, every 20 ms, and asks for
/// something of another DAG in each job.
pub(crate) fn asking(
    of: &Dag,
    takes: u64,
    jobs: u64,
    mut ask: impl FnMut(Switch<'_>, u64) + Send + 'static,
) -> Dag {
    let dag = every(20, "asks");
    dag.jobs(jobs);
    let function = move |switch: Switch<'_>, job| {
        ask(switch, job);
        work(takes);
    };
    dag.using(of.switching())
        .register_untyped_subtask(function, named("ask"));
    dag
}

/// The events of these words, with the times in milliseconds.
pub(crate) fn events(report: &Report, words: &[&str]) -> Vec<String> {
    let lines = report.event_lines().into_iter().filter_map(|line| {
        let (time, what) = line.split_once(' ')?;
        let word = what.split(' ').next()?;
        let time: f64 = time.parse().ok()?;
        words
            .contains(&word)
            .then(|| format!("{} {what}", time / 1e6))
    });
    lines.collect()
}
