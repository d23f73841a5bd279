//! A run of a task set on workers, from the first release to the last completion.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;

use sched_dag::Recorder;
use sched_dag::{CoreId, Dag, DagId, Policy, Preemption, Scheduler, SchedulerOptions, TaskSet};

use crate::execute::Execute;
use crate::pin::{Pinning, pin, processors};
use crate::recorder::judge;
use crate::relax::poll;
use crate::report::{Recorded, Report};
use crate::reports::Reports;
use crate::watch::Watch;
use crate::{alone, team};

/// A function as a subtask's body; its argument is the job's number.
pub type Closure = Box<dyn FnMut(u64) + Send>;

/// How to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// How the ready instances are ordered.
    pub policy: Policy,
    /// The number of workers, at least 1.
    pub workers: u32,
}

thread_local! {
    static WORKER: Cell<Option<u32>> = const { Cell::new(None) };
}

/// Returns the calling worker's number, from 0; `None` outside of subtasks.
#[must_use]
pub fn worker() -> Option<u32> {
    WORKER.get()
}

/// Runs a task set without `fass`: functions alone, by DAG and subtask.
///
/// # Panics
///
/// If a function panics; if there are no workers; if a periodic DAG has no limit of
/// jobs; if the number of functions is not that of the subtasks.
///
/// # Examples
///
/// ```
/// use native::{Closure, Setting};
/// use sched_dag::{CommitOptions, DagSpec, Policy, SubtaskSpec, verify};
///
/// let spec = DagSpec {
///     name: "pair".into(),
///     period_ns: Some(1_000),
///     relative_deadline_ns: Some(1_000),
///     jobs: Some(10),
///     subtasks: vec![SubtaskSpec::default(); 2],
///     edges: vec![(0, 1)],
///     ..DagSpec::default()
/// };
/// let verified = verify(&[spec], &CommitOptions::new(Policy::StaticPriority, 1)).unwrap();
/// let bodies: Vec<Vec<Closure>> = vec![vec![Box::new(|_| ()), Box::new(|_| ())]];
/// let setting = Setting { policy: Policy::StaticPriority, workers: 1 };
/// let report = native::run(verified.task_set, bodies, setting);
/// assert_eq!(report.statistics[0].completed, 10);
/// ```
pub fn run(task_set: TaskSet, bodies: Vec<Vec<Closure>>, setting: Setting) -> Report {
    run_bodies(Arc::new(task_set), bodies, setting)
}

/// Runs as [`run`] does, writes everything down, and checks it.
///
/// The scheduler's clock moves on by 1 ns at each completion, so that no two are at
/// the same instant. A period with fewer nanoseconds than its jobs have subtasks is
/// thus an overload: jobs are late, and wait, are skipped or aborted.
///
/// # Panics
///
/// As [`run`]; if the record does not fit into memory; if a sporadic DAG has no limit
/// of jobs.
pub fn run_recorded(task_set: TaskSet, bodies: Vec<Vec<Closure>>, setting: Setting) -> Recorded {
    run_bodies_recorded(Arc::new(task_set), bodies, setting)
}

pub(crate) fn run_bodies<B: Execute>(
    task_set: Arc<TaskSet>,
    bodies: Vec<Vec<B>>,
    setting: Setting,
) -> Report {
    run_watched(&task_set, bodies, setting, ()).0
}

pub(crate) fn run_bodies_recorded<B: Execute>(
    task_set: Arc<TaskSet>,
    bodies: Vec<Vec<B>>,
    setting: Setting,
) -> Recorded {
    let mut dags = task_set.dags().iter();
    if let Some(endless) = dags.find(|dag| dag.jobs().is_none()) {
        // What is left out of the record would keep its core from others, unseen.
        panic!(
            "dag `{}` has no limit of jobs and cannot be recorded; give it one, or use `run`",
            endless.name()
        );
    }
    let recorder = Recorder::new(Arc::clone(&task_set));
    let (report, recorder) = run_watched(&task_set, bodies, setting, recorder);
    judge(&recorder, report, &task_set, options(setting))
}

