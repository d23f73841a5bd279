//! Task sets as specs, and their response times as observed in virtual time.

use std::sync::Arc;

use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, Instance, JobOutcome, Observer, Policy,
    Preemption, Priority, SchedulerOptions, SubtaskSpec, TaskSet, verify,
};

/// Returns the spec of a DAG whose subtasks all have one priority.
pub(crate) fn spec(
    period_ns: u64,
    deadline_ns: u64,
    wcets_ns: &[u64],
    edges: &[(usize, usize)],
    priority: u32,
) -> DagSpec {
    let subtask = |&wcet_ns: &u64| SubtaskSpec {
        wcet_ns: Some(wcet_ns),
        priority: Some(Priority(priority)),
        ..SubtaskSpec::default()
    };
    DagSpec {
        period_ns: Some(period_ns),
        relative_deadline_ns: Some(deadline_ns),
        subtasks: wcets_ns.iter().map(subtask).collect(),
        edges: edges.to_vec(),
        ..DagSpec::default()
    }
}

/// Verifies specs of any shape.
pub(crate) fn commit(specs: &[DagSpec], policy: Policy, cores: u32) -> TaskSet {
    let options =
        CommitOptions::new(policy, cores).with_construction(ConstructionPolicy::any_graph());
    match verify(specs, &options) {
        Ok(verified) => verified.task_set,
        Err(rejected) => panic!("{rejected}"),
    }
}

/// The largest response times that were seen.
pub(crate) struct Observed {
    /// Of each DAG's jobs.
    pub(crate) dags: Vec<u64>,
    /// Of each DAG's subtasks: from the nominal release to their finish.
    pub(crate) subtasks: Vec<Vec<u64>>,
}

/// Runs until `until_ns` with the given execution times, and returns each
/// DAG's largest observed response time, of jobs unfinished at the end so far.
pub(crate) fn responses(
    task_set: &TaskSet,
    (policy, preemption, cores): (Policy, Preemption, u32),
    until_ns: u64,
    execution_ns: impl FnMut(Instance) -> u64,
) -> Vec<u64> {
    observe(
        task_set,
        (policy, preemption, cores),
        until_ns,
        execution_ns,
    )
    .dags
}

/// Does as [`responses`], and watches subtasks, too.
pub(crate) fn observe(
    task_set: &TaskSet,
    (policy, preemption, cores): (Policy, Preemption, u32),
    until_ns: u64,
    execution_ns: impl FnMut(Instance) -> u64,
) -> Observed {
    let options = SchedulerOptions {
        policy,
        preemption,
        cores,
    };
    let mut driver = VirtualTime::of_clusters(&Arc::new(task_set.clone()), options);
    let mut watch = Watch {
        execution_ns,
        now_ns: 0,
        releases: vec![Vec::new(); task_set.dags().len()],
        largest: vec![0; task_set.dags().len()],
        of_subtasks: (task_set.dags().iter())
            .map(|dag| vec![0; dag.subtasks().len()])
            .collect(),
    };
    let end = driver.run_until(until_ns, &mut watch);
    assert!(!matches!(end, End::TimeOverflow(_)), "{end:?}");
    for (largest, releases) in watch.largest.iter_mut().zip(&watch.releases) {
        for &(_, release_ns) in releases {
            *largest = (*largest).max(until_ns - release_ns);
        }
    }
    Observed {
        dags: watch.largest,
        subtasks: watch.of_subtasks,
    }
}

struct Watch<F> {
    execution_ns: F,
    now_ns: u64,
    /// The jobs in flight of each DAG: number and nominal release.
    releases: Vec<Vec<(u64, u64)>>,
    largest: Vec<u64>,
    of_subtasks: Vec<Vec<u64>>,
}

impl<F> Observer for Watch<F> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.releases[dag.index()].push((job, release_ns));
    }

    fn job_completed(&mut self, dag: DagId, job: u64, _outcome: JobOutcome) {
        let flying = &mut self.releases[dag.index()];
        let place = flying.iter().position(|&(other, _)| other == job);
        let (_, release_ns) = flying.swap_remove(place.expect("released before it ends"));
        let largest = &mut self.largest[dag.index()];
        *largest = (*largest).max(self.now_ns - release_ns);
    }
}

impl<F: FnMut(Instance) -> u64> Workload for Watch<F> {
    const WANTED: &'static [sched_dag::journal::What] = sched_dag::told::ALL;

    fn heard(&mut self, news: &sched_dag::News) {
        sched_dag::told::tell(news, self);
    }

    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        (self.execution_ns)(instance)
    }

    fn finished(&mut self, instance: Instance, _: sched_dag::CoreId, now_ns: u64) {
        let mut flying = self.releases[instance.dag.index()].iter();
        let (_, release_ns) = flying
            .find(|(job, _)| *job == instance.job)
            .expect("released");
        let largest = &mut self.of_subtasks[instance.dag.index()][instance.subtask.index()];
        *largest = (*largest).max(now_ns - release_ns);
        // A job completes right after its last instance, at the same instant.
        self.now_ns = now_ns;
    }
}
