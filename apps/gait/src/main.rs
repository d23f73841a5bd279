//! Boots into a recorded walk, and prints the angles of its knee.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use fass::finish_create_dags;
use gait::{DAG, WalkOrientations, build};
use kernel::options::UsageError;
use kernel::report::Ns;
use kernel::{AppError, Machine, Run, json, println};
use recording::Recording;
use sched_dag::Vertex;

kernel::entry!(main);

/// The most angles in a machine line.
const ANGLES_A_LINE: usize = 128;

fn main(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&[])?;
    let usage = |message: String| AppError::Usage(UsageError::new(message));
    let module = machine.module().ok_or_else(|| {
        usage("no recording; give one by `./scripts/run --app gait --module FILE`".into())
    })?;
    let recording = Recording::read(module)
        .map_err(|malformed| usage(format!("the recording, {malformed}")))?;
    let (dag, walk) =
        build(&recording).map_err(|mismatch| usage(format!("the recording: {mismatch}")))?;
    machine.show_topics();
    let commit = finish_create_dags(&[dag])?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;
    report(&run, &walk)
}

fn report(run: &Run, walk: &WalkOrientations) -> Result<(), AppError> {
    let counts = run.statistics(DAG);
    println!();
    println!(
        "{} jobs complete, {} deadlines missed",
        counts.completed, counts.misses
    );
    let task_set = run.task_set();
    for (subtask, vertex) in task_set
        .dag(task_set.find(DAG))
        .subtasks()
        .iter()
        .zip((0..).map(Vertex))
    {
        let times = run.times();
        let observed = times.map(|times| times.subtask(vertex).execution_time.distribution());
        let wcet = Ns(subtask.wcet_ns().unwrap_or(0));
        println!(
            "  {:<6} WCET {wcet}, observed {}",
            subtask.name(),
            Ns(observed.unwrap_or_default().max())
        );
    }
    let violations = run.violations().count() as u64;
    let angles: Vec<u64> = walk.knee_degrees().map(millionths).collect();
    for (line_number, angles) in angles.chunks(ANGLES_A_LINE).enumerate() {
        let angles: Vec<String> = angles.iter().map(|angle| format!("{angle}")).collect();
        json::emit("gait_knee", |line| {
            line.number("from_job", (line_number * ANGLES_A_LINE) as u64)
                .list("angles_udeg", angles.iter());
        });
    }
    json::emit("gait", |line| {
        line.number("jobs", counts.completed)
            .number("deadline_misses", counts.misses)
            .number("violations", violations)
            .number("allocations", run.allocations())
            .number("most_udeg", angles.iter().copied().max().unwrap_or(0))
            .number("digest", walk.digest());
    });
    AppError::of_violations(violations)
}

/// Returns an angle in millionths of a degree.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "an angle from 0 to 360 degrees"
)]
fn millionths(degrees: f64) -> u64 {
    (degrees * 1e6) as u64
}
