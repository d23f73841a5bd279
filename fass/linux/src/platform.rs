//! Linux as the platform of `fass`, one for the program.
//!
//! The module also contains a run: its threads while the run goes on, and its results afterwards.

use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use fass::Occupation;
use fass::edge::{BootRecord, Edge};
use fass::log::LogLine;
use fass::platform::{
    Clock, LaunchError, LockWords, Plan, Platform, RunConfig, SubtaskRunner, at_edge,
};
use sched_dag::engine::{self, Engine, ProvenBounds};
use sched_dag::lifecycle::{self, Parts, Request, WaitId};
use sched_dag::{DagId, Instance, Journal};

use crate::budgets::Budgets;
use crate::control::{self, Control};
use crate::edge::{self, FILE, File, Sending, unpoisoned};
use crate::level::Levels;
use crate::office::Office;
use crate::section;
use crate::state::{Fault, Number, State, ThreadPort};
use crate::team::{self, Team, with_own_worker};
use crate::{clock, sys};

/// The platform of the program.
pub(crate) struct Host {
    threads: Mutex<Option<Threads>>,
    launched: Mutex<Option<Launched>>,
}

pub(crate) static HOST: Host = Host {
    threads: Mutex::new(None),
    launched: Mutex::new(None),
};

/// The memory, in bytes, of which the journals of all clusters together may take a quarter.
const JOURNAL_BYTES: usize = 1 << 30;

impl Host {
    /// Returns the platform of the next commit; `None` before there is a machine.
    pub(crate) fn threads(&self) -> MutexGuard<'_, Option<Threads>> {
        self.threads.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the latest committed plan.
    pub(crate) fn take_launched(&self) -> Option<Launched> {
        let mut launched = self.launched.lock();
        let launched = launched.as_deref_mut();
        launched.map_or(None, Option::take)
    }
}

impl Platform for Host {
    fn terms(&self) -> RunConfig {
        let threads = self.threads();
        // Without a machine, the terms of a single core.
        threads
            .as_ref()
            .map_or(RunConfig::of_cores(1), |of| of.terms.clone())
    }

    #[inline]
    fn now_ns(&self) -> u64 {
        clock::now_ns()
    }

    fn clock(&self) -> &'static Clock {
        static CLOCK: Clock = clock::now_ns;
        &CLOCK
    }

    fn may_call_app(&self) -> bool {
        team::may_call_app()
    }

    fn execute_for(&self, duration: Duration, how: Occupation) {
        let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        if how == Occupation::Hold && with_own_worker(|worker| worker.hold(ns)).is_some() {
            return;
        }
        // Processor time, not the clock: the time of a preemption is no execution.
        let end_ns = sys::own_processor_time_ns().saturating_add(ns);
        while sys::own_processor_time_ns() < end_ns {
            std::hint::spin_loop();
        }
    }

    fn raise(&self, plan: u64, dag: DagId) {
        assert!(
            with_own_worker(|_| ()).is_none(),
            "a subtask raises a signal that it was not registered with; register it by \
             `dag.using(signal.raising())`"
        );
        let is_its = |control: &Control| control.office.plan == plan;
        if let Some(control) = control::latest().filter(is_its) {
            control.office.send(None, Request::Signal(dag));
        }
    }

    fn answer(&self, plan: u64, wait: WaitId) {
        let is_its = |control: &Control| control.office.plan == plan;
        if let Some(control) = control::latest().filter(is_its) {
            control.office.send(None, Request::Answer(wait));
        }
    }

    fn running(&self) -> Option<(u64, Instance)> {
        let instance = edge::running()?;
        Some((team::own_plan()?, instance))
    }

    fn is_in_run(&self) -> bool {
        let launched = self.launched.lock();
        // While a plan is still to be taken, its run is to come.
        control::latest().is_some() && launched.is_ok_and(|launched| launched.is_none())
    }

    fn section(&self, lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
        section::with(lock, section)
    }

    fn at_edge(&self, work: &mut dyn FnMut(&mut Edge)) {
        work(&mut edge::get());
    }

    fn log(&self, mut line: LogLine) {
        (line.instance, line.at_ns) = edge::here();
        line.keep();
    }

    fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
        let Some(threads) = self.threads().clone() else {
            let line = "there is no `Linux` yet; make one before the commit";
            return Err(LaunchError::new(line));
        };
        if control::latest().is_some() {
            let line =
                "other DAGs are committed already; run them first, or commit all in one call";
            return Err(LaunchError::new(line));
        }
        // The app's code decodes restored values, so no lock may be held here.
        let mut file = unpoisoned(&FILE).take();
        let is_launched = at_edge::launch(self, &mut plan, file.as_mut());
        *unpoisoned(&FILE) = file;
        // Only now, so that the file is back even if the launch is refused.
        is_launched?;
        let divided = lifecycle::divide(&plan.task_set, plan.lifecycle.as_deref());
        let (letters, parts) = divided.map_err(LaunchError::new)?;
        let office = Office::new(plan.number, &plan.task_set, letters, threads.levels);
        let office = Arc::new(office);
        let proven = plan.proven.clone();
        let control = Control {
            teams: teams(plan, parts, &threads, &office),
            office,
        };
        control::set(Some(control.clone()));
        let launched = Launched {
            control,
            proven,
            threads,
        };
        let mut place = self.launched.lock().unwrap_or_else(PoisonError::into_inner);
        *place = Some(launched);
        Ok(())
    }
}

