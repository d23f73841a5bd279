//! The driver in virtual time: a [`Scheduler`] run without a machine.
//!
//! Time jumps from event to event. What the cores do comes from a
//! [`Workload`], which is asked once for each instance, at its start, how long
//! it executes; it may run the instance's real function to find out.
//!
//! An instance that executes for no time finishes at the instant of its start,
//! after the dispatch that started it; another dispatch at the same instant
//! follows, and so on until nothing happens any more.
//!
//! A workload may let an instance fail at the end of its execution time, which
//! ends its DAG or costs its job. Of what ends at one instant, completions come before
//! failures, and these in the order of their instances.
//!
//! After [`VirtualTime::new`] nothing is allocated here.
//!
//! ```
//! use std::sync::Arc;
//! use sched_dag::virtual_time::{End, ExecutionTimes, VirtualTime};
//! use sched_dag::{
//!     CommitOptions, DagId, DagSpec, Policy, Preemption, Scheduler, SchedulerOptions, SubtaskSpec, verify,
//! };
//!
//! let dag = DagSpec {
//!     period_ns: Some(100),
//!     relative_deadline_ns: Some(50),
//!     jobs: Some(3),
//!     subtasks: vec![SubtaskSpec::default(), SubtaskSpec::default()],
//!     edges: vec![(0, 1)],
//!     ..DagSpec::default()
//! };
//! let verified = verify(&[dag], &CommitOptions::new(Policy::Edf, 1)).expect("the DAG is right");
//! let options = SchedulerOptions { policy: Policy::Edf, preemption: Preemption::Enabled, cores: 1 };
//! let mut run = VirtualTime::new(Scheduler::new(Arc::new(verified.task_set), options));
//! assert_eq!(run.run(&mut ExecutionTimes(|_instance| 20)), End::Finished);
//! assert_eq!(run.now_ns(), 240);
//! assert_eq!(run.scheduler().statistics(DagId(0)).misses, 0);
//! ```

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use crate::ids::{CoreId, DagId, Instance};
use crate::scheduler::heap::IndexedHeap;
use crate::scheduler::{Decision, HandOff, Observer, Scheduler};
use crate::task_set::TaskSet;

/// What instances do and how long it takes them.
///
/// Beside [`execute`](Self::execute), the methods report what happens in the
/// order in which it happens, those of [`Observer`] among them.
pub trait Workload: Observer {
    /// Returns the execution time of an instance in nanoseconds. Called once
    /// for each instance, at its start; 0 is allowed.
    fn execute(&mut self, instance: Instance, now_ns: u64) -> u64;

    /// Reports whether an instance fails, instead of finishing, when its
    /// execution time is over: then its DAG is ended, or its job dropped. Called once for each
    /// instance, at its end.
    fn fails(&mut self, instance: Instance) -> bool {
        let _ = instance;
        false
    }

    /// Reports whether there is another function for the subtask of an instance that
    /// fails. Called once for each, right before the scheduler is told.
    fn is_replaceable(&mut self, instance: Instance) -> bool {
        let _ = instance;
        false
    }

    /// Returns when the next signal to a sporadic DAG comes. Asked again at every
    /// instant; what has finished may send one, too.
    fn next_signal_ns(&self) -> Option<u64> {
        None
    }

    /// Returns the DAG of the next signal that has come by now, and forgets that.
    fn take_signal(&mut self, now_ns: u64) -> Option<DagId> {
        let _ = now_ns;
        None
    }

    /// Reports whether the run is to stop, though jobs are left. Asked before each
    /// instant.
    fn stops(&self) -> bool {
        false
    }

    /// An instant begins, in which all that follows happens until the next one.
    /// There may be several at one time.
    fn instant(&mut self, now_ns: u64) {
        let _ = now_ns;
    }

    /// The core begins the instance; called before [`execute`](Self::execute).
    fn started(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }

    /// The core gives up the instance, which is not finished.
    fn preempted(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }

