//! The measurements: each commits a DAG, runs it, and reads its stamps.

use alloc::format;
use alloc::vec::Vec;
use core::time::Duration;

use fass::{ConstructionPolicy, finish_create_dags_with};
use hand_off::{Pen, Shape, Stamping, Stamps, Workload, build};
use kernel::{Ending, Machine, Run};
use sched_dag::{DagId, Instance, SubtaskId};

use crate::Plan;
use crate::row::Row;

const DAG: DagId = DagId(0);

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
pub(crate) fn chain(machine: &Machine, subtasks: usize, plan: &Plan) -> Result<(), Ending> {
    let name = format!("chain-{subtasks}");
    let shape = Shape::Chain(subtasks);
    let all = Measured::run(machine, shape, plan.jobs, Stamping::All)?;
    let hops = || (0..plan.jobs).flat_map(|job| (1..subtasks).map(move |later| (job, later)));
    let hop = |(job, later)| {
        since(
            all.stamps.first(later, job),
            all.stamps.last(later - 1, job),
        )
    };
    Row::new(&name, "return_to_start", hops().filter_map(hop)).emit();
    let ends = Measured::run(machine, shape, plan.jobs, Stamping::Ends)?;
    Row::new(&name, "hop", ends.source_to_sink())
        .per(subtasks - 1)
        .emit();
    ends.emit_common(&name);
    Ok(())
}

/// A fork and its join: from the last return to the sink.
pub(crate) fn fork_join(machine: &Machine, parallel: usize, plan: &Plan) -> Result<(), Ending> {
    let name = format!("fork-join-{parallel}");
    let shape = Shape::ForkJoin(parallel);
    let all = Measured::run(machine, shape, plan.jobs, Stamping::All)?;
    let sink = parallel + 1;
    let last_return = |job| {
        (1..sink)
            .filter_map(|branch| all.stamps.last(branch, job))
            .max()
    };
    let jobs = || 0..plan.jobs;
    let starts = jobs().filter_map(|job| since(all.stamps.first(sink, job), last_return(job)));
    Row::new(&name, "return_to_start", starts).emit();
    let ready = jobs().filter_map(|job| since(all.ready_ns(sink, job), last_return(job)));
    Row::new(&name, "return_to_ready", ready).emit();
    let ready_to_start =
        jobs().filter_map(|job| since(all.stamps.first(sink, job), all.ready_ns(sink, job)));
    Row::new(&name, "ready_to_start", ready_to_start).emit();
    let ends = Measured::run(machine, shape, plan.jobs, Stamping::Ends)?;
    Row::new(&name, "source_to_sink", ends.source_to_sink()).emit();
    ends.emit_common(&name);
    Ok(())
}

/// A layered random graph: from end to end, for each instance.
pub(crate) fn layered(machine: &Machine, shape: Shape, plan: &Plan) -> Result<(), Ending> {
    let subtasks = shape.subtasks();
    let name = format!("layered-{subtasks}");
    // As many instances as the others have, and a few jobs at least.
    let jobs = (plan.jobs.saturating_mul(64) / subtasks as u64).clamp(3, plan.jobs);
    let ends = Measured::run(machine, shape, jobs, Stamping::Ends)?;
    Row::new(&name, "instance", ends.source_to_sink())
        .per(subtasks)
        .emit();
    ends.emit_common(&name);
    Ok(())
}

/// A run that has ended, with its stamps.
struct Measured {
    run: Run,
    stamps: Stamps,
    workload: Workload,
    commit_ns: u64,
}

impl Measured {
    /// Commits and runs.
    fn run(machine: &Machine, shape: Shape, jobs: u64, stamping: Stamping) -> Result<Self, Ending> {
        /// Room for a job of each instance even where a nanosecond is long.
        const PERIOD_OF_INSTANCE: Duration = Duration::from_micros(20);
        let instances = u32::try_from(shape.subtasks()).unwrap_or(u32::MAX);
        let workload = Workload {
            shape,
            jobs,
            period: Duration::from_millis(2) + PERIOD_OF_INSTANCE * instances,
            stamping,
            wcet: None,
        };
        let (dag, stamps) = build(&workload);
        let before_ns = fass::now_ns();
        finish_create_dags_with(&[dag], ConstructionPolicy::default())?;
        let commit_ns = fass::now_ns() - before_ns;
        let run = machine.run()?;
        if let Some(violation) = run.violations().next() {
            return Err(Ending::Failure(format!("{shape:?}: {violation}")));
        }
        Ok(Self {
            run,
            stamps,
            workload,
            commit_ns,
        })
    }

    /// Prints what every workload has.
    fn emit_common(&self, name: &str) {
        let jobs = 0..self.workload.jobs;
        let period_ns = u64::try_from(self.workload.period.as_nanos()).unwrap_or(u64::MAX);
        let release_ns = |job: u64| self.run.epoch_ns() + job * period_ns;
        let from_release: Vec<u64> = jobs
            .filter_map(|job| since(self.stamps.first(0, job), Some(release_ns(job))))
            .collect();
        let least = from_release.iter().copied().min().unwrap_or(0);
        let jitter = from_release.iter().map(|ns| ns - least);
        Row::new(name, "release_jitter", jitter).emit();
        Row::new(name, "release_to_start", from_release.iter().copied()).emit();
        Row::new(name, "commit", [self.commit_ns])
            .per(self.workload.shape.subtasks())
            .emit();
        let jobs = usize::try_from(self.workload.jobs).unwrap_or(usize::MAX);
        Row::new(name, "allocations", [self.run.allocations()])
            .per(jobs)
            .emit();
    }

    /// Returns the times from the source's first to the sink's first instruction.
    fn source_to_sink(&self) -> impl Iterator<Item = u64> {
        let sink = self.workload.shape.subtasks() - 1;
        let stamps = &self.stamps;
        (0..self.workload.jobs)
            .filter_map(move |job| since(stamps.first(sink, job), stamps.first(0, job)))
    }

    /// Returns when the scheduler made an instance ready.
    fn ready_ns(&self, subtask: usize, job: u64) -> Option<u64> {
        let instance = Instance {
            dag: DAG,
            job,
            subtask: SubtaskId(u32::try_from(subtask).ok()?),
        };
        let ready_ns = self.run.record().instance(instance)?.ready_ns?;
        Some(self.run.epoch_ns() + ready_ns)
    }
}

fn since(later: Option<u64>, earlier: Option<u64>) -> Option<u64> {
    later?.checked_sub(earlier?)
}

fn differences(times: impl Iterator<Item = u64> + Clone) -> impl Iterator<Item = u64> {
    let later = times.clone().skip(1);
    later.zip(times).map(|(later, earlier)| later - earlier)
}
