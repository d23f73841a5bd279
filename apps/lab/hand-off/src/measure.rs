//! The measurements: each commits DAGs, runs them, reads their stamps, and prints figures.
//!
//! *On the same core*: chains, fork-joins and layered graphs, from a completion to its successor.
//! *Elsewhere*: from a completion to successors on other cores, and joins across cores.
//!
//! *Preemption*: from a release to the preemptor's first instruction, and back. A low subtask reads
//! the clock all the time, and keeps the longest time between two readings of a job: the
//! preemption. The preemptor stamps. The journal has the kernel's own times of request, suspension,
//! start, finish and continuation, which no body can see.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use fass::commit::{ConstructionPolicy, finish_create_dags_in_order, finish_create_dags_with};
use fass::{Dag, Policy, Preemption, SubtaskAttributes, create_dag};
use hand_off::{BodyStamps, Shape, StampPen, Stamping, Workload, build};
use kernel::report::Distribution;
use kernel::{AppError, Machine, Run, json};
use sched_dag::journal::{Event, EventKind};
use sched_dag::law::InstanceRecord;
use sched_dag::{CoreId, DagId, Instance, SubtaskId};

/// Measures the cost of a reading of the clock, and of a stamp.
pub(crate) fn clock() {
    const READINGS: usize = 200;
    let mut readings = [0; READINGS];
    for reading in &mut readings {
        *reading = fass::now_ns();
    }
    emit("clock", "reading", 1, differences(readings.into_iter()));
    let mut pen = StampPen::new(READINGS);
    for _ in 0..READINGS {
        pen.stamp();
    }
    emit("clock", "stamp", 1, differences(pen.times()));
}

/// Measures a chain: from each subtask to the next, and from end to end.
pub(crate) fn chain(machine: &Machine, subtasks: usize, jobs: u64) -> Result<(), AppError> {
    let name = format!("chain-{subtasks}");
    let shape = Shape::Chain(subtasks);
    let all = MeasuredRun::run(machine, workload(shape, jobs, Stamping::All))?;
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
    let ends = MeasuredRun::run(machine, workload(shape, jobs, Stamping::Ends))?;
    emit_hop(&name, &ends);
    ends.emit_common(&name);
    Ok(())
}

/// Measures the same chain with a budget for each subtask, in a table, and by deadlines.
pub(crate) fn budgets(machine: &Machine, subtasks: usize, jobs: u64) -> Result<(), AppError> {
    let mut workload = workload(Shape::Chain(subtasks), jobs, Stamping::Ends);
    workload.wcet = Some(Duration::from_millis(1));
    let ends = MeasuredRun::run(machine, workload)?;
    emit_hop(&format!("chain-{subtasks} with budgets"), &ends);
    workload.wcet = None;
    in_a_table(machine, workload, 1)?;
    machine.configure(Policy::Edf, Preemption::Enabled);
    let ends = MeasuredRun::run(machine, workload)?;
    emit_hop(&format!("chain-{subtasks} by deadlines"), &ends);
    Ok(())
}

/// Measures a chain in a table of `cores` cores, which take the chain's subtasks in turn.
pub(crate) fn in_a_table(
    machine: &Machine,
    workload: Workload,
    cores: usize,
) -> Result<(), AppError> {
    let subtasks = workload.shape.subtasks();
    let lists = (0..cores).map(|core| {
        let words = (core..subtasks).step_by(cores);
        let words: String = words.map(|of| format!(" chain.s{of}")).collect();
        format!("core {core}:{words}")
    });
    let ends = MeasuredRun::run_in_order(machine, workload, &lists.collect::<Vec<_>>())?;
    emit_hop(&format!("chain-{subtasks} in a table of {cores}"), &ends);
    Ok(())
}

/// Measures a chain in a table of two cores: each hop wakes the other core.
pub(crate) fn hops_elsewhere(machine: &Machine, jobs: u64) -> Result<(), AppError> {
    in_a_table(machine, workload(Shape::Chain(64), jobs, Stamping::Ends), 2)
}

fn emit_hop(name: &str, ends: &MeasuredRun) {
    let hops = ends.workload.shape.subtasks() as u64 - 1;
    emit(name, "hop", hops, ends.source_to_sink());
}

/// Measures a fork and its join: from the last return to the sink.
pub(crate) fn fork_join(machine: &Machine, parallel: usize, jobs: u64) -> Result<(), AppError> {
    let name = format!("fork-join-{parallel}");
    let shape = Shape::ForkJoin(parallel);
    let all = MeasuredRun::run(machine, workload(shape, jobs, Stamping::All))?;
    emit_join(&name, &all);
    let ends = MeasuredRun::run(machine, workload(shape, jobs, Stamping::Ends))?;
    emit(&name, "source_to_sink", 1, ends.source_to_sink());
    ends.emit_common(&name);
    Ok(())
}