    /// The core continues the instance.
    fn resumed(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }

    /// The instance has finished on the core; called before its successors
    /// become ready.
    fn finished(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }

    /// The instance has failed on the core; called before what follows from that.
    fn failed(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        let _ = (instance, core, now_ns);
    }
}

/// A workload of which only the execution times matter.
#[derive(Debug)]
pub struct ExecutionTimes<F>(
    /// Returns the execution time of an instance in nanoseconds.
    pub F,
);

impl<F> Observer for ExecutionTimes<F> {}

impl<F: FnMut(Instance) -> u64> Workload for ExecutionTimes<F> {
    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        (self.0)(instance)
    }
}

/// A scheduler in virtual time.
#[derive(Debug)]
pub struct VirtualTime {
    scheduler: Scheduler,
    cores: Cores,
    /// What fails at the present instant.
    failing: Vec<(Instance, CoreId)>,
}

/// What the cores execute, and what is left of it.
#[derive(Debug)]
struct Cores {
    /// When the instance on each busy core finishes if nothing intervenes; at
    /// one instant the core with the smaller number comes first.
    finish_times: IndexedHeap<(u64, CoreId)>,
    /// What each core executes.
    executing: Box<[Option<Instance>]>,
    /// What is left of each preempted instance, by its vertex.
    remaining_ns: Box<[u64]>,
    task_set: Arc<TaskSet>,
}

/// Why a run in virtual time has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum End {
    /// Every job of every DAG has ended; an ended DAG has no further ones. Or
    /// nothing happens any more, because a sporadic DAG gets no further signal.
    Finished,
    /// The next event lies after the time up to which the run should go.
    TimeReached,
    /// The instance would finish after the last time there is. The run cannot
    /// be continued.
    TimeOverflow(Instance),
    /// The workload has [stopped](Workload::stops) it.
    Stopped,
}

impl VirtualTime {
    /// Makes a driver for a scheduler that has not begun, and allocates all that
    /// it will need.
    #[must_use]
    pub fn new(scheduler: Scheduler) -> Self {
        let cores = scheduler.options().cores as usize;
        let subtasks = scheduler.task_set().vertices();
        Self {
            cores: Cores {
                finish_times: IndexedHeap::new(cores),
                executing: vec![None; cores].into_boxed_slice(),
                remaining_ns: vec![0; subtasks].into_boxed_slice(),
                task_set: Arc::clone(scheduler.task_set()),
            },
            scheduler,
            failing: Vec::with_capacity(cores),
        }
    }

    /// Runs until every job has ended.
    ///
    /// With a DAG without a limit of jobs this is the end of time; see
    /// [`run_until`](Self::run_until).
    pub fn run(&mut self, workload: &mut impl Workload) -> End {
        self.run_until(u64::MAX, workload)
    }

    /// Runs all events up to and including those at `until_ns`. May be called
    /// again with a later time.
    pub fn run_until(&mut self, until_ns: u64, workload: &mut impl Workload) -> End {
        while !workload.stops() {
            let finish_ns = self.cores.next_finish_ns();
            let scheduler_ns = self.scheduler.next_event_ns();
            let signal_ns =
                (workload.next_signal_ns()).map(|signal_ns| signal_ns.max(self.scheduler.now_ns()));
            let events = [finish_ns, scheduler_ns, signal_ns];
            let Some(event_ns) = events.into_iter().flatten().min() else {
                return End::Finished;
            };
            if event_ns > until_ns {
                return End::TimeReached;
            }
            if let Err(instance) = self.step(event_ns, workload) {
                return End::TimeOverflow(instance);
            }
        }
        End::Stopped
    }

    /// Returns the time of the last event, in nanoseconds.
    #[must_use]
    pub const fn now_ns(&self) -> u64 {
        self.scheduler.now_ns()
    }

