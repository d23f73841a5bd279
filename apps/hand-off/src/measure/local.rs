//! From a completion to its successor on the same core.

use alloc::format;
use alloc::string::String;
use core::time::Duration;

use fass::{Policy, Preemption};
use hand_off::{Pen, Shape, Stamping};
use kernel::{Ending, Machine};

use super::{Measured, since, workload};
use crate::row::Row;

/// What reading the clock costs, and what a stamp does.
pub(crate) fn clock() {
    const READINGS: usize = 200;
    let mut readings = [0; READINGS];
    for reading in &mut readings {
        *reading = fass::now_ns();
    }
    Row::new("clock", "reading", differences(readings.into_iter())).emit();
    let mut pen = Pen::new(READINGS);
    for _ in 0..READINGS {
        pen.stamp();
    }
    Row::new("clock", "stamp", differences(pen.times())).emit();
}

/// A chain: from each subtask to the next, and from end to end.
pub(crate) fn chain(machine: &Machine, subtasks: usize, jobs: u64) -> Result<(), Ending> {
    let name = format!("chain-{subtasks}");
    let shape = Shape::Chain(subtasks);
    let all = Measured::run(machine, workload(shape, jobs, Stamping::All))?;
    let hops = all
        .jobs()
        .flat_map(|job| (1..subtasks).map(move |later| (job, later)));
    let hop = |(job, later)| {
        since(
            all.stamps.first(later, job),
            all.stamps.last(later - 1, job),
        )
    };
    Row::new(&name, "return_to_start", hops.filter_map(hop)).emit();
    let ends = Measured::run(machine, workload(shape, jobs, Stamping::Ends))?;
    emit_hop(&name, &ends);
    ends.emit_common(&name);
    Ok(())
}

/// The same chain, where each subtask has a budget; and by deadlines.
pub(crate) fn budgets(machine: &Machine, subtasks: usize, jobs: u64) -> Result<(), Ending> {
    let mut workload = workload(Shape::Chain(subtasks), jobs, Stamping::Ends);
    workload.wcet = Some(Duration::from_millis(1));
    let ends = Measured::run(machine, workload)?;
    emit_hop(&format!("chain-{subtasks} with budgets"), &ends);
    workload.wcet = None;
    machine.configure(Policy::Edf, Preemption::Enabled);
    let ends = Measured::run(machine, workload)?;
    emit_hop(&format!("chain-{subtasks} by deadlines"), &ends);
    Ok(())
}

fn emit_hop(name: &str, ends: &Measured) {
    let hops = ends.workload.shape.subtasks() as u64 - 1;
    Row::new(name, "hop", ends.source_to_sink())
        .per(hops)
        .emit();
}

/// A fork and its join: from the last return to the sink.
pub(crate) fn fork_join(machine: &Machine, parallel: usize, jobs: u64) -> Result<(), Ending> {
    let name = format!("fork-join-{parallel}");
    let shape = Shape::ForkJoin(parallel);
    let all = Measured::run(machine, workload(shape, jobs, Stamping::All))?;
    emit_join(&name, &all);
    let ends = Measured::run(machine, workload(shape, jobs, Stamping::Ends))?;
    Row::new(&name, "source_to_sink", ends.source_to_sink()).emit();
    ends.emit_common(&name);
    Ok(())
}

/// Prints the times from the last return to the sink's start.
pub(super) fn emit_join(name: &str, all: &Measured) {
    let sink = all.workload.shape.subtasks() - 1;
    let first = |job| all.stamps.first(sink, job);
    let ready = |job| all.ready_ns(sink, job);
    let to_start = all
        .jobs()
        .filter_map(|job| since(first(job), all.last_return(job)));
    Row::new(name, "return_to_start", to_start).emit();
    let to_ready = all
        .jobs()
        .filter_map(|job| since(ready(job), all.last_return(job)));
    Row::new(name, "return_to_ready", to_ready).emit();
    let ready_to_start = all.jobs().filter_map(|job| since(first(job), ready(job)));
    Row::new(name, "ready_to_start", ready_to_start).emit();
}

/// A layered random graph: from end to end, for each instance.
pub(crate) fn layered(
    machine: &Machine,
    subtasks: usize,
    seed: u64,
    jobs: u64,
) -> Result<(), Ending> {
    let name: String = format!("layered-{subtasks}");
    // As many instances as a chain has, and a few jobs at least.
    let jobs = (jobs.saturating_mul(64) / subtasks as u64).clamp(3, jobs.max(3));
    let shape = Shape::Layered { subtasks, seed };
    let ends = Measured::run(machine, workload(shape, jobs, Stamping::Ends))?;
    Row::new(&name, "instance", ends.source_to_sink())
        .per(subtasks as u64)
        .emit();
    ends.emit_common(&name);
    Ok(())
}

fn differences(times: impl Iterator<Item = u64> + Clone) -> impl Iterator<Item = u64> {
    let later = times.clone().skip(1);
    later.zip(times).map(|(later, earlier)| later - earlier)
}
