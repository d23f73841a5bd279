//! From a completion to successors on other cores, and joins across cores.

use alloc::format;
use core::time::Duration;

use hand_off::{Shape, Stamping};
use kernel::{Ending, Machine};

use super::{Measured, local, since, workload};
use crate::row::emit;

/// A fork into two on an otherwise idle machine: one branch follows on the
/// source's core, the other on a core that has to be woken.
pub(crate) fn woken_cores(machine: &Machine, jobs: u64) -> Result<(), Ending> {
    let shape = Shape::ForkJoin(2);
    let all = Measured::run(machine, workload(shape, jobs, Stamping::All))?;
    let core = |subtask, job| all.instance(subtask, job)?.core;
    let branches = || all.jobs().flat_map(|job| [(1, job), (2, job)]);
    let elsewhere = || branches().filter(|&(branch, job)| core(branch, job) != core(0, job));
    let first = |(branch, job)| all.stamps.first(branch, job);
    let from_return = elsewhere().filter_map(|at| since(first(at), all.stamps.last(0, at.1)));
    emit("woken core", "return_to_start", 1, from_return);
    let from_ready = elsewhere().filter_map(|at| since(first(at), all.ready_ns(at.0, at.1)));
    emit("woken core", "ready_to_start", 1, from_ready);
    Ok(())
}

/// Joins of branches that compute for 2 us each, on different cores.
pub(crate) fn joins(machine: &Machine, jobs: u64) -> Result<(), Ending> {
    const WORK: Duration = Duration::from_micros(2);
    for parallel in [2, 4] {
        let mut workload = workload(Shape::ForkJoin(parallel), jobs, Stamping::All);
        workload.work = WORK;
        let all = Measured::run(machine, workload)?;
        local::emit_join(&format!("fork-join-{parallel} of 2 us bodies"), &all);
    }
    Ok(())
}
