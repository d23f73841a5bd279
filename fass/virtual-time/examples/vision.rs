//! A first DAG, run in virtual time: `cargo run --example vision`.
//!
//! A camera's frames go to two functions side by side, and a third gets both results.
//! The same functions boot on the machine (README, "A first app"). Here time jumps from
//! event to event and passes only where a function says so with `execute_for`, so every
//! run prints the same.

use std::time::Duration;

use fass::commit::CommitError;
use fass::{Occupation, SubtaskAttributes, create_dag, execute_for};
use virtual_time::VirtualTime;

fn main() -> Result<(), CommitError> {
    print!("{}", run()?);
    Ok(())
}

/// Commits the DAG, runs three jobs of it on two cores, and returns the commit's answer and the
/// events of the run.
pub(crate) fn run() -> Result<String, CommitError> {
    let machine = VirtualTime::new().cores(2);
    let ms = Duration::from_millis;
    let taking = |name, time| SubtaskAttributes::named(name).wcet(ms(time));
    let work = |time| execute_for(Duration::from_millis(time), Occupation::Hold);

    let dag = create_dag();
    dag.name("vision").jobs(3);
    let mut frame = 0_u64;
    let camera = move || {
        work(2);
        frame += 1; // a function may keep state from job to job
        (frame,)
    };
    let edges = move |(frame,): (u64,)| {
        work(8);
        (frame * 10,)
    };
    let colours = move |(frame,): (u64,)| {
        work(5);
        (frame * 100,)
    };
    let fuse = move |(edges, colours): (u64, u64)| {
        work(1);
        assert_eq!(edges * 10, colours, "both are of one frame");
    };
    dag.register_periodic_subtask(camera, ["frame"], ms(25), taking("camera", 3));
    dag.register_subtask(edges, ["frame"], ["edges"], taking("edges", 9));
    dag.register_subtask(colours, ["frame"], ["colours"], taking("colours", 9));
    dag.register_sink_subtask(fuse, ["edges", "colours"], ms(25), taking("fuse", 2));
    let commit = fass::finish_create_dags(&[dag])?;

    let mut text = format!("{}\n", commit.answer("vision"));
    let report = machine.run();
    let lines = report.event_lines();
    // The first job: from its release, the first event, to its completion.
    let is_later = |line: &&String| !line.contains("[1]");
    text.extend(
        lines
            .iter()
            .take_while(is_later)
            .map(|line| format!("  {line}\n")),
    );
    for job in &report.jobs {
        let response_time_ns = job.response_time_ns().unwrap_or_default();
        text += &format!("a response time of {} ms\n", response_time_ns / 1_000_000);
    }
    let misses: u64 = report.dags().map(|dag| dag.statistics().misses).sum();
    let violations = report.violations().len();
    text += &format!("{misses} deadlines missed, {violations} semantic violations\n");
    Ok(text)
}
