//! A run: its threads while it goes on, and what it leaves behind.

use std::sync::atomic::Ordering;
use std::sync::{Arc, MutexGuard};
use std::thread::{self, JoinHandle};

use sched_dag::law::{Record, Violation};
use sched_dag::{Dag, DagId, DagStatistics, Journal, SchedulerOptions, SubtaskId, TaskSet};

use crate::office::Office;
use crate::release::Budgets;
use crate::state::{Fault, Number, State};
use crate::sys;
use crate::team::Team;

/// The stack of each worker. All of it is locked in memory, if memory is.
const STACK_BYTES: usize = 512 * 1024;

/// Time between the start of a run and its first release.
const LEAD_NS: u64 = 1_000_000;

/// A plan that was committed.
pub(crate) struct Launched {
    pub(crate) office: Arc<Office>,
    /// By cluster.
    pub(crate) teams: Vec<Arc<Team>>,
    pub(crate) options: SchedulerOptions,
    pub(crate) bounds_ns: Vec<Option<u64>>,
    pub(crate) sink_bounds_ns: Vec<Vec<Option<u64>>>,
    pub(crate) budget_factor: u64,
    /// Counts what the program has allocated so far.
    pub(crate) allocations: fn() -> u64,
}

/// How often the run's threads did what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Completions that handed their core the next instance: same thread, no wake.
    pub hand_offs: u64,
    /// Calls of workers that sleep or are about to: one wake of the kernel's each.
    pub calls: u64,
    /// Instances that lost their core to a more urgent one.
    pub preemptions: u64,
}

/// A run that has ended: its model, its times and its counts.
///
/// See [`Linux`](crate::Linux).
#[derive(Debug)]
pub struct Run {
    task_set: Arc<TaskSet>,
    options: SchedulerOptions,
    statistics: Vec<DagStatistics>,
    journal: Journal,
    record: Record,
    faults: Vec<Fault>,
    counts: Counts,
    epoch_ns: u64,
    bounds_ns: Vec<Option<u64>>,
    sink_bounds_ns: Vec<Vec<Option<u64>>>,
    sink_misses: Vec<Vec<u64>>,
    allocations: u64,
}

/// Starts the threads of a committed plan, waits for the end of all its jobs, and
/// returns what happened. Releases count from `epoch_ns`, or from right now.
pub(crate) fn run(launched: Launched, epoch_ns: Option<u64>) -> Run {
    let (office, teams) = (&launched.office, &launched.teams);
    let workers = teams.iter().map(|team| {
        let numbers = 0..team.workers.len();
        numbers.map(|number| worker(team, number)).collect()
    });
    let workers: Vec<Vec<_>> = workers.collect();
    for (team, workers) in teams.iter().zip(&workers) {
        team.wait_until_ready(workers.len());
    }
    let release = |team| release(team, launched.budget_factor);
    let releases: Vec<_> = teams.iter().map(release).collect();
    for (team, workers) in teams.iter().zip(&workers) {
        team.wait_until_ready(workers.len() + 1);
    }
    let allocations = (launched.allocations)();
    let epoch_ns = epoch_ns.unwrap_or_else(|| sys::now_ns() + LEAD_NS);
    for team in teams {
        team.lock().epoch_ns = epoch_ns;
    }
    teams.iter().for_each(|team| office.ring(team.cluster));
    office.wait_until_over();
    let allocations = (launched.allocations)() - allocations;
    releases.into_iter().for_each(join);
    let mut states: Vec<_> = teams.iter().map(|team| team.lock()).collect();
    let abandoned: Vec<Vec<Number>> = states.iter().map(|state| state.abandoned.clone()).collect();
    let task_set = Arc::clone(&states[0].engine.task_set);
    let journal = journal(&mut states, &task_set, launched.options.cores);
    let scheduler_of = |dag| &states[task_set.dag(dag).cluster().index()].engine.scheduler;
    let ids = (0..).map(DagId).zip(task_set.dags());
    let statistics = |(dag, _)| *scheduler_of(dag).statistics(dag);
    let statistics = ids.clone().map(statistics).collect();
    let sink_misses = |(dag, model): (DagId, &Dag)| {
        let sinks = model.sinks().iter();
        sinks
            .map(|sink| scheduler_of(dag).sink_misses(dag, *sink))
            .collect()
    };
    let sink_misses = ids.map(sink_misses).collect();
    let mut counts = Counts::default();
    let mut faults = Vec::new();
    for (team, state) in teams.iter().zip(&mut states) {
        counts.hand_offs += team.hand_offs.load(Ordering::Relaxed);
        counts.calls += team.calls.load(Ordering::Relaxed);
        counts.preemptions += state.preemptions;
        faults.append(&mut state.faults);
    }
    drop(states);
    for (workers, abandoned) in workers.into_iter().zip(abandoned) {
        for (number, thread) in workers.into_iter().enumerate() {
            if !abandoned.contains(&number) {
                join(thread);
            }
        }
    }
    Run {
        record: journal.record(&task_set),
        task_set,
        options: launched.options,
        statistics,
        journal,
        faults,
        counts,
        epoch_ns,
        bounds_ns: launched.bounds_ns,
        sink_bounds_ns: launched.sink_bounds_ns,
        sink_misses,
        allocations,
    }
}

