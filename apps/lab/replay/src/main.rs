//! Runs the reference schedules in the loader's file. Their traces tell what happened.
//!
//! Words of the command line: `unit_us` is the length of a unit of the cases'
//! time; `guard_us` is how much before the end of a unit of time a unit of
//! execution ends; events less than `window_us` apart count as one instant. Without the
//! latter two they are a 500th and a 100th of a unit. With `work=compute` all cores compute
//! for a half of each unit in all. Policy and preemption are the cases'; so are the cores,
//! which have to be the machine's.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fork_join::Pace;
use kernel::{AppError, Machine, json, println};
use replay::{Case, Computing, Epoch, Scale, build, parse};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let cases = cases(machine)?;
    let options = machine.options();
    let unit_us = options.number("unit_us", 1..=10_000_000, 10_000)?;
    let guard_us = options.number("guard_us", 0..=unit_us / 4, unit_us / 500)?;
    let window_us = options.number("window_us", 0..=unit_us / 4, unit_us / 100)?;
    let computes = options.choice("work", &[("simulate", false), ("compute", true)])?;
    options.finish(&["unit_us", "guard_us", "window_us", "work"])?;
    let scale = Scale {
        unit_ns: unit_us * 1000,
        guard_ns: guard_us * 1000,
    };
    machine.set_coincidence(Duration::from_micros(window_us));
    let computing = computes.then(|| Computing {
        pace: Pace::measure(),
        // Where instructions are counted, cores compute one after the other.
        time: Duration::from_micros(unit_us) / (2 * machine.cores()),
    });
    for case in &cases {
        run(machine, case, scale, computing)?;
    }
    machine.report_memory();
    Ok(())
}

/// Reads the loader's file.
fn cases(machine: &Machine) -> Result<Vec<Case>, AppError> {
    let usage = |message: String| AppError::Usage(kernel::options::UsageError::new(message));
    let module = machine.module().ok_or_else(|| {
        usage("no file of reference schedules; give one with `qemu -initrd FILE`".to_string())
    })?;
    let text = core::str::from_utf8(module)
        .map_err(|error| usage(format!("the file of reference schedules: {error}")))?;
    parse(text).map_err(|malformed| usage(format!("reference schedules: {malformed}")))
}

fn run(
    machine: &Machine,
    case: &Case,
    scale: Scale,
    computing: Option<Computing>,
) -> Result<(), AppError> {
    /// Time for the cores to get ready.
    const LEAD_NS: u64 = 1_000_000;
    let in_case = |message: String| AppError::Failure(format!("case {}: {message}", case.name));
    if case.cores != machine.cores() {
        let (wanted, here) = (case.cores, machine.cores());
        return Err(in_case(format!(
            "it is for {wanted} cores, here are {here}"
        )));
    }
    machine.configure(case.policy, case.preemption);
    machine.divide(case.clusters.sizes());
    let epoch = Epoch::default();
    let dags = build(case, scale, &epoch, computing).map_err(in_case)?;
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())?;
    let epoch_ns = fass::now_ns() + LEAD_NS;
    epoch.set(epoch_ns);
    let run = machine.run_from(epoch_ns)?;
    let violations = run
        .violations()
        .inspect(|violation| println!("violation: {violation}"))
        .count();
    json::emit("replay", |line| {
        line.text("case", &case.name)
            .number("cores", case.cores)
            .number("violations", violations as u64)
            .number("allocations", run.allocations());
    });
    Ok(())
}
