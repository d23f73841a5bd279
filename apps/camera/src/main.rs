//! Boots into a camera with an accelerator, and reports on the run.

#![no_std]
#![no_main]

use core::sync::atomic::Ordering::Relaxed;

use camera::{Conduct, Detection, build};
use fass::finish_create_dags;
use kernel::{AppError, Machine, json, println};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let frames = options.number("jobs", 1..=100_000, 50)?;
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    let conducts = [
        ("random", Conduct::Random),
        ("twice", Conduct::Twice),
        ("silent", Conduct::Silent),
    ];
    let conduct = options.choice("accelerator", &conducts)?;
    let detections = [
        ("asks", Detection::Asks),
        ("skips", Detection::Skips),
        ("hangs", Detection::Hangs),
    ];
    let detection = options.choice("detect", &detections)?;
    options.finish(&["jobs", "seed", "accelerator", "detect"])?;
    if detection == Detection::Hangs {
        machine.accept_faults();
    }

    let (dags, counts) = build(frames, seed, conduct, detection);
    let commit = finish_create_dags(&dags)?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;
    println!();
    for dag in run.task_set().dags() {
        let name = dag.name();
        let statistics = run.statistics(name);
        let longest_ns = run.response_times_ns(name).max();
        println!(
            "{name}: {} jobs complete, {} deadlines missed, {} faults, longest response {} us",
            statistics.completed,
            statistics.misses,
            statistics.faults,
            longest_ns.unwrap_or(0).div_ceil(1000),
        );
    }
    let [answered, late, refused] =
        [&counts.answered, &counts.late, &counts.refused].map(|count| count.load(Relaxed));
    println!("{answered} frames answered in time, {late} without, {refused} answers refused");
    println!("{} allocations while jobs ran", run.allocations());
    json::emit("camera", |line| {
        line.number("answered", answered)
            .number("late", late)
            .number("refused", refused)
            .number("allocations", run.allocations());
    });
    AppError::of_violations(run.violations().count() as u64)
}