/// Prints the times from the last return to the sink's start.
fn emit_join(name: &str, all: &MeasuredRun) {
    let sink = all.workload.shape.subtasks() - 1;
    let started = |job| all.stamps.first(sink, job);
    let ready = |job| all.ready_ns(sink, job);
    let returned = |job| all.last_return(job);
    all.emit(name, "return_to_start", &returned, &started);
    all.emit(name, "return_to_ready", &returned, &ready);
    all.emit(name, "ready_to_start", &ready, &started);
}

/// Counts for a fork and its join how often the scheduler makes the sink ready. A system waking a
/// sink for each of its inputs needs N wake-ups for a join of N.
pub(crate) fn wake_ups(machine: &Machine, parallel: usize) -> Result<(), AppError> {
    const JOBS: u64 = 20;
    let shape = Shape::ForkJoin(parallel);
    let ends = MeasuredRun::run(machine, workload(shape, JOBS, Stamping::Ends))?;
    let is_sinks = |of: SubtaskId| of.index() == parallel + 1;
    let wakes =
        |event: &Event| event.what == EventKind::Ready && event.subtask.is_some_and(is_sinks);
    let count = ends.run.journal().events().filter(wakes).count() as u64;
    emit(
        &format!("fork-join-{parallel}"),
        "sink_wakeups",
        JOBS,
        [count],
    );
    Ok(())
}

/// Measures a layered random graph: from end to end, for each instance.
pub(crate) fn layered(machine: &Machine, subtasks: usize, jobs: u64) -> Result<(), AppError> {
    let name = format!("layered-{subtasks}");
    // As many instances as in a chain, but at least a few jobs.
    let jobs = (jobs.saturating_mul(64) / subtasks as u64).clamp(3, jobs.max(3));
    let shape = Shape::Layered { subtasks, seed: 1 };
    let ends = MeasuredRun::run(machine, workload(shape, jobs, Stamping::Ends))?;
    emit(&name, "instance", subtasks as u64, ends.source_to_sink());
    ends.emit_common(&name);
    Ok(())
}

fn differences(times: impl Iterator<Item = u64> + Clone) -> impl Iterator<Item = u64> {
    let later = times.clone().skip(1);
    later.zip(times).map(|(later, earlier)| later - earlier)
}