const fn options(setting: Setting) -> SchedulerOptions {
    SchedulerOptions {
        policy: setting.policy,
        preemption: Preemption::Disabled,
        cores: setting.workers,
    }
}

fn run_watched<B: Execute, W: Watch>(
    task_set: &Arc<TaskSet>,
    bodies: Vec<Vec<B>>,
    setting: Setting,
    mut watch: W,
) -> (Report, W) {
    let dags = task_set.dags();
    assert!(
        dags.iter()
            .all(|dag| dag.jobs().is_some() || dag.is_sporadic()),
        "a DAG without a limit of jobs would run forever; give each one a limit"
    );
    let subtasks = dags.iter().map(|dag| dag.subtasks().len());
    assert!(
        subtasks.eq(bodies.iter().map(Vec::len)),
        "each subtask needs one function; give as many as there are subtasks"
    );
    let mut bodies: Vec<B> = bodies.into_iter().flatten().collect();
    let mut scheduler = Scheduler::new(Arc::clone(task_set), options(setting));
    let start = Start::new(setting.workers);
    if setting.workers == 1 {
        let mut reports = Reports::new(task_set, watch, &mut bodies[..]);
        thread::scope(|scope| {
            let worker = scope.spawn(|| {
                start.ready(0);
                alone::run(&mut scheduler, &mut reports);
            });
            join(worker);
        });
        watch = reports.watch;
    } else {
        let team = team::Team::new(scheduler, bodies, watch);
        thread::scope(|scope| {
            let workers: Vec<_> = (0..setting.workers)
                .map(|worker| {
                    let (team, start) = (&team, &start);
                    scope.spawn(move || {
                        start.ready(worker);
                        team.work(CoreId(worker));
                    })
                })
                .collect();
            workers.into_iter().for_each(join);
        });
        (scheduler, watch) = team.into_parts();
    }
    let ids = (0..).map(DagId).zip(dags);
    let sink_misses = |(dag, model): (DagId, &Dag)| {
        let sinks = model.sinks().iter();
        sinks
            .map(|&sink| scheduler.sink_misses(dag, sink))
            .collect()
    };
    let report = Report {
        sink_misses: ids.clone().map(sink_misses).collect(),
        statistics: ids.map(|(dag, _)| *scheduler.statistics(dag)).collect(),
        pinning: start.pinning(),
    };
    (report, watch)
}

/// Waits for a worker's end, and passes its panic on.
fn join(worker: thread::ScopedJoinHandle<'_, ()>) {
    if let Err(panic) = worker.join() {
        std::panic::resume_unwind(panic);
    }
}

/// The common start of all workers: nobody begins before all are pinned.
struct Start {
    processors: Vec<u32>,
    to_come: AtomicU32,
    all_pinned: AtomicBool,
}

impl Start {
    fn new(workers: u32) -> Self {
        let processors = processors();
        let enough = processors.len() >= workers as usize;
        Self {
            processors,
            to_come: AtomicU32::new(workers),
            all_pinned: AtomicBool::new(enough),
        }
    }

    /// Pins the calling worker, and returns when all have done so.
    fn ready(&self, worker: u32) {
        WORKER.set(Some(worker));
        let is_pinned = self.all_pinned.load(Ordering::Relaxed)
            && self
                .processors
                .get(worker as usize)
                .is_some_and(|&processor| pin(processor));
        if !is_pinned {
            self.all_pinned.store(false, Ordering::Relaxed);
        }
        self.to_come.fetch_sub(1, Ordering::AcqRel);
        poll(|| (self.to_come.load(Ordering::Acquire) == 0).then_some(()));
    }

    fn pinning(&self) -> Pinning {
        if self.all_pinned.load(Ordering::Relaxed) {
            Pinning::Pinned
        } else {
            Pinning::Free
        }
    }
}