/// Makes the state shared by the threads of each cluster.
fn teams(plan: Plan, parts: Parts, threads: &Threads, office: &Arc<Office>) -> Arc<[Arc<Team>]> {
    let (task_set, options) = (&plan.task_set, threads.terms.scheduler);
    let mut runners: Vec<Vec<SubtaskRunner>> = task_set.clusters().map(|_| Vec::new()).collect();
    for runner in SubtaskRunner::all(task_set, plan.bodies) {
        let cluster = task_set.dag(runner.instance.dag).cluster();
        runners[cluster.index()].push(runner);
    }
    let share = JOURNAL_BYTES / runners.len();
    let most_events = threads.terms.most_events / runners.len() as u64;
    let journal = |cluster| Journal::of_cluster(task_set, cluster, share, most_events);
    let after_fault = &plan.after_fault;
    let engines =
        Engine::of_clusters::<ThreadPort<'_>>(task_set, options, parts, after_fault, journal);
    let team = |(engine, runners): (Engine<_, _>, _)| {
        let cores = task_set.cores_of(engine.cluster, options.cores);
        let processors = &threads.processors[cores.start as usize..cores.end as usize];
        let wcets = threads.terms.budget_factor;
        let state = State::new(engine, office, runners, processors.into(), wcets);
        let idle = (threads.polls, threads.skips_idle);
        Arc::new(Team::new(state, office, idle, wcets))
    };
    engines.zip(runners).map(team).collect()
}

/// Time between the start of a run and its first release.
const LEAD_NS: u64 = 1_000_000;

/// The platform of the next commits.
#[derive(Clone, Debug)]
pub(crate) struct Threads {
    /// The terms of the commits to come.
    pub(crate) terms: RunConfig,
    pub(crate) processors: Box<[u32]>,
    pub(crate) levels: Option<Levels>,
    /// Whether idle threads watch instead of sleeping.
    pub(crate) polls: bool,
    /// Whether the run's time skips idle intervals.
    pub(crate) skips_idle: bool,
    /// Counts the program's allocations so far.
    pub(crate) allocations: fn() -> u64,
}

/// A committed plan.
pub(crate) struct Launched {
    pub(crate) control: Control,
    pub(crate) proven: ProvenBounds,
    pub(crate) threads: Threads,
}

/// Counts of the run's hand-offs, calls and preemptions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Completions that handed their core the next instance: same thread, no wake-up.
    pub hand_offs: u64,
    /// Calls of workers, and instances handed to them. Where workers sleep, each costs a wake-up by
    /// the kernel.
    pub calls: u64,
    /// Instances that lost their core to a more urgent instance.
    pub preemptions: u64,
}

/// The results of a finished run: the [report of every platform](engine::Run), its faults, and the
/// counts of its threads.
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

/// Starts the threads of a committed plan, waits until all its DAGs are over, and returns the
/// results. Releases count from `epoch_ns`, or from 1 ms after the threads are ready.
pub(crate) fn run(launched: Launched, epoch_ns: Option<u64>) -> Run {
    let (threads, Control { office, teams }) = (&launched.threads, &launched.control);
    // Giving a thread up must not allocate in the run.
    section::make_room(teams.iter().map(|team| team.workers.len()).sum());
    let workers = teams.iter().map(|team| {
        let numbers = 0..team.lock().later.start;
        numbers.map(|number| team.begin_worker(number)).collect()
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
    let epoch_ns = epoch_ns.unwrap_or_else(|| clock::now_ns() + LEAD_NS);
    let sending = edge::begin_run(epoch_ns, events(launched.control.clone()));
    // Counted from here: beginning the threads has allocated.
    let allocations = (threads.allocations)();
    teams.iter().for_each(|team| team.begin(epoch_ns));
    office.wait_until_over();
    let allocations = (threads.allocations)() - allocations;
    releases.into_iter().for_each(join);
    sending.into_iter().for_each(Sending::leave);
    let mut states: Vec<_> = teams.iter().map(|team| team.lock()).collect();
    let abandoned: Vec<Vec<Number>> = states.iter().map(|state| state.abandoned.clone()).collect();
    let mut parts = states.iter_mut().map(|state| &mut state.engine);
    let first = parts.next().expect("there is a cluster at least");
    let mut run = engine::Run::from_engine(first, launched.proven, threads.terms.scheduler.cores);
    // Nobody writes any more: abandoned workers see that they are abandoned.
    parts.for_each(|other| run.absorb(other));
    let mut counts = Counts::default();
    let mut faults = Vec::new();
    for state in &mut states {
        counts.hand_offs += state.hand_offs;
        counts.calls += state.calls;
        counts.preemptions += state.preemptions;
        faults.append(&mut state.faults);
    }
    // Before the threads are joined: on their way out, workers may still take the lock.
    drop(states);
    for (workers, abandoned) in workers.into_iter().zip(abandoned) {
        for (number, thread) in workers.into_iter().enumerate() {
            if !abandoned.contains(&number) {
                join(thread);
            }
        }
    }
    let run = run.with_counts(engine::RunCounts {
        epoch_ns,
        allocations,
        ..engine::RunCounts::default()
    });
    edge::end_run(&run);
    Run {
        run,
        faults,
        counts,
    }
}

/// Copies events into the record at the level of the release thread. So threads waiting for the
/// lock do not wait for computing threads.
fn events(control: Control) -> impl Fn(&mut BootRecord<File>) {
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

fn join(thread: JoinHandle<()>) {
    if let Err(panic) = thread.join() {
        std::panic::resume_unwind(panic);
    }
}

impl Run {
    /// Returns the faults, in order within each cluster.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Returns the part of the results common to every platform.
    #[must_use]
    pub fn into_run(self) -> engine::Run {
        self.run
    }

    /// Returns the counts of hand-offs, calls and preemptions.
    pub const fn counts(&self) -> Counts {
        self.counts
    }
}
