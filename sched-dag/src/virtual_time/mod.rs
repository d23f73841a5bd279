//! The driver in virtual time: a [`Scheduler`] run without a machine, or one for each cluster.
//!
//! Time jumps from event to event. What the cores do comes from a
//! [`Workload`], which is asked once for each instance, at its start, how long
//! it executes; it may run the function of the instance's [body](Body) to find out.
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
mod workload;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

use crate::engine::Body;
use crate::ids::{ClusterId, CoreId, DagId, Instance, SubtaskId};
use crate::journal::Event;
use crate::kept::Journal;
use crate::lifecycle::{Lifecycle, Request};
use crate::policy::SchedulerOptions;
use crate::scheduler::Scheduler;
use crate::task_set::TaskSet;
use cluster::Cluster;
pub use workload::{ExecutionTimes, Stub, Workload};

/// A scheduler in virtual time with its bodies, or those of all clusters.
pub struct VirtualTime<B: Body = Stub> {
    clusters: Box<[Cluster<B>]>,
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
        let task_set = Arc::clone(scheduler.task_set());
        let cluster = Cluster::new(scheduler, (ClusterId(0), 0), Vec::new());
        Self::with(Box::from([cluster]), stubs(&task_set))
    }

    /// Makes one likewise for the clusters of a task set on the machine that the options
    /// describe; if its cores are not divided, for one scheduler of all.
    #[must_use]
    pub fn of_clusters(task_set: &Arc<TaskSet>, options: SchedulerOptions) -> Self {
        Self::of_bodies(task_set, options, stubs(task_set), &[])
    }
}

fn stubs(task_set: &TaskSet) -> impl Iterator<Item = Stub> {
    let dags = (0..).map(DagId).zip(task_set.dags());
    dags.flat_map(|(dag, model)| {
        let subtasks = (0..).map(SubtaskId).take(model.subtasks().len());
        subtasks.map(move |subtask| Stub {
            instance: Instance {
                dag,
                subtask,
                job: 0,
            },
        })
    })
}

impl<B: Body> VirtualTime<B> {
    /// Makes one for a body of each subtask. By DAG, `after_fault` is the one that gets a signal
    /// when a fault ends it.
    pub fn of_bodies(
        task_set: &Arc<TaskSet>,
        options: SchedulerOptions,
        bodies: impl IntoIterator<Item = B>,
        after_fault: &[Option<DagId>],
    ) -> Self {
        let clusters = task_set.clusters().map(|cluster| {
            let first = task_set.cores_of(cluster, options.cores).start;
            let scheduler = Scheduler::of_cluster(Arc::clone(task_set), options, cluster);
            Cluster::new(scheduler, (cluster, first), after_fault.to_vec())
        });
        Self::with(clusters.collect(), bodies)
    }

    fn with(mut clusters: Box<[Cluster<B>]>, bodies: impl IntoIterator<Item = B>) -> Self {
        for body in bodies {
            let instance = body.subject().instance();
            let engine = &mut clusters[place(&clusters, instance.dag)].engine;
            engine.put(engine.task_set.vertex(instance), body);
        }
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
    pub fn run(&mut self, workload: &mut impl Workload<B>) -> End {
        self.run_until(u64::MAX, workload)
    }

    /// Runs all events up to and including those at `until_ns`. May be called
    /// again with a later time.
    pub fn run_until(&mut self, until_ns: u64, workload: &mut impl Workload<B>) -> End {
        while !workload.stops() {
            let of_scheduler = |cluster: &Cluster<B>| cluster.engine.scheduler.next_event_ns();
            let due = self.clusters.iter().filter_map(of_scheduler);
            // The time may have passed the due one already, by another event.
            let interrupts = due
                .map(|due_ns| (due_ns.saturating_add(workload.late_ns(due_ns))).max(self.now_ns));
            let scheduler_ns = interrupts.min();
            let request_ns = workload.next_request_ns();
            let request_ns = request_ns.map(|request_ns| request_ns.max(self.now_ns));
            let events = [self.next_finish_ns(), scheduler_ns, request_ns];
            let Some(event_ns) = events.into_iter().flatten().min() else {
                return End::Finished;
            };
            if event_ns > until_ns {
                return End::TimeReached;
            }
            if let Err(end) = self.step(event_ns, workload) {
                return end;
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
        let of_cores = |cluster: &Cluster<B>| cluster.next_finish_ns();
        self.clusters.iter().filter_map(of_cores).min()
    }

    /// Goes through one instant. That the run cannot go on is the error.
    fn step(&mut self, now_ns: u64, workload: &mut impl Workload<B>) -> Result<(), End> {
        self.now_ns = now_ns;
        if self.finish(now_ns, workload)? {
            return Ok(());
        }
        self.failing.sort_unstable();
        for (instance, core) in self.failing.drain(..) {
            let place = place(&self.clusters, instance.dag);
            self.clusters[place].fail(now_ns, core, workload);
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
        let mut clusters = self.clusters.iter_mut();
        clusters.try_for_each(|cluster| cluster.decide(now_ns, workload))
    }

    /// Completes what finishes at `now_ns`, and notes what fails instead.
    /// If it is one instance and nothing else happens, that may be the whole
    /// instant, which is the result.
    fn finish(&mut self, now_ns: u64, workload: &mut impl Workload<B>) -> Result<bool, End> {
        let mut is_first = true;
        for place in 0..self.clusters.len() {
            while let Some((core, instance)) = self.clusters[place].take_finished(now_ns) {
                let mut others_ns = [self.next_finish_ns(), workload.next_request_ns()].into_iter();
                let is_last = others_ns.all(|ns| ns.is_none_or(|ns| ns > now_ns));
                let is_alone = core::mem::take(&mut is_first) && is_last && !self.waits;
                let cluster = &mut self.clusters[place];
                if workload.fails(instance) {
                    cluster.lose(core);
                    self.failing.push((instance, core));
                } else if cluster.complete(now_ns, core, is_alone, workload)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}

impl<B: Body> fmt::Debug for VirtualTime<B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("VirtualTime");
        shown.field("now_ns", &self.now_ns).finish_non_exhaustive()
    }
}

/// Returns the place of the cluster that runs a DAG.
fn place<B: Body>(clusters: &[Cluster<B>], dag: DagId) -> usize {
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
