//! From a completion to its successor on the same core.

use alloc::format;
use core::time::Duration;

use fass::{Policy, Preemption};
use hand_off::{Pen, Shape, Stamping};
use kernel::{Ending, Machine};
use sched_dag::SubtaskId;
use sched_dag::journal::{Event, What};

use super::{Measured, since, workload};
use crate::row::emit;

/// What reading the clock costs, and what a stamp does.
pub(crate) fn clock() {
    const READINGS: usize = 200;
    let mut readings = [0; READINGS];
    for reading in &mut readings {
        *reading = fass::now_ns();
    }
    emit("clock", "reading", 1, differences(readings.into_iter()));
    let mut pen = Pen::new(READINGS);
    for _ in 0..READINGS {
        pen.stamp();
    }
    emit("clock", "stamp", 1, differences(pen.times()));
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
    emit(&name, "return_to_start", 1, hops.filter_map(hop));
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
    emit(name, "hop", hops, ends.source_to_sink());
}

/// A fork and its join: from the last return to the sink.
pub(crate) fn fork_join(machine: &Machine, parallel: usize, jobs: u64) -> Result<(), Ending> {
    let name = format!("fork-join-{parallel}");
    let shape = Shape::ForkJoin(parallel);
    let all = Measured::run(machine, workload(shape, jobs, Stamping::All))?;
    emit_join(&name, &all);
    let ends = Measured::run(machine, workload(shape, jobs, Stamping::Ends))?;
    emit(&name, "source_to_sink", 1, ends.source_to_sink());
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
    emit(name, "return_to_start", 1, to_start);
    let to_ready = all
        .jobs()
        .filter_map(|job| since(ready(job), all.last_return(job)));
    emit(name, "return_to_ready", 1, to_ready);
    let ready_to_start = all.jobs().filter_map(|job| since(first(job), ready(job)));
    emit(name, "ready_to_start", 1, ready_to_start);
}

/// A fork and its join: how often the scheduler makes the sink ready. A system that wakes a sink for
/// each of its inputs makes N wake-ups of a join of N.
pub(crate) fn wake_ups(machine: &Machine, parallel: usize) -> Result<(), Ending> {
    const JOBS: u64 = 20;
    let shape = Shape::ForkJoin(parallel);
    let ends = Measured::run(machine, workload(shape, JOBS, Stamping::Ends))?;
    let is_sinks = |of: SubtaskId| of.index() == parallel + 1;
    let wakes = |event: &Event| event.what == What::Ready && event.subtask.is_some_and(is_sinks);
    let count = ends.run.journal().events().filter(wakes).count() as u64;
    emit(
        &format!("fork-join-{parallel}"),
        "sink_wakeups",
        JOBS,
        [count],
    );
    Ok(())
}

/// A layered random graph: from end to end, for each instance.
pub(crate) fn layered(machine: &Machine, subtasks: usize, jobs: u64) -> Result<(), Ending> {
    let name = format!("layered-{subtasks}");
    // As many instances as a chain has, and a few jobs at least.
    let jobs = (jobs.saturating_mul(64) / subtasks as u64).clamp(3, jobs.max(3));
    let shape = Shape::Layered { subtasks, seed: 1 };
    let ends = Measured::run(machine, workload(shape, jobs, Stamping::Ends))?;
    emit(&name, "instance", subtasks as u64, ends.source_to_sink());
    ends.emit_common(&name);
    Ok(())
}

fn differences(times: impl Iterator<Item = u64> + Clone) -> impl Iterator<Item = u64> {
    let later = times.clone().skip(1);
    later.zip(times).map(|(later, earlier)| later - earlier)
}
