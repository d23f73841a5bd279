//! The scheduler with the bodies that it decides about: one per run.
//!
//! Every event passes through here, under the one lock: a completion, by the
//! core that finished, or the timer, on core 0. Each makes one step of the
//! scheduler (completions, releases, one dispatch) and notes what each core is
//! to run; [`placement`] then brings each core there.
//!
//! Times inside are the scheduler's: nanoseconds since the run's `epoch_ns`.

mod core_set;
mod placement;
mod watcher;

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;

use fass::{Body, LaunchError, Plan};
use sched_dag::record::Record;
use sched_dag::{
    CoreId, DagId, Decision, Instance, Scheduler, SchedulerOptions, SubtaskId, TaskSet,
};

use crate::machine::clock;
use crate::machine::context::Parked;
use crate::machine::interrupt::Interrupted;
use crate::machine::spinlock::SpinLock;
use crate::machine::this_core::{self, Core};
use crate::machine::timer::{self, Alarm};
use crate::platform::KERNEL;
use crate::trace::{self, What};
use crate::{contexts, worker};
use core_set::CoreSet;
use placement::{Next, Placement};
use watcher::Watcher;

/// An instance that a core runs, with what it takes.
pub(crate) struct Assignment {
    pub(crate) instance: Instance,
    /// The time that it may execute for, `u64::MAX` if for ever.
    budget_ns: u64,
    body: Body,
}

impl Assignment {
    /// Calls the subtask's function for this instance.
    pub(crate) fn run(&mut self) {
        self.body.run(self.instance.job);
    }
}

/// What a core is to do next.
pub(crate) enum Work {
    /// Call the subtask's function for this instance.
    Run(Assignment),
    /// Go on with this context.
    Continue(Parked),
    /// Nothing.
    Rest,
}

/// What a step of the scheduler is about, besides the time.
enum Event {
    /// A release or a deadline is due.
    Time,
    /// The instance has finished.
    Completed(Instance),
    /// The instance was ended by a fault, and its DAG ends with it.
    Failed(Instance),
}

/// A run, from its launch until its record is taken.
pub(crate) struct Execution {
    scheduler: Scheduler,
    placement: Placement<Body, Parked>,
    /// What core 0 does when nothing is assigned to it, while something is.
    background: Option<Parked>,
    pub(crate) record: Record,
    /// The scheduler's latest time; it never goes back, although clocks of
    /// different cores may be read in another order than they get the lock.
    latest_ns: u64,
    /// When the next dispatch is due, on the clock, if it waits for further events
    /// of the instant in hand.
    dispatch_due_ns: Option<u64>,
}

static EXECUTION: SpinLock<Option<Execution>> = SpinLock::new(None);

/// Time 0 of the run, on the clock.
static EPOCH_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// When core 0's timer shall next step the scheduler, on the clock; `u64::MAX`
/// if never.
static NEXT_EVENT_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// Whether all jobs of the run have ended.
static FINISHED: AtomicBool = AtomicBool::new(false);

/// Jobs that have ended in this run.
static JOBS_ENDED: AtomicU64 = AtomicU64::new(0);

/// Prepares a plan to be run. Takes all memory that the run will need.
pub(crate) fn prepare(plan: Plan, options: SchedulerOptions) -> Result<(), LaunchError> {
    if EXECUTION.lock().is_some() {
        return Err(LaunchError::new(
            "other DAGs are committed already; run them first, or commit all in one call",
        ));
    }
    let record = new_record(&plan.task_set)?;
    let subtasks: usize = plan.bodies.iter().map(|bodies| bodies.len()).sum();
    let cores = usize::try_from(options.cores).unwrap_or(usize::MAX);
    let total = subtasks.saturating_add(cores.saturating_mul(2));
    contexts::provide(total).map_err(|_| {
        let kib = contexts::STACK_BYTES / 1024;
        LaunchError::new(format!(
            "{subtasks} subtasks and {cores} cores need {total} stacks of {kib} KiB, more than \
             there is memory for; register fewer subtasks or give the machine more memory"
        ))
    })?;
    let execution = Execution {
        scheduler: Scheduler::new(Arc::new(plan.task_set), options),
        placement: Placement::new(plan.bodies, cores),
        background: None,
        record,
        latest_ns: 0,
        dispatch_due_ns: None,
    };
    *EXECUTION.lock() = Some(execution);
    Ok(())
}

