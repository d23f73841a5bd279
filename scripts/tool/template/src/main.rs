//! Boots the app and reports on its jobs.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;

use fass::finish_create_dags;
use kernel::report::Ns;
use kernel::{AppError, Machine, Run, println};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let jobs = options.number("jobs", 1..=100_000, 100)?;
    options.finish(&["jobs"])?;

    let commit = finish_create_dags(&app_template::build(jobs))?;
    for warning in commit.warnings() {
        println!("warning: {warning}");
    }
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;

    for dag in run.task_set().dags() {
        report(&run, dag.name());
    }
    println!("{} allocations while jobs ran", run.allocations());
    // A fault is a failure already, but a missed deadline, which depends on the load, is not:
    // to make it one, check `misses` here.
    match run.violations().count() {
        0 => Ok(()),
        count => Err(AppError::Failure(format!(
            "{count} violations of the model's rules"
        ))),
    }
}

/// Reports on the jobs of a DAG.
fn report(run: &Run, name: &str) {
    let statistics = run.statistics(name);
    println!(
        "{name}: {} jobs complete, {} deadlines missed",
        statistics.completed, statistics.misses
    );
    // Of all jobs; `Run::record` has the latest ones only, if there are more than fit into memory.
    // The maximum is exact, the median up to 3.2 % too large.
    let task_set = run.task_set();
    let times = run.times().map(|times| times.dag(task_set.find(name)));
    let response_times = times.map(|times| times.response_time.distribution());
    let response_times = response_times.unwrap_or_default();
    // A DAG that has released no job has no times.
    if response_times.count() > 0 {
        println!(
            "{name}: response time: median {}, at most {}",
            Ns(response_times.median()),
            Ns(response_times.max())
        );
    }
}
