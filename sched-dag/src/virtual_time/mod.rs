//! The driver in virtual time: a [`Scheduler`] run without a machine, or one for each cluster.
//!
//! Time jumps from event to event. What the cores do comes from a
//! [`Workload`], which is asked once for each instance, at its start, how long
//! it executes; it may run the instance's real function to find out.
//!
//! An instance that executes for no time finishes at the instant of its start,
//! after the dispatch that started it; another dispatch at the same instant
//! follows, and so on until nothing happens any more.
//!
//! Clusters have one clock: what ends at one instant ends in all of them before anything
//! starts in one.
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
//! assert_eq!(run.scheduler_of(DagId(0)).statistics(DagId(0)).misses, 0);
//! ```

mod cluster;
mod serving;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::ids::{ClusterId, CoreId, DagId, Instance};
use crate::journal::{Event, What};
use crate::kept::Journal;
use crate::lifecycle::{Lifecycle, Request};
use crate::policy::SchedulerOptions;
use crate::scheduler::{Notice, Scheduler};
use crate::task_set::TaskSet;
use cluster::Cluster;

/// What instances do and how long it takes them.
///
/// Besides [`execute`](Self::execute), the methods report what happens in the
/// order in which it happens, those of the scheduler among them.
pub trait Workload {
    /// The kinds of events that it wants to hear of.
    const HEARS: &'static [What] = &[];

    /// The scheduler has written this down, of the kinds that are wanted.
    fn hear(&mut self, notice: &Notice) {
        let _ = notice;
    }

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

    /// Returns the next request that has come by now, and forgets it: a signal, unless a
    /// workload has others. What has finished may make one.
    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        self.take_signal(now_ns).map(Request::Signal)
    }

    /// Returns how late the timer's interrupt is that is due then; what comes before it at the
    /// scheduler does what is due. Asked several times for one interrupt.
    fn late_ns(&self, due_ns: u64) -> u64 {
        let _ = due_ns;
        0
    }

    /// Reports whether the run is to stop, though jobs are left. Asked before each
    /// instant.
    fn stops(&self) -> bool {
        false
    }

    /// Reports whether what is left of this instant is not to be written down.
    fn is_void(&self) -> bool {
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

impl<F: FnMut(Instance) -> u64> Workload for ExecutionTimes<F> {
    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        (self.0)(instance)
    }
}

