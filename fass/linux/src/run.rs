//! A run: its threads while it goes on, and what it leaves behind.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{self, JoinHandle};

use fass::Terms;
use fass::edge::Kept;
use sched_dag::engine::{self, Proven};

use crate::control::Control;
use crate::edge::{self, File, Sending};
use crate::level::Levels;
use crate::release::Budgets;
use crate::state::{Fault, Number, RunTime};
use crate::sys;
use crate::team::Team;

/// The stack of each worker. All of it is locked in memory, if memory is.
const STACK_BYTES: usize = 512 * 1024;

/// Time between the start of a run and its first release.
const LEAD_NS: u64 = 1_000_000;

/// What the commits to come run on.
#[derive(Clone, Debug)]
pub(crate) struct Threads {
    /// The terms of the commits to come.
    pub(crate) terms: Terms,
    pub(crate) processors: Box<[u32]>,
    pub(crate) levels: Option<Levels>,
    /// Whether idle threads watch instead of sleeping.
    pub(crate) polls: bool,
    /// Whether the run's time skips what would pass idly.
    pub(crate) skips_idle: bool,
    /// Counts what the program has allocated so far.
    pub(crate) allocations: fn() -> u64,
}

/// A plan that was committed.
pub(crate) struct Launched {
    pub(crate) control: Control,
    pub(crate) proven: Proven,
    pub(crate) threads: Threads,
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

/// A run that has ended: what [every platform](engine::Run) tells of it, its faults, and the counts
/// of its threads.
///
/// See [`Linux`](crate::Linux).
#[derive(Debug)]
pub struct Run {
    run: engine::Run,
    faults: Vec<Fault>,
    counts: Counts,
}

impl Deref for Run {
    type Target = engine::Run;

    fn deref(&self) -> &engine::Run {
        &self.run
    }
}

/// Starts the threads of a committed plan, waits for the end of all its jobs, and
/// returns what happened. Releases count from `epoch_ns`, or from right now.
pub(crate) fn run(launched: Launched, epoch_ns: Option<u64>) -> Run {
    let (threads, Control { office, teams }) = (&launched.threads, &launched.control);
    let workers = teams.iter().map(|team| {
        let numbers = 0..team.workers.len();
        numbers.map(|number| worker(team, number)).collect()
    });
    let workers: Vec<Vec<_>> = workers.collect();
    for (team, workers) in teams.iter().zip(&workers) {
        team.wait_until_ready(workers.len());
    }
    let release = |team| release(team, threads.terms.budget_factor);
    let releases: Vec<_> = teams.iter().map(release).collect();
    for (team, workers) in teams.iter().zip(&workers) {
        team.wait_until_ready(workers.len() + 1);
    }
    let epoch_ns = epoch_ns.unwrap_or_else(|| sys::now_ns() + LEAD_NS);
    for team in teams.iter() {
        team.lock().time = RunTime::beginning(epoch_ns);
    }
    let sending = edge::begin_run(epoch_ns, events(launched.control.clone()));
    let allocations = (threads.allocations)();
    teams.iter().for_each(|team| office.ring(team.cluster));
    office.wait_until_over();
    let allocations = (threads.allocations)() - allocations;
    releases.into_iter().for_each(join);
    sending.into_iter().for_each(Sending::end);
    let mut states: Vec<_> = teams.iter().map(|team| team.lock()).collect();
    let abandoned: Vec<Vec<Number>> = states.iter().map(|state| state.abandoned.clone()).collect();
    let mut parts = states.iter_mut().map(|state| &mut state.engine);
    let first = parts.next().expect("there is a cluster at least");
    let mut run = engine::Run::of(first, launched.proven, threads.terms.scheduler.cores);
    // Nobody writes any more: those that were abandoned see that they were.
    parts.for_each(|other| run.absorb(other));
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
    let run = run.with_counts(engine::Counts {
        epoch_ns,
        allocations,
        ..engine::Counts::default()
    });
    edge::end_run(&run);
    Run {
        run,
        faults,
        counts,
    }
}

/// Copies events into the record, with the level of who releases jobs, so that nobody who waits for
/// the lock waits for those that compute.
fn events(control: Control) -> impl Fn(&mut Kept<File>) {
    move |record| {
        control.raise();
        while record.take_events(|cluster, take| {
            control.with_scheduler(cluster, |scheduler| take(&scheduler.log.journal));
        }) {}
        control.lower();
    }
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
    /// Returns the faults, of each cluster in their order.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Returns what every platform tells of it.
    #[must_use]
    pub fn into_run(self) -> engine::Run {
        self.run
    }

    /// Returns how often the threads did what.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }
}