    /// Returns the scheduler, for its statistics.
    #[must_use]
    pub const fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }

    /// Goes through one instant. An instance that cannot finish is the error.
    fn step(&mut self, now_ns: u64, workload: &mut impl Workload) -> Result<(), Instance> {
        workload.instant(now_ns);
        if let Some(done) = self.finish(now_ns, workload) {
            return done;
        }
        let mut moment = self.scheduler.at(now_ns);
        self.failing.sort_unstable();
        for (instance, core) in self.failing.drain(..) {
            workload.failed(instance, core, now_ns);
            if workload.is_replaceable(instance) {
                moment.fail_replaceable(instance, workload);
            } else {
                moment.fail(instance, workload);
            }
        }
        while let Some(dag) = workload.take_signal(now_ns) {
            moment.signal(dag, workload);
        }
        for &decision in moment.release_due(workload).dispatch() {
            self.cores.carry_out(decision, now_ns, workload)?;
        }
        Ok(())
    }

    /// Completes what finishes at `now_ns`, and notes what fails instead.
    /// If it is one instance and nothing else happens, that may be the whole
    /// instant: then the result is the instant's.
    fn finish(
        &mut self,
        now_ns: u64,
        workload: &mut impl Workload,
    ) -> Option<Result<(), Instance>> {
        let is_quiet =
            |workload: &mut _| Workload::next_signal_ns(workload).is_none_or(|ns| ns > now_ns);
        let mut finished = 0;
        while let Some((instance, core)) = self.cores.take_finished(now_ns) {
            finished += 1;
            let is_last = self.cores.next_finish_ns().is_none_or(|ns| ns > now_ns);
            if workload.fails(instance) {
                self.failing.push((instance, core));
                continue;
            }
            workload.finished(instance, core, now_ns);
            if finished > 1 || !is_last || !is_quiet(workload) {
                self.scheduler.at(now_ns).complete(instance, workload);
                continue;
            }
            let vertex = self.scheduler.vertex(instance);
            return match self.scheduler.hand_off(now_ns, core, vertex, workload) {
                HandOff::To(_, decision) => Some(self.cores.carry_out(decision, now_ns, workload)),
                HandOff::Idle => Some(Ok(())),
                HandOff::Open => None,
            };
        }
        None
    }
}

impl Cores {
    fn next_finish_ns(&self) -> Option<u64> {
        self.finish_times.peek().map(|((at_ns, _), _)| at_ns)
    }

    /// Takes an instance that finishes at `now_ns` from its core.
    fn take_finished(&mut self, now_ns: u64) -> Option<(Instance, CoreId)> {
        let ((_, core), index) = self
            .finish_times
            .peek()
            .filter(|((at_ns, _), _)| *at_ns <= now_ns)?;
        self.finish_times.remove(index);
        Some((self.executing[index].take()?, core))
    }

    /// Carries out a decision. An instance that cannot finish is the error.
    fn carry_out(
        &mut self,
        decision: Decision,
        now_ns: u64,
        workload: &mut impl Workload,
    ) -> Result<(), Instance> {
        let (core, instance) = (decision.core(), decision.instance());
        let index = self.task_set.vertex(instance).index();
        let remaining_ns = match decision {
            Decision::Preempt { .. } => {
                let finish_ns = self.finish_times.key(core.index());
                self.remaining_ns[index] = finish_ns.map_or(now_ns, |(at_ns, _)| at_ns) - now_ns;
                workload.preempted(instance, core, now_ns);
                return Ok(());
            }
            Decision::Resume { .. } => {
                workload.resumed(instance, core, now_ns);
                self.remaining_ns[index]
            }
            Decision::Start { .. } => {
                workload.started(instance, core, now_ns);
                workload.execute(instance, now_ns)
            }
        };
        let finish_ns = now_ns.checked_add(remaining_ns).ok_or(instance)?;
        self.finish_times.set(core.index(), (finish_ns, core));
        self.executing[core.index()] = Some(instance);
        Ok(())
    }
}