/// Takes the journals out, as one. Nobody writes any more: those that were abandoned see that
/// they were.
fn journal(states: &mut [MutexGuard<'_, State>], task_set: &Arc<TaskSet>, cores: u32) -> Journal {
    let mut merged: Option<Journal> = None;
    for (cluster, state) in task_set.clusters().zip(states) {
        let empty = Journal::new(task_set, 0, 0);
        let its = std::mem::replace(&mut state.engine.scheduler.log.journal, empty);
        match &mut merged {
            None => merged = Some(its),
            Some(merged) => {
                let first_core = task_set.cores_of(cluster, cores).start;
                merged.absorb(its, cluster, first_core);
            }
        }
    }
    merged.expect("there is a cluster at least")
}

fn release(team: &Arc<Team>, budget_factor: u64) -> JoinHandle<()> {
    let budgets = Budgets::new(&team.lock(), budget_factor);
    let team = Arc::clone(team);
    thread::Builder::new()
        .name("fass-release".into())
        .spawn(move || team.release(budgets))
        .expect("the system has a thread to release jobs")
}

fn worker(team: &Arc<Team>, number: usize) -> JoinHandle<()> {
    let team = Arc::clone(team);
    thread::Builder::new()
        .name(format!("fass-worker-{number}"))
        .stack_size(STACK_BYTES)
        .spawn(move || team.work(number))
        .expect("the system has a thread for each core and each subtask")
}

fn join(thread: JoinHandle<()>) {
    if let Err(panic) = thread.join() {
        std::panic::resume_unwind(panic);
    }
}

impl Run {
    /// Returns the model that was run.
    #[must_use]
    pub const fn task_set(&self) -> &Arc<TaskSet> {
        &self.task_set
    }

    /// Returns the times of all jobs and instances, in nanoseconds from the instant from
    /// which releases count; of the latest whole jobs if there were too many.
    #[must_use]
    pub const fn record(&self) -> &Record {
        &self.record
    }

    /// Returns the journal: what has happened, in its order.
    #[must_use]
    pub const fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Returns a DAG's counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn statistics(&self, dag: DagId) -> &DagStatistics {
        &self.statistics[dag.index()]
    }

    /// Returns the response time that the commit has proven of a DAG, if it has.
    #[must_use]
    pub fn bound_ns(&self, dag: DagId) -> Option<u64> {
        self.bounds_ns.get(dag.index()).copied().flatten()
    }

    /// Returns the response time that the commit has proven of a sink, if it has.
    #[must_use]
    pub fn sink_bound_ns(&self, dag: DagId, sink: SubtaskId) -> Option<u64> {
        let place = self.place_of(dag, sink)?;
        let of_dag = self.sink_bounds_ns.get(dag.index())?;
        of_dag.get(place).copied().flatten()
    }

    /// Returns how many jobs a sink has missed its deadline in; 0 of what is no sink.
    #[must_use]
    pub fn sink_misses(&self, dag: DagId, sink: SubtaskId) -> u64 {
        let place = self.place_of(dag, sink);
        place.map_or(0, |place| self.sink_misses[dag.index()][place])
    }

    fn place_of(&self, dag: DagId, sink: SubtaskId) -> Option<usize> {
        let sinks = self.task_set.dag(dag).sinks();
        sinks.iter().position(|other| *other == sink)
    }

    /// Returns how the scheduler was told to work.
    #[must_use]
    pub const fn options(&self) -> SchedulerOptions {
        self.options
    }

    /// Returns how often anything in the program allocated memory between the start of the
    /// releases and the last completion; 0 if nobody has said how to count that
    /// ([`Linux::allocations`](crate::Linux::allocations)).
    #[must_use]
    pub const fn allocations(&self) -> u64 {
        self.allocations
    }

    /// Returns the faults that have ended DAGs, of each cluster in their order.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Returns how often the threads did what.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Returns the instant from which releases count, on the clock of [`fass::now_ns`].
    #[must_use]
    pub const fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }

    /// Returns every breach of rules R1 to R4, and whether each instance had one life and
    /// each core one instance at a time. However long something takes is right.
    pub fn violations(&self) -> impl Iterator<Item = Violation> {
        self.journal.violations(&self.task_set).into_iter()
    }

    /// Returns every breach of R5 that lasts for longer than `bound_ns`: a decision takes
    /// effect when Linux has switched threads. `None` if events are lost.
    #[must_use]
    pub fn dispatch_violations(&self, bound_ns: u64) -> Option<Vec<Violation>> {
        self.journal
            .dispatch_violations(&self.task_set, &self.options, bound_ns)
    }
}
