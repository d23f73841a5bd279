//! Task sets as specs, and their response times as observed in virtual time.

use std::sync::Arc;

use sched_dag::law::RunRecord;
use sched_dag::virtual_time::{RunOutcome, VirtualTime};
use sched_dag::{DagId, DagSpec, Instance, Policy, Preemption, TaskSet};

use crate::support::{self, Script, Spec, Takes};

/// Returns the spec of a DAG whose subtasks all have one priority.
pub(crate) fn spec(
    period_ns: u64,
    deadline_ns: u64,
    wcets_ns: &[u64],
    edges: &[(usize, usize)],
    priority: u32,
) -> DagSpec {
    let alike = vec![priority; wcets_ns.len()];
    let spec = support::dag(period_ns, deadline_ns, 1, &alike, edges).wcets(wcets_ns);
    spec.with(|spec| (spec.jobs, spec.in_flight) = (None, None))
}

/// Verifies specs of any shape.
pub(crate) fn commit(specs: &[DagSpec], policy: Policy, cores: u32) -> TaskSet {
    let options = super::settings((policy, Preemption::Enabled), cores).scheduler();
    Arc::unwrap_or_clone(support::commit(specs, options))
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
    let options = super::settings((policy, preemption), cores).scheduler();
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