/// A scheduler in virtual time, or those of all clusters.
#[derive(Debug)]
pub struct VirtualTime {
    clusters: Box<[Cluster]>,
    now_ns: u64,
    /// What fails at the present instant.
    failing: Vec<(Instance, CoreId)>,
    lifecycle: Option<Box<dyn Lifecycle>>,
    has_begun: bool,
    /// Whether a request waits for jobs to end.
    waits: bool,
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
        Self::with(Box::from([Cluster::new(scheduler, ClusterId(0), 0)]))
    }

    /// Makes one likewise for the clusters of a task set on the machine that the options
    /// describe; if its cores are not divided, for one scheduler of all.
    #[must_use]
    pub fn of_clusters(task_set: &Arc<TaskSet>, options: SchedulerOptions) -> Self {
        let clusters = task_set.clusters().map(|cluster| {
            let first = task_set.cores_of(cluster, options.cores).start;
            let scheduler = Scheduler::of_cluster(Arc::clone(task_set), options, cluster);
            Cluster::new(scheduler, cluster, first)
        });
        Self::with(clusters.collect())
    }

    fn with(clusters: Box<[Cluster]>) -> Self {
        let cores = clusters
            .iter()
            .map(|cluster| cluster.engine.scheduler.options().cores as usize);
        Self {
            failing: Vec::with_capacity(cores.sum()),
            now_ns: 0,
            clusters,
            lifecycle: None,
            has_begun: false,
            waits: false,
        }
    }

    /// Takes what serves requests other than signals.
    #[must_use]
    pub fn with_lifecycle(self, lifecycle: Option<Box<dyn Lifecycle>>) -> Self {
        Self { lifecycle, ..self }
    }

    /// Writes all that happens down.
    #[must_use]
    pub fn recording(mut self) -> Self {
        for cluster in &mut self.clusters {
            cluster.engine.scheduler.log.journal = Journal::growing();
        }
        self
    }

    /// Returns what was written down so far, of all clusters.
    #[must_use]
    pub fn events(&self) -> Vec<Event> {
        let mut clusters = self.clusters.iter();
        let mut all = clusters.next().map_or_else(Journal::growing, |first| {
            first.engine.scheduler.log.journal.clone()
        });
        for (id, cluster) in (1..).map(ClusterId).zip(clusters) {
            let first = cluster.first;
            all.absorb(cluster.engine.scheduler.log.journal.clone(), id, first);
        }
        all.events().collect()
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
    pub fn run_until<W: Workload>(&mut self, until_ns: u64, workload: &mut W) -> End {
        self.clusters.iter_mut().for_each(Cluster::hear::<W>);
        while !workload.stops() {
            let of_scheduler = |cluster: &Cluster| cluster.engine.scheduler.next_event_ns();
            let due = self.clusters.iter().filter_map(of_scheduler);
            // The time may have passed the due one already, by another event.
            let interrupts = due
                .map(|due_ns| (due_ns.saturating_add(workload.late_ns(due_ns))).max(self.now_ns));
            let scheduler_ns = interrupts.min();
            let signal_ns = workload.next_signal_ns();
            let signal_ns = signal_ns.map(|signal_ns| signal_ns.max(self.now_ns));
            let events = [self.next_finish_ns(), scheduler_ns, signal_ns];
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
        self.now_ns
    }

    /// Returns the scheduler of a DAG, for its statistics.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn scheduler_of(&self, dag: DagId) -> &Scheduler {
        &self.clusters[place(&self.clusters, dag)].engine.scheduler
    }

    /// Reports whether every DAG is over.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        let mut clusters = self.clusters.iter();
        clusters.all(|cluster| cluster.engine.scheduler.is_finished())
    }

    fn next_finish_ns(&self) -> Option<u64> {
        let of_cores = |cluster: &Cluster| cluster.next_finish_ns();
        self.clusters.iter().filter_map(of_cores).min()
    }

    /// Goes through one instant. An instance that cannot finish is the error.
    fn step(&mut self, now_ns: u64, workload: &mut impl Workload) -> Result<(), Instance> {
        self.now_ns = now_ns;
        workload.instant(now_ns);
        if let Some(done) = self.finish(now_ns, workload) {
            return done;
        }
        let clusters = &mut self.clusters;
        self.failing.sort_unstable();
        for (instance, core) in self.failing.drain(..) {
            let cluster = &mut clusters[place(clusters, instance.dag)];
            workload.failed(instance, cluster.number(core), now_ns);
            let is_replaceable = workload.is_replaceable(instance);
            cluster.tell(
                now_ns,
                Some(core),
                workload,
                |moment| match is_replaceable {
                    true => moment.fail_replaceable(instance),
                    false => moment.fail(instance),
                },
            );
        }
        if !core::mem::replace(&mut self.has_begun, true) {
            self.serve(Request::Begin, workload);
        }
        if core::mem::take(&mut self.waits) {
            self.serve(Request::GoOn, workload);
        }
        while let Some(request) = workload.take_request(now_ns) {
            self.serve(request, workload);
        }
        for place in 0..self.clusters.len() {
            if place > 0 && workload.is_void() {
                self.clusters[place].engine.scheduler.log.journal.close();
            }
            self.clusters[place].decide(now_ns, workload)?;
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
        for place in 0..self.clusters.len() {
            while let Some((instance, core)) = self.clusters[place].take_finished(now_ns) {
                finished += 1;
                let is_last = self.next_finish_ns().is_none_or(|ns| ns > now_ns);
                let cluster = &mut self.clusters[place];
                if workload.fails(instance) {
                    cluster.rest(instance, core);
                    self.failing.push((instance, core));
                    continue;
                }
                workload.finished(instance, cluster.number(core), now_ns);
                if finished > 1 || !is_last || self.waits || !is_quiet(workload) {
                    cluster.rest(instance, core);
                    cluster.tell(now_ns, Some(core), workload, |moment| {
                        moment.complete(instance)
                    });
                    continue;
                }
                return match cluster.complete(now_ns, core, instance, workload) {
                    Ok(true) => Some(Ok(())),
                    Ok(false) => None,
                    Err(instance) => Some(Err(instance)),
                };
            }
        }
        None
    }
}

/// Returns the place of the cluster that runs a DAG.
fn place(clusters: &[Cluster], dag: DagId) -> usize {
    match clusters {
        [_] => 0,
        several => several[0]
            .engine
            .scheduler
            .task_set()
            .dag(dag)
            .cluster()
            .index(),
    }
}