/// Measures a fork into two on an otherwise idle machine: one branch follows on the source's core,
/// the other on a woken core.
pub(crate) fn woken_cores(machine: &Machine, jobs: u64) -> Result<(), AppError> {
    let shape = Shape::ForkJoin(2);
    let all = MeasuredRun::run(machine, workload(shape, jobs, Stamping::All))?;
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

/// Measures joins of branches that compute for 2 us each, on different cores.
pub(crate) fn joins(machine: &Machine, jobs: u64) -> Result<(), AppError> {
    const WORK: Duration = Duration::from_micros(2);
    for parallel in [2, 4] {
        let mut workload = workload(Shape::ForkJoin(parallel), jobs, Stamping::All);
        workload.work = WORK;
        let all = MeasuredRun::run(machine, workload)?;
        emit_join(&format!("fork-join-{parallel} of 2 us bodies"), &all);
    }
    Ok(())
}

const PERIOD: Duration = Duration::from_millis(4);

/// The offset of the preemptor's release: amid the preempted work.
const OFFSET: Duration = Duration::from_millis(1);

/// The time for which the low subtasks compute.
const WORK_NS: u64 = 2_000_000;

/// Measures a preemption of a low subtask; each core has such a subtask.
pub(crate) fn preemption(machine: &Machine, jobs: u64) -> Result<(), AppError> {
    let mut stamps = BodyStamps::default();
    let mut dags = alloc::vec![preemptor(jobs, stamps.pen(jobs))];
    for priority in 1..=machine.cores() {
        dags.push(preempted(jobs, priority, stamps.pen(jobs)));
    }
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())?;
    let run = run(machine)?;
    let epoch_ns = run.epoch_ns();
    let [period_ns, offset_ns] =
        [PERIOD, OFFSET].map(|time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    let core = |job| {
        let instance = Instance::new(run.task_set().find(&dags[0]), job, SubtaskId(0));
        run.record().instance(instance)?.core
    };
    // The last DAG has the lowest priority, wherever it runs.
    let lowest = dags.len() - 1;
    // Only core 0 has the release timer, and it tells other cores. Where there are others, few jobs
    // preempt core 0: they are left out.
    let is_told = machine.cores() > 1;
    let name = if is_told {
        "preemption of another core"
    } else {
        "preemption"
    };
    let jobs = || (0..jobs).filter(|job| (core(*job) != Some(CoreId(0))) == is_told);
    let release_ns = |job| Some(epoch_ns + offset_ns + job * period_ns);
    let (first, last) = (|job| stamps.first(0, job), |job| stamps.last(0, job));
    // On a busy host another gap may be longer than the preemptor's.
    let gap = |job| {
        let gap = (stamps.first(lowest, job)?, stamps.last(lowest, job)?);
        (gap.0 <= first(job)? && last(job)? <= gap.1).then_some(gap)
    };
    let to_start = jobs().filter_map(|job| since(first(job), release_ns(job)));
    emit(name, "release_to_start", 1, to_start);
    if !is_told {
        let out = jobs().filter_map(|job| since(first(job), Some(gap(job)?.0)));
        emit(name, "preempted_to_start", 1, out);
    }
    let back = jobs().filter_map(|job| since(Some(gap(job)?.1), last(job)));
    emit(name, "return_to_resumed", 1, back);
    let preemptor = run.task_set().find(&dags[0]);
    for (part, samples) in parts(&run, preemptor, is_told) {
        emit(name, part, 1, samples);
    }
    Ok(())
}

/// Splits preemptions by the kernel's own times: on core 0, or on all others.
fn parts(run: &Run, preemptor: DagId, is_told: bool) -> [(&'static str, Vec<u64>); 3] {
    let mut parts = [
        ("request_to_suspended", Vec::new()),
        ("suspended_to_start", Vec::new()),
        ("finish_to_resumed", Vec::new()),
    ];
    // The journal is in order of time only core by core.
    let mut events: Vec<Event> = run.journal().events().collect();
    events.sort_by_key(|event| event.time_ns);
    for (place, request) in events.iter().enumerate() {
        let is_meant = request.what == EventKind::Request && request.dag == preemptor;
        if !is_meant || (request.core != CoreId(0)) != is_told {
            continue;
        }
        // The next events on that core, each after the one before.
        let mut later = events[place..].iter();
        let mut next = |what, is_preemptors: bool| {
            let event = later.find(|event| {
                (event.what, event.core) == (what, request.core)
                    && (event.dag == preemptor) == is_preemptors
            })?;
            Some(event.time_ns)
        };
        let times = [
            next(EventKind::Suspend, false),
            next(EventKind::Start, true),
            next(EventKind::Finish, true),
            next(EventKind::Resume, false),
        ];
        if let [Some(suspended), Some(start), Some(finish), Some(resumed)] = times {
            parts[0].1.push(suspended - request.time_ns);
            parts[1].1.push(start - suspended);
            parts[2].1.push(resumed - finish);
        }
    }
    parts
}

fn preemptor(jobs: u64, mut pen: StampPen) -> Dag {
    let body = move |_| {
        pen.stamp();
        pen.stamp();
    };
    let dag = periodic(jobs, "preemptor", 0, body);
    dag.offset(OFFSET);
    dag
}

fn preempted(jobs: u64, priority: u32, mut pen: StampPen) -> Dag {
    let body = move |_| {
        let start_ns = fass::now_ns();
        let (mut last_ns, mut gap) = (start_ns, (0, 0));
        while last_ns - start_ns < WORK_NS {
            let now_ns = fass::now_ns();
            if now_ns - last_ns > gap.1 - gap.0 {
                gap = (last_ns, now_ns);
            }
            last_ns = now_ns;
            core::hint::spin_loop();
        }
        pen.put(gap.0);
        pen.put(gap.1);
    };
    periodic(jobs, "preempted", priority, body)
}

fn periodic(jobs: u64, name: &str, priority: u32, body: impl FnMut(u64) + Send + 'static) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(jobs).in_flight(1);
    dag.period(PERIOD).relative_deadline(PERIOD);
    let attributes = SubtaskAttributes::named(name).priority(priority);
    let _ = dag.register_untyped_subtask(body, attributes);
    dag
}

/// Describes a workload of empty bodies, released so seldom that each job is complete before the
/// next.
fn workload(shape: Shape, jobs: u64, stamping: Stamping) -> Workload {
    /// Room for an instance, even where the clock runs in real time.
    const PERIOD_OF_INSTANCE: Duration = Duration::from_micros(20);
    let instances = u32::try_from(shape.subtasks()).unwrap_or(u32::MAX);
    Workload {
        shape,
        jobs,
        period: Duration::from_millis(2) + PERIOD_OF_INSTANCE.saturating_mul(instances),
        stamping,
        work: Duration::ZERO,
        wcet: None,
    }
}

/// An ended run, with its stamps.
struct MeasuredRun {
    run: Run,
    stamps: BodyStamps,
    workload: Workload,
    dag: DagId,
    commit_ns: u64,
}

impl MeasuredRun {
    /// Commits the workload's DAG, and runs it.
    fn run(machine: &Machine, workload: Workload) -> Result<Self, AppError> {
        Self::run_in_order(machine, workload, &[])
    }

    fn run_in_order(
        machine: &Machine,
        workload: Workload,
        lists: &[String],
    ) -> Result<Self, AppError> {
        let (dag, stamps) = build(&workload);
        let before_ns = fass::now_ns();
        let dags = [dag];
        let lists: Vec<&str> = lists.iter().map(String::as_str).collect();
        finish_create_dags_in_order(&dags, ConstructionPolicy::paper(), &lists)?;
        let commit_ns = fass::now_ns() - before_ns;
        let run = run(machine)?;
        Ok(Self {
            dag: run.task_set().find(&dags[0]),
            run,
            stamps,
            workload,
            commit_ns,
        })
    }

    /// Prints the figures common to all workloads.
    fn emit_common(&self, name: &str) {
        let period_ns = u64::try_from(self.workload.period.as_nanos()).unwrap_or(u64::MAX);
        let release_ns = |job: u64| self.run.epoch_ns() + job * period_ns;
        let from_release: Vec<u64> = self
            .jobs()
            .filter_map(|job| since(self.stamps.first(0, job), Some(release_ns(job))))
            .collect();
        let least = from_release.iter().copied().min().unwrap_or(0);
        let jitter = from_release.iter().map(|ns| ns - least);
        emit(name, "release_jitter", 1, jitter);
        emit(name, "release_to_start", 1, from_release.iter().copied());
        let (jobs, subtasks) = (self.workload.jobs, self.workload.shape.subtasks() as u64);
        let locks = u64::from(self.run.lock_acquisitions());
        for (figure, per, count) in [
            ("commit", subtasks, self.commit_ns),
            ("allocations", jobs, self.run.allocations()),
            ("locks", jobs * subtasks, locks),
        ] {
            emit(name, figure, per, [count]);
        }
    }

    /// Prints the times from one instant of each job to another.
    fn emit(
        &self,
        name: &str,
        figure: &str,
        from: &dyn Fn(u64) -> Option<u64>,
        to: &dyn Fn(u64) -> Option<u64>,
    ) {
        let times = self.jobs().filter_map(|job| since(to(job), from(job)));
        emit(name, figure, 1, times);
    }

    fn jobs(&self) -> impl Iterator<Item = u64> + Clone + use<> {
        0..self.workload.jobs
    }

    /// Returns the times from the source's first to the sink's first instruction.
    fn source_to_sink(&self) -> impl Iterator<Item = u64> {
        let sink = self.workload.shape.subtasks() - 1;
        let stamps = &self.stamps;
        self.jobs()
            .filter_map(move |job| since(stamps.first(sink, job), stamps.first(0, job)))
    }

    /// Returns the time of the last return among the sink's predecessors in a fork-join.
    fn last_return(&self, job: u64) -> Option<u64> {
        let sink = self.workload.shape.subtasks() - 1;
        (1..sink)
            .filter_map(|branch| self.stamps.last(branch, job))
            .max()
    }

    /// Returns the time at which the scheduler made an instance ready.
    fn ready_ns(&self, subtask: usize, job: u64) -> Option<u64> {
        Some(self.run.epoch_ns() + self.instance(subtask, job)?.ready_ns?)
    }

    /// Returns the scheduler's record of an instance.
    fn instance(&self, subtask: usize, job: u64) -> Option<&InstanceRecord> {
        let subtask = SubtaskId(u32::try_from(subtask).ok()?);
        let instance = Instance::new(self.dag, job, subtask);
        self.run.record().instance(instance)
    }
}

/// Runs the committed DAGs; a breach of the model's rules is an error.
fn run(machine: &Machine) -> Result<Run, AppError> {
    let run = machine.run()?;
    if let Some(violation) = run.violations().next() {
        return Err(AppError::Failure(alloc::format!("{violation}")));
    }
    Ok(run)
}

fn since(later: Option<u64>, earlier: Option<u64>) -> Option<u64> {
    later?.checked_sub(earlier?)
}

/// Prints a measured quantity of a workload as a machine line; a sample covers `per` equal steps.
fn emit(workload: &str, figure: &str, per: u64, samples: impl IntoIterator<Item = u64>) {
    let samples = Distribution::new(samples);
    json::emit("hand_off", |line| {
        line.text("workload", workload)
            .text("figure", figure)
            .number("per", per)
            .number("samples", samples.count())
            .distribution("value", &samples);
    });
}
