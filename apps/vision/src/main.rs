//! Boots into a drive and says how it went.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;

use fass::finish_create_dags;
use kernel::report::Ns;
use kernel::{Ending, Machine, Run, json, println};
use sched_dag::{DagId, Vertex};
use vision::{Drive, Workload};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), Ending> {
    let options = machine.options();
    let seconds = options.number("seconds", 1..=100_000, 5)?;
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    options.finish(&["seconds", "seed"])?;
    let workload = Workload {
        seconds,
        seed,
        takes_wcet: false,
    };
    let system = workload.build();
    let commit = finish_create_dags(&system.dags)?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;
    report(&run, &system.drive)
}

fn report(run: &Run, drive: &Drive) -> Result<(), Ending> {
    println!();
    println!("{drive}");
    let mut misses = 0;
    let mut vertices = (0..).map(Vertex);
    for (id, dag) in (0..).map(DagId).zip(run.task_set().dags()) {
        let counts = run.statistics(id);
        misses += counts.misses;
        println!(
            "  {}: {} jobs, {} deadlines missed",
            dag.name(),
            counts.completed,
            counts.misses
        );
        for (subtask, vertex) in dag.subtasks().iter().zip(&mut vertices) {
            let times = run.times();
            let observed = times.map(|times| times.subtask(vertex).execution_time.max());
            println!(
                "    {:<16} WCET {:>10}, observed {:>12}",
                subtask.name(),
                Ns(subtask.wcet_ns().unwrap_or(0)),
                Ns(observed.unwrap_or(0))
            );
        }
    }
    let violations = run.violations().count() as u64;
    let ((frames, seen), (gap, speed)) = (drive.frames(), drive.end());
    json::emit("vision", |line| {
        line.number("frames", u64::from(frames))
            .number("seen", u64::from(seen))
            .number("error_permille", whole(drive.most_error()))
            .number("gap_mm", whole(gap))
            .number("speed_mm_s", whole(speed))
            .number("deadline_misses", misses)
            .number("violations", violations)
            .number("allocations", run.allocations());
    });
    match violations {
        0 => Ok(()),
        count => Err(Ending::Failure(format!("{count} violations"))),
    }
}

/// Returns a thousand times a number that is not negative, and small.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "it is from 0 to some thousands"
)]
fn whole(number: f32) -> u64 {
    (number * 1000.0) as u64
}
