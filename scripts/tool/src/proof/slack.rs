//! Where a bound is above what was observed.
//!
//! The same analysis is asked again with less and less: without the platform's overheads,
//! then with every subtask preemptible, then with the DAG alone. What each step takes off
//! the bound is the part of what it leaves out:
//!
//! ```text
//! bound = overheads + blocking + interference + own order + longest path
//! ```
//!
//! *Own order* is what the DAG's other subtasks may delay its longest path by, *overheads*
//! are those of all DAGs. What is left between the longest path at its WCETs and the
//! longest response time is what WCETs are above what calls took.

use sched_dag::analysis::{self, Overheads, Settings};
use sched_dag::{Clusters, Dag, DagId, DagSpec, Preemption, SchedulerOptions, SubtaskSpec};

use crate::record::model::{self, Committed};

/// The parts of a bound, in nanoseconds. Each is `None` if a bound that it is the
/// difference of is not proven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slack {
    /// What the platform's costs add.
    pub overheads_ns: Option<u64>,
    /// What less urgent instances that keep their cores add.
    pub blocking_ns: Option<u64>,
    /// What other DAGs' more urgent instances add.
    pub interference_ns: Option<u64>,
    /// What its own subtasks off the longest path add.
    pub own_order_ns: Option<u64>,
    /// The longest path, at its WCETs.
    pub length_ns: Option<u64>,
}

/// Takes the bound of a DAG of a commit apart.
#[must_use]
pub fn of(commit: &Committed, dag: DagId) -> Slack {
    let bound = |dags: &[DagSpec], settings: &Settings, dag: usize| -> Option<u64> {
        let options = SchedulerOptions {
            policy: settings.policy,
            preemption: settings.preemption,
            cores: settings.cores,
        };
        let task_set = model::task_set(options, Clusters::Undivided, dags).ok()?;
        let answer = analysis::answer(&task_set, settings);
        answer.bounds[dag].map(|bound| bound.bound_ns)
    };
    // What is in other clusters has no part in it.
    let task_set = &commit.task_set;
    let cluster = task_set.dag(dag).cluster();
    let is_here = |(_, model): &(usize, &Dag)| model.cluster() == cluster;
    let here = || task_set.dags().iter().enumerate().filter(is_here);
    let mut all: Vec<DagSpec> = here().map(|(_, model)| spec(model)).collect();
    let index = here().take_while(|(place, _)| *place < dag.index()).count();
    let full = commit.told.dags[dag.index()].bound_ns;
    let mut settings = commit.settings();
    let cores = task_set.cores_of(cluster, settings.cores).len();
    settings.cores = u32::try_from(cores).unwrap_or(u32::MAX);
    settings.overheads = Overheads::default();
    let free = bound(&all, &settings, index);
    settings.preemption = Preemption::Enabled;
    for subtask in all.iter_mut().flat_map(|dag| &mut dag.subtasks) {
        subtask.non_preemptive = false;
    }
    let preemptible = bound(&all, &settings, index);
    let own = all.swap_remove(index);
    let alone = bound(std::slice::from_ref(&own), &settings, 0);
    // With a core for each subtask nothing delays the longest path.
    settings.cores = u32::try_from(own.subtasks.len()).unwrap_or(u32::MAX).max(1);
    let length = bound(&[own], &settings, 0);
    let part = |whole: Option<u64>, rest: Option<u64>| Some(whole?.saturating_sub(rest?));
    Slack {
        overheads_ns: part(full, free),
        blocking_ns: part(free, preemptible),
        interference_ns: part(preemptible, alone),
        own_order_ns: part(alone, length),
        length_ns: length,
    }
}

/// Returns what a verified DAG could have been stated as.
fn spec(dag: &Dag) -> DagSpec {
    let ids = || (0..).map(sched_dag::SubtaskId).take(dag.subtasks().len());
    let subtasks = ids().zip(dag.subtasks()).map(|(id, subtask)| SubtaskSpec {
        name: subtask.name().into(),
        wcet_ns: subtask.wcet_ns(),
        priority: Some(subtask.priority()),
        non_preemptive: subtask.is_non_preemptive(),
        relative_deadline_ns: (dag.successors(id).is_empty())
            .then(|| subtask.relative_deadline_ns()),
        ..SubtaskSpec::default()
    });
    let edges = ids().flat_map(|from| {
        let after = dag.successors(from).iter();
        after.map(move |to| (from.index(), to.index()))
    });
    DagSpec {
        name: dag.name().into(),
        activation: match dag.is_sporadic() {
            true => sched_dag::Activation::Sporadic,
            false => sched_dag::Activation::Periodic,
        },
        period_ns: Some(dag.period_ns()),
        relative_deadline_ns: Some(dag.relative_deadline_ns()),
        offset_ns: dag.offset_ns(),
        in_flight: Some(dag.in_flight()),
        overrun: dag.overrun(),
        subtasks: subtasks.collect(),
        edges: edges.collect(),
        ..DagSpec::default()
    }
}
