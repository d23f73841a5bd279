//! The scheduler with the bodies that it decides about: one per run.
//!
//! Every event passes through here, under the one lock: a completion, by the
//! core that finished, or the timer, on core 0. Each makes one step of the
//! scheduler (completions, releases, one dispatch) and leaves the assignments
//! where their cores find them.
//!
//! Bodies move: while an instance is assigned or runs, its body is with its
//! core, otherwise in the table here. So no two cores can hold one body, and
//! nothing about that needs `unsafe`.
//!
//! Times inside are the scheduler's: nanoseconds since the run's `epoch_ns`.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use alloc::sync::Arc;
use alloc::vec::Vec;

use fass::{Body, LaunchError, Plan};
use sched_dag::record::Record;
use sched_dag::{
    CoreId, DagId, Decision, Instance, Observer, Scheduler, SchedulerOptions, TaskSet,
};

use crate::machine::spinlock::SpinLock;
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, this_core};

/// An instance that a core is to run, with what it takes.
pub(crate) struct Assignment {
    pub(crate) instance: Instance,
    body: Body,
}

impl Assignment {
    /// Calls the subtask's function for this instance.
    pub(crate) fn run(&mut self) {
        self.body.run(self.instance.job);
    }
}

/// A run, from its launch until its record is taken.
pub(crate) struct Execution {
    scheduler: Scheduler,
    bodies: Vec<Vec<Option<Body>>>,
    /// For each core what it is to run next.
    assigned: Vec<Option<Assignment>>,
    pub(crate) record: Record,
    epoch_ns: u64,
    /// The scheduler's latest time; it never goes back, although clocks of
    /// different cores may be read in another order than they get the lock.
    latest_ns: u64,
}

static EXECUTION: SpinLock<Option<Execution>> = SpinLock::new(None);

/// When core 0's timer shall next step the scheduler, on the clock; `u64::MAX`
/// if never.
static NEXT_EVENT_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// Whether all jobs of the run have ended.
static FINISHED: AtomicBool = AtomicBool::new(false);

/// Jobs that have ended in this run.
static JOBS_ENDED: AtomicU64 = AtomicU64::new(0);

/// Prepares a plan to be run. Takes all memory that the run will need.
pub(crate) fn prepare(plan: Plan, options: SchedulerOptions) -> Result<(), LaunchError> {
    let heap = crate::memory::heap::usage();
    let free = heap.capacity_bytes - heap.in_use_bytes;
    let needed = Record::size_of(&plan.task_set);
    if needed.is_none_or(|needed| needed > free / 2) {
        let (free, needed) = (free / 1024, needed.map_or(usize::MAX, |bytes| bytes / 1024));
        return Err(LaunchError::new(alloc::format!(
            "the record of all jobs needs {needed} KiB and {free} KiB of memory are free; \
             release fewer jobs or give the machine more memory"
        )));
    }
    let Some(record) = Record::new(&plan.task_set) else {
        return Err(LaunchError::new(
            "the jobs are too many to be recorded; release fewer",
        ));
    };
    let cores = usize::try_from(options.cores).unwrap_or(usize::MAX);
    let execution = Execution {
        scheduler: Scheduler::new(Arc::new(plan.task_set), options),
        bodies: plan
            .bodies
            .into_iter()
            .map(|bodies| bodies.into_iter().map(Some).collect())
            .collect(),
        assigned: (0..cores).map(|_| None).collect(),
        record,
        epoch_ns: u64::MAX,
        latest_ns: 0,
    };
    let mut place = EXECUTION.lock();
    if place.is_some() {
        return Err(LaunchError::new(
            "other DAGs are committed already; run them first, or commit all in one call",
        ));
    }
    *place = Some(execution);
    Ok(())
}

/// Sets time 0 of the prepared run, from which the releases count. Returns the
/// number of jobs to come, or `None` if nothing is prepared.
pub(crate) fn begin(epoch_ns: u64) -> Option<u64> {
    let mut place = EXECUTION.lock();
    let execution = place.as_mut()?;
    execution.epoch_ns = epoch_ns;
    JOBS_ENDED.store(0, Ordering::Relaxed);
    FINISHED.store(execution.scheduler.is_finished(), Ordering::Release);
    execution.publish_next_event();
    let jobs = execution
        .scheduler
        .task_set()
        .dags()
        .iter()
        .map(|dag| dag.jobs().unwrap_or(0));
    Some(jobs.sum())
}

/// Takes the run out when it has ended.
pub(crate) fn end() -> Option<Execution> {
    EXECUTION.lock().take()
}

/// Reports whether all jobs of the run have ended.
pub(crate) fn is_finished() -> bool {
    FINISHED.load(Ordering::Acquire)
}

/// Returns how many jobs have ended in this run.
pub(crate) fn jobs_ended() -> u64 {
    JOBS_ENDED.load(Ordering::Relaxed)
}

/// Calls `with` with the names of an instance's DAG and subtask, if they can be
/// had without waiting.
pub(crate) fn try_names(dag: DagId, subtask: usize, with: impl FnOnce(&str, &str)) {
    let place = EXECUTION.try_lock();
    let Some(execution) = place.as_ref().and_then(|execution| execution.as_ref()) else {
        return;
    };
    let dag = execution.scheduler.task_set().dags().get(dag.index());
    if let Some((dag, subtask)) = dag.and_then(|dag| Some((dag, dag.subtasks().get(subtask)?))) {
        with(dag.name(), subtask.name());
    }
}

