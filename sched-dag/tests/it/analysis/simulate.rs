//! Task sets as specs, and their response times as observed in virtual time.

use std::sync::Arc;

use sched_dag::law::RunRecord;
use sched_dag::virtual_time::{RunOutcome, VirtualTime};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, Instance, Policy, Preemption, Priority,
    SchedulerOptions, SubtaskSpec, TaskSet, verify,
};

use crate::support::{Script, Takes};

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
    let script = Script::new(execution_ns);
    observe(task_set, (policy, preemption, cores), until_ns, script).dags
}

/// Does as [`responses`], by a script, and watches subtasks, too.
pub(crate) fn observe(
    task_set: &TaskSet,
    (policy, preemption, cores): (Policy, Preemption, u32),
    until_ns: u64,
    mut script: Script<'_, impl Takes>,
) -> Observed {
    let options = SchedulerOptions {
        policy,
        preemption,
        cores,
    };
    let driver = VirtualTime::new(&Arc::new(task_set.clone()), options);
    let mut driver = driver.recording();
    let end = driver.run_until(until_ns, &mut script);
    assert!(!matches!(end, RunOutcome::TimeOverflow(_)), "{end:?}");
    let events = driver.events().into_iter();
    let record = RunRecord::of_events(task_set, true, events).expect("it fits");
    let (mut dags, mut subtasks) = (Vec::new(), Vec::new());
    for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
        let (mut largest, mut of_subtasks) = (0, vec![0; dag.subtasks().len()]);
        for (number, job) in record.numbered(id) {
            let Some(release_ns) = job.release_ns else {
                continue;
            };
            largest = largest.max(job.ended_ns.unwrap_or(until_ns) - release_ns);
            for (of_subtask, times) in of_subtasks.iter_mut().zip(record.instances(id, number)) {
                *of_subtask = times
                    .finish_ns
                    .unwrap_or(release_ns)
                    .max(*of_subtask + release_ns)
                    - release_ns;
            }
        }
        dags.push(largest);
        subtasks.push(of_subtasks);
    }
    Observed { dags, subtasks }
}
