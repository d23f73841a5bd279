//! A run of a task set on workers, from the first release to the last completion.

use std::sync::Arc;
use std::thread;

use sched_dag::{ClusterId, Dag, DagId, Policy, Preemption, Scheduler, SchedulerOptions, TaskSet};

use crate::cluster::{self, Place, join};
use crate::execute::Execute;
use crate::others::Office;
use crate::recorder::judge;
use crate::report::{Recorded, Report};
use crate::start::Start;
use crate::watch::Watch;

/// A function as a subtask's body; its argument is the job's number.
pub type Closure = Box<dyn FnMut(u64) + Send>;

/// How to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// How the ready instances are ordered.
    pub policy: Policy,
    /// The number of workers, at least 1: of those of all clusters, where a task set divides
    /// them.
    pub workers: u32,
}

/// Runs a task set without `fass`: functions alone, by DAG and subtask.
///
/// # Panics
///
/// If a function panics; if there are no workers, or fewer than the clusters of the task set
/// have; if a periodic DAG has no limit of jobs; if the number of functions is not that of the
/// subtasks.
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
    run_watched::<B, ()>(&task_set, bodies, setting).0
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
    let (report, schedulers) = run_watched::<B, crate::watch::Recorded>(&task_set, bodies, setting);
    judge(&schedulers, report, &task_set, options(setting))
}

const fn options(setting: Setting) -> SchedulerOptions {
    SchedulerOptions {
        policy: setting.policy,
        preemption: Preemption::Disabled,
        cores: setting.workers,
    }
}

/// Runs all, and returns what has watched each cluster, too.
fn run_watched<B: Execute, W: Watch>(
    task_set: &Arc<TaskSet>,
    bodies: Vec<Vec<B>>,
    setting: Setting,
) -> (Report, Vec<Scheduler>) {
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
    let clusters = task_set.clusters();
    let busy = clusters.map(|cluster| task_set.cores_of(cluster, setting.workers).end);
    let busy = busy.max().unwrap_or_default();
    assert!(
        (1..=setting.workers).contains(&busy),
        "{} workers for clusters of {busy} cores; give at least 1, and one to each core",
        setting.workers
    );
    let start = Start::new(busy);
    let place = |cluster| Place {
        task_set,
        options: options(setting),
        cluster,
        start: &start,
    };
    let ran = if task_set.is_divided() {
        run_divided::<B, W>(place, bodies)
    } else {
        let place = place(ClusterId(0));
        let bodies = bodies.into_iter().flatten().collect();
        let run = || cluster::run::<B, W, ()>(place, bodies, ());
        vec![thread::scope(|scope| join(scope.spawn(run)))]
    };
    let schedulers = ran;
    let scheduler_of = |dag| &schedulers[task_set.dag(dag).cluster().index()];
    let ids = (0..).map(DagId).zip(dags);
    let sink_misses = |(dag, model): (DagId, &Dag)| {
        let sinks = model.sinks().iter();
        sinks
            .map(|&sink| scheduler_of(dag).sink_misses(dag, sink))
            .collect()
    };
    let statistics = |(dag, _)| *scheduler_of(dag).statistics(dag);
    let report = Report {
        sink_misses: ids.clone().map(sink_misses).collect(),
        statistics: ids.map(statistics).collect(),
        pinning: start.pinning(),
    };
    (report, schedulers)
}

/// Runs all clusters, and returns what each leaves.
fn run_divided<'a, B: Execute, W: Watch>(
    place: impl Fn(ClusterId) -> Place<'a>,
    mut bodies: Vec<Vec<B>>,
) -> Vec<Scheduler> {
    let task_set = place(ClusterId(0)).task_set;
    let office = Office::new(task_set);
    thread::scope(|scope| {
        let mut clusters = Vec::new();
        for cluster in task_set.clusters() {
            let mut own = Vec::with_capacity(task_set.vertices());
            // Vertices are numbered over all DAGs; a cluster has the bodies of its own.
            for (dag, bodies) in task_set.dags().iter().zip(&mut bodies) {
                let end = own.len() + dag.subtasks().len();
                if dag.cluster() == cluster {
                    own.extend(bodies.drain(..).map(Some));
                }
                own.resize_with(end, || None);
            }
            let place = place(cluster);
            let others = office.seen_from(cluster);
            clusters.push(scope.spawn(move || cluster::run::<_, W, _>(place, own, others)));
        }
        clusters.into_iter().map(join).collect()
    })
}