/// Takes what has been assigned to core `core`, which is idle.
pub(crate) fn take_assignment(core: u32) -> Option<Assignment> {
    EXECUTION.lock().as_mut()?.assigned[core as usize].take()
}

/// Reports that core `core` has run its instance, and returns the core's next.
pub(crate) fn complete(
    core: u32,
    finished: Assignment,
    start_ns: u64,
    finish_ns: u64,
) -> Option<Assignment> {
    let mut place = EXECUTION.lock();
    let execution = place.as_mut()?;
    let Assignment { instance, body } = finished;
    execution.bodies[instance.dag.index()][instance.subtask.index()] = Some(body);
    let epoch_ns = execution.epoch_ns;
    if let Some(record) = execution.record.instance_mut(instance) {
        record.start_ns = Some(start_ns.saturating_sub(epoch_ns));
        record.finish_ns = Some(finish_ns.saturating_sub(epoch_ns));
        record.core = Some(CoreId(core));
        record.runs += 1;
    }
    let woken = execution.step(finish_ns, Some(instance), core);
    let next = execution.assigned[core as usize].take();
    drop(place);
    woken.wake();
    next
}

/// Lets core 0 step the scheduler, because its timer has fired.
pub(crate) fn timer_event(now_ns: u64) {
    let woken = match EXECUTION.lock().as_mut() {
        Some(execution) => execution.step(now_ns, None, 0),
        None => return,
    };
    woken.wake();
}

/// Sets core 0's alarm for the next event.
pub(crate) fn arm_next_event() {
    timer::set(Alarm::Schedule, NEXT_EVENT_NS.load(Ordering::Acquire));
}

/// Returns when core 0's timer shall next step the scheduler.
pub(crate) fn next_event_ns() -> u64 {
    NEXT_EVENT_NS.load(Ordering::Acquire)
}

impl Execution {
    /// Makes one step of the scheduler on core `here` and returns which other
    /// cores have to be woken.
    fn step(&mut self, now_ns: u64, completed: Option<Instance>, here: u32) -> CoreSet {
        let Self {
            scheduler,
            bodies,
            assigned,
            record,
            epoch_ns,
            latest_ns,
        } = self;
        *latest_ns = now_ns.saturating_sub(*epoch_ns).max(*latest_ns);
        let mut watcher = Watcher {
            record,
            epoch_ns: *epoch_ns,
        };
        let mut moment = scheduler.at(*latest_ns);
        if let Some(instance) = completed {
            moment.complete(instance, &mut watcher);
        }
        let mut woken = CoreSet::default();
        for decision in moment.release_due(&mut watcher).dispatch() {
            // Subtasks are not preempted yet, so every decision is a start.
            if let Decision::Start { core, instance } = *decision {
                let body = bodies[instance.dag.index()][instance.subtask.index()].take();
                assigned[core.index()] = body.map(|body| Assignment { instance, body });
                // A core that completes takes its next instance along.
                if core.0 != here || completed.is_none() {
                    woken.insert(core.0);
                }
            }
        }
        let earlier = NEXT_EVENT_NS.load(Ordering::Relaxed);
        self.publish_next_event();
        let next = NEXT_EVENT_NS.load(Ordering::Relaxed);
        let is_finished = self.scheduler.is_finished();
        FINISHED.store(is_finished, Ordering::Release);
        if here == 0 {
            timer::set(Alarm::Schedule, next);
        } else if next < earlier || is_finished {
            woken.insert(0);
        }
        woken
    }

    fn publish_next_event(&self) {
        let next = self.scheduler.next_event_ns();
        let next = next.map_or(u64::MAX, |next| next.saturating_add(self.epoch_ns));
        NEXT_EVENT_NS.store(next, Ordering::Release);
    }

    /// Returns time 0 of the run, on the clock.
    pub(crate) const fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }

    /// Returns the scheduler, for its model and its counters.
    pub(crate) const fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }

    /// Returns the model.
    pub(crate) fn task_set(&self) -> &Arc<TaskSet> {
        self.scheduler.task_set()
    }
}

/// Writes what the scheduler reports into the record, with the clock's time at
/// that very moment: so a join's latency includes the wait for the lock.
struct Watcher<'a> {
    record: &'a mut Record,
    epoch_ns: u64,
}

impl Watcher<'_> {
    fn now_ns(&self) -> u64 {
        clock::now_ns().saturating_sub(self.epoch_ns)
    }
}

impl Observer for Watcher<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let now_ns = self.now_ns();
        if let Some(record) = self.record.job_mut(dag, job) {
            record.release_ns = Some(release_ns);
            record.released_ns = Some(now_ns);
        }
    }

    fn ready(&mut self, instance: Instance) {
        let now_ns = self.now_ns();
        if let Some(record) = self.record.instance_mut(instance) {
            record.ready_ns = Some(now_ns);
        }
    }

    fn job_completed(&mut self, _: DagId, _: u64, _: sched_dag::JobOutcome) {
        JOBS_ENDED.fetch_add(1, Ordering::Relaxed);
    }
}

/// Some of the cores.
#[derive(Debug, Default)]
struct CoreSet([u64; 4]);

impl CoreSet {
    fn insert(&mut self, core: u32) {
        self.0[(core / 64) as usize] |= 1 << (core % 64);
    }

    /// Interrupts each of the cores so that it looks for work.
    fn wake(&self) {
        for (word, first) in self.0.iter().zip((0..).step_by(64)) {
            let mut left = *word;
            while left != 0 {
                this_core::all()[first + left.trailing_zeros() as usize].wake_up();
                left &= left - 1;
            }
        }
    }
}