fn new_record(task_set: &TaskSet) -> Result<Record, LaunchError> {
    let heap = crate::memory::heap::usage();
    let free = heap.capacity_bytes - heap.in_use_bytes;
    let needed = Record::size_of(task_set);
    let record = needed
        .filter(|bytes| *bytes <= free / 2)
        .and_then(|_| Record::new(task_set));
    record.ok_or_else(|| {
        let (free, needed) = (free / 1024, needed.map_or(usize::MAX, |bytes| bytes / 1024));
        LaunchError::new(format!(
            "the record of all jobs needs {needed} KiB and {free} KiB of memory are free; \
             release fewer jobs or give the machine more memory"
        ))
    })
}

/// Sets time 0 of the prepared run, from which the releases count. Returns the
/// number of jobs to come, or `None` if nothing is prepared.
pub(crate) fn begin(epoch_ns: u64) -> Option<u64> {
    let mut place = EXECUTION.lock();
    let execution = place.as_mut()?;
    EPOCH_NS.store(epoch_ns, Ordering::Relaxed);
    trace::clear();
    JOBS_ENDED.store(0, Ordering::Relaxed);
    execution.publish();
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

/// Returns when core 0's timer shall next step the scheduler.
pub(crate) fn next_event_ns() -> u64 {
    NEXT_EVENT_NS.load(Ordering::Acquire)
}

/// Calls `with` with the names of an instance's DAG and subtask, if they can be
/// had without waiting.
pub(crate) fn try_names(instance: Instance, with: impl FnOnce(&str, &str)) {
    let place = EXECUTION.try_lock();
    let Some(execution) = place.as_ref().and_then(|execution| execution.as_ref()) else {
        return;
    };
    let dag = execution.task_set().dags().get(instance.dag.index());
    let subtask = dag.and_then(|dag| dag.subtasks().get(instance.subtask.index()));
    if let (Some(dag), Some(subtask)) = (dag, subtask) {
        with(dag.name(), subtask.name());
    }
}

/// Returns copies of the names of an instance's DAG and subtask.
pub(crate) fn names(instance: Instance) -> (String, String) {
    let place = EXECUTION.lock();
    let dag = place
        .as_ref()
        .map(|execution| execution.task_set().dag(instance.dag));
    dag.map_or_else(Default::default, |dag| {
        (
            dag.name().into(),
            dag.subtask(instance.subtask).name().into(),
        )
    })
}

/// Returns the instance that a core runs, without the lock.
pub(crate) fn running(core: &Core) -> Option<Instance> {
    let [dag, job, subtask] = core
        .running
        .each_ref()
        .map(|field| field.load(Ordering::Relaxed));
    Some(Instance {
        dag: DagId(u32::try_from(dag).ok()?),
        job,
        subtask: SubtaskId(u32::try_from(subtask).ok()?),
    })
}

/// Notes which instance a core runs, for [`running`].
fn note_running(core: &Core, instance: Option<Instance>) {
    core.note_running(instance.map_or([u64::MAX; 3], |instance| {
        [
            u64::from(instance.dag.0),
            instance.job,
            u64::from(instance.subtask.0),
        ]
    }));
}

/// Finds what this core, which runs nothing, is to do. Interrupts are disabled.
pub(crate) fn find_work() -> Work {
    let mut place = EXECUTION.lock();
    place.as_mut().map_or(Work::Rest, Execution::find_work)
}

/// Notes that this core starts its instance. Interrupts are disabled.
pub(crate) fn note_start(assignment: &Assignment, start_ns: u64) {
    let budget_end_ns = start_ns.saturating_add(assignment.budget_ns);
    this_core::get().context().set_budget_end(budget_end_ns);
    timer::set(Alarm::Budget, budget_end_ns);
    trace::instance(
        What::Start,
        since_epoch(start_ns),
        here(),
        assignment.instance,
    );
}

/// Converts a time on the clock to the run's time.
fn since_epoch(time_ns: u64) -> u64 {
    time_ns.saturating_sub(EPOCH_NS.load(Ordering::Relaxed))
}

/// Returns the core that executes this. Interrupts are disabled.
fn here() -> CoreId {
    CoreId(this_core::get().index)
}

/// Reports that this core has run its instance, and finds what it is to do
/// next. Interrupts are disabled.
pub(crate) fn complete(finished: Assignment, start_ns: u64, finish_ns: u64) -> Work {
    let mut place = EXECUTION.lock();
    let Some(execution) = place.as_mut() else {
        return Work::Rest;
    };
    let here = here();
    let Assignment { instance, body, .. } = finished;
    timer::set(Alarm::Budget, u64::MAX);
    trace::instance(What::Finish, since_epoch(finish_ns), here, instance);
    execution.placement.finish(here.index(), instance, body);
    if let Some(record) = execution.record.instance_mut(instance) {
        record.start_ns = Some(since_epoch(start_ns));
        record.finish_ns = Some(since_epoch(finish_ns));
        record.core = Some(here);
        record.runs += 1;
    }
    let woken = execution.step(finish_ns, Event::Completed(instance));
    let work = execution.find_work();
    drop(place);
    woken.wake();
    work
}

/// Returns how long an instance may execute for, `u64::MAX` if for ever.
pub(crate) fn budget_ns(instance: Instance) -> u64 {
    EXECUTION
        .lock()
        .as_ref()
        .map_or(u64::MAX, |execution| execution.budget_ns(instance))
}

/// Ends this core's instance, and with it its DAG, because of a fault. The
/// context that ran it must not be resumed. Interrupts are disabled.
pub(crate) fn fail(now_ns: u64) {
    let mut place = EXECUTION.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let core = this_core::get();
    let Some(instance) = execution.placement.lose(core.index as usize) else {
        return;
    };
    trace::instance(
        What::Ended,
        since_epoch(now_ns),
        CoreId(core.index),
        instance,
    );
    note_running(core, None);
    let woken = execution.step(now_ns, Event::Failed(instance));
    drop(place);
    woken.wake();
}

/// Lets the scheduler take a step if `is_event`, and lets this core follow its
/// decisions. In an interrupt handler.
pub(crate) fn interrupt(interrupted: &mut Interrupted, now_ns: u64, is_event: bool) {
    let mut place = EXECUTION.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let mut woken = CoreSet::default();
    if is_event {
        woken = execution.step(now_ns, Event::Time);
    }
    if let Some(waiting) = execution.follow(interrupted, now_ns) {
        woken.insert(waiting.0);
    }
    drop(place);
    woken.wake();
}

/// Sets core 0's alarm for the next event.
pub(crate) fn arm_next_event() {
    timer::set(Alarm::Schedule, NEXT_EVENT_NS.load(Ordering::Acquire));
}

impl Execution {
    /// Makes one step of the scheduler and returns which other cores have to
    /// look at what they should run.
    fn step(&mut self, now_ns: u64, event: Event) -> CoreSet {
        let here = this_core::get().index;
        let Self {
            scheduler,
            placement,
            record,
            latest_ns,
            dispatch_due_ns,
            ..
        } = self;
        *latest_ns = since_epoch(now_ns).max(*latest_ns);
        let mut watcher = Watcher { record, placement };
        let mut moment = scheduler.at(*latest_ns);
        match event {
            Event::Time => {}
            Event::Completed(instance) => moment.complete(instance, &mut watcher),
            Event::Failed(instance) => moment.fail(instance, &mut watcher),
        }
        let mut woken = CoreSet::default();
        let due_ns = *dispatch_due_ns.get_or_insert(now_ns.saturating_add(KERNEL.coincidence_ns()));
        if now_ns < due_ns {
            self.announce(&mut woken);
            return woken;
        }
        *dispatch_due_ns = None;
        let mut preempted = None;
        for decision in moment.release_due(&mut watcher).dispatch() {
            placement.decide(*decision);
            let (core, instance) = (decision.core(), decision.instance());
            if let Decision::Preempt { .. } = decision {
                preempted = Some(core);
                if let Some(record) = record.instance_mut(instance) {
                    record.preemptions += 1;
                }
            } else if preempted == Some(core) {
                trace::instance(What::Request, since_epoch(clock::now_ns()), core, instance);
            }
            if core.0 != here {
                woken.insert(core.0);
            }
        }
        self.announce(&mut woken);
        woken
    }

    /// Publishes the next event, and sees to it that core 0 waits for it.
    fn announce(&self, woken: &mut CoreSet) {
        let earlier = NEXT_EVENT_NS.load(Ordering::Relaxed);
        self.publish();
        if this_core::get().index == 0 {
            arm_next_event();
        } else if NEXT_EVENT_NS.load(Ordering::Relaxed) < earlier || is_finished() {
            woken.insert(0);
        }
    }

    /// Lets everyone see when the next event is, and whether there is any.
    fn publish(&self) {
        let next = self.scheduler.next_event_ns();
        let next = next.map_or(u64::MAX, |next| {
            next.saturating_add(EPOCH_NS.load(Ordering::Relaxed))
        });
        let next = self.dispatch_due_ns.unwrap_or(next);
        NEXT_EVENT_NS.store(next, Ordering::Release);
        FINISHED.store(self.scheduler.is_finished(), Ordering::Release);
    }

    /// Finds what this core, which runs nothing, is to do.
    fn find_work(&mut self) -> Work {
        let core = this_core::get();
        let here = core.index as usize;
        let work = match self.placement.next(here) {
            Next::Start(instance, body) => Work::Run(Assignment {
                instance,
                budget_ns: self.budget_ns(instance),
                body,
            }),
            Next::Continue(context) => {
                self.note_resumed(&context, clock::now_ns());
                Work::Continue(context)
            }
            // Only core 0 has a background, and only while it does other work.
            Next::Nothing if here == 0 => self.background.take().map_or(Work::Rest, Work::Continue),
            Next::Nothing => Work::Rest,
        };
        note_running(core, self.placement.current(here));
        work
    }

    /// Makes the core whose interrupt is being handled leave what it should no
    /// longer run. Returns the core that waits for that, if there is one.
    fn follow(&mut self, interrupted: &mut Interrupted, now_ns: u64) -> Option<CoreId> {
        let core = this_core::get();
        let here = core.index as usize;
        let is_background = core.context().is_background();
        let leaves_background = is_background && self.placement.is_wanted(here);
        if !self.placement.must_suspend(here) && !leaves_background {
            return None;
        }
        let suspended = self.placement.detach(here);
        let mut next_is_new = false;
        let next = match self.placement.take_suspended(here) {
            Some(context) => {
                self.note_resumed(&context, now_ns);
                context
            }
            None => {
                next_is_new = true;
                worker::new_context()
            }
        };
        note_running(core, self.placement.current(here));
        let last = interrupted.exchange(next);
        match suspended {
            Some(instance) => {
                last.note_suspended(now_ns);
                trace::instance(
                    What::Suspend,
                    since_epoch(now_ns),
                    CoreId(core.index),
                    instance,
                );
                timer::set(Alarm::Hold, u64::MAX);
                if next_is_new {
                    timer::set(Alarm::Budget, u64::MAX);
                }
                self.placement.suspend(instance, last)
            }
            None => {
                self.background = Some(last);
                None
            }
        }
    }

    /// Returns how long an instance may execute for, `u64::MAX` if for ever.
    fn budget_ns(&self, instance: Instance) -> u64 {
        let subtask = self.task_set().dag(instance.dag).subtask(instance.subtask);
        subtask
            .budget_ns()
            .or_else(|| KERNEL.budget_of_wcet(subtask.wcet_ns()?))
            .unwrap_or(u64::MAX)
    }

    /// Notes that this core's current instance continues in `context`.
    fn note_resumed(&self, context: &Parked, now_ns: u64) {
        context.note_resumed(now_ns);
        timer::set(Alarm::Budget, context.budget_end_ns());
        let here = here();
        if let Some(instance) = self.placement.current(here.index()) {
            trace::instance(What::Resume, since_epoch(now_ns), here, instance);
        }
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
