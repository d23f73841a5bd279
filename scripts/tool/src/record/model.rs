//! The model of a record's commit: DAGs as the scheduler has them.

use recording::{Commit, CommittedDag};
use sched_dag::analysis::{self, Overheads, Settings};
use sched_dag::chains::Sampling;
use sched_dag::{
    Activation, ClusterId, Clusters, CommitOptions, ConstructionPolicy, DagId, DagSpec, FaultLimit,
    OnFault, OverrunPolicy, Policy, Preemption, Priority, SchedulerOptions, SubtaskId, SubtaskSpec,
    TaskSet, verify,
};

use crate::qemu::MOST_CORES;

/// DAGs that were committed together, and what was proven of them.
#[derive(Clone, Debug, Default)]
pub struct Committed {
    /// Its number within the boot, from 0.
    pub number: usize,
    /// The commit as the record has it.
    pub told: Commit,
    /// The same as a model.
    pub task_set: TaskSet,
}

impl Committed {
    /// Makes the model, as a commit does.
    ///
    /// # Errors
    ///
    /// The reasons for which a commit would refuse them.
    pub fn new(number: usize, told: Commit) -> Result<Self, String> {
        let in_commit = |why: String| format!("commit {number}: {why}");
        if !(1..=MOST_CORES).contains(&u64::from(told.cores)) {
            return Err(in_commit(format!(
                "it is for {} cores; 1 to {MOST_CORES} are possible",
                told.cores
            )));
        }
        let specs: Result<Vec<DagSpec>, String> = told.dags.iter().map(spec).collect();
        let clusters = match &told.clusters[..] {
            [] => Clusters::Undivided,
            sizes => Clusters::Of(sizes.to_vec()),
        };
        let mut committed = Self {
            number,
            task_set: TaskSet::default(),
            told,
        };
        let options = committed.options();
        let task_set = specs.and_then(|specs| task_set(options, clusters, &specs));
        committed.task_set = task_set.map_err(in_commit)?;
        Ok(committed)
    }

    /// Returns how it is scheduled.
    #[must_use]
    pub const fn options(&self) -> SchedulerOptions {
        SchedulerOptions {
            policy: match self.told.is_edf {
                true => Policy::Edf,
                false => Policy::StaticPriority,
            },
            preemption: match self.told.is_preemptive {
                true => Preemption::Enabled,
                false => Preemption::Disabled,
            },
            cores: self.told.cores,
        }
    }

    /// Returns what the analysis takes for granted besides the DAGs.
    #[must_use]
    pub fn settings(&self) -> Settings {
        let options = self.options();
        Settings {
            policy: options.policy,
            preemption: options.preemption,
            cores: options.cores,
            // Two numbers are all that the analysis makes of them.
            overheads: Overheads {
                dispatch_ns: self.told.charge_ns.unwrap_or(u64::MAX),
                ready_ns: self.told.ready_ns,
                ..Overheads::default()
            },
        }
    }

    /// Makes sure that the bounds are those that the analysis gives here.
    ///
    /// # Errors
    ///
    /// In words: one is another.
    pub fn check_bounds(&self) -> Result<(), String> {
        let answer = analysis::answer(&self.task_set, &self.settings());
        let here = answer
            .bounds
            .iter()
            .map(|bound| bound.map(|bound| bound.bound_ns));
        for (dag, host) in self.told.dags.iter().zip(here) {
            let guest = dag.bound_ns;
            if guest != host {
                return Err(format!(
                    "the bound of dag `{}` in commit {} is {guest:?} ns by the guest and {host:?} \
                     ns by the same analysis here; report this",
                    dag.name, self.number
                ));
            }
        }
        Ok(())
    }

    /// Returns what samples what, of the model's subtasks.
    #[must_use]
    pub fn samplings(&self) -> Vec<Sampling> {
        let dags = (0..).map(DagId).zip(&self.told.dags);
        let sampling = |(dag, &(reader, writer, topic, _))| {
            let of_writer = self.told.dags.get(usize::try_from(writer).ok()?)?;
            let topic = of_writer.topics.get(usize::try_from(topic).ok()?)?;
            Some(Sampling {
                writer: self.place(DagId(writer), topic.writer)?,
                reader: self.place(dag, reader)?,
            })
        };
        dags.flat_map(|(id, dag)| dag.samples.iter().map(move |sample| (id, sample)))
            .filter_map(sampling)
            .collect()
    }

    fn place(&self, dag: DagId, subtask: u32) -> Option<(DagId, SubtaskId)> {
        let model = self.task_set.dags().get(dag.index())?;
        let subtask = SubtaskId(subtask);
        (subtask.index() < model.subtasks().len()).then_some((dag, subtask))
    }
}

/// Makes a model of DAGs, as a commit does.
///
/// # Errors
///
/// The reasons for which a commit would refuse them.
pub fn task_set(
    options: SchedulerOptions,
    clusters: Clusters,
    dags: &[DagSpec],
) -> Result<TaskSet, String> {
    if dags.is_empty() {
        return Ok(TaskSet::default());
    }
    let options = CommitOptions::new(options.policy, options.cores)
        .with_construction(ConstructionPolicy::any_graph())
        .with_clusters(clusters)
        .with_instance_limit(u32::MAX);
    let verified = verify(dags, &options).map_err(|rejected| {
        let faults: Vec<String> = rejected.faults().iter().map(ToString::to_string).collect();
        faults.join("; ")
    })?;
    Ok(verified.task_set)
}

fn spec(dag: &CommittedDag) -> Result<DagSpec, String> {
    let name = &dag.name;
    let mut subtasks: Vec<SubtaskSpec> = (dag.subtasks.iter())
        .map(|subtask| SubtaskSpec {
            name: subtask.name.clone(),
            wcet_ns: subtask.wcet_ns,
            priority: Some(Priority(subtask.priority)),
            non_preemptive: subtask.is_non_preemptive,
            ..SubtaskSpec::default()
        })
        .collect();
    let index = |subtask: u32| usize::try_from(subtask).unwrap_or(usize::MAX);
    let edges = dag.edges.iter().map(|&(from, to)| (index(from), index(to)));
    // With one sink the deadline is the DAG's.
    for &(sink, deadline_ns) in dag.sinks.iter().filter(|_| dag.sinks.len() > 1) {
        let is_followed = dag.edges.iter().any(|(from, _)| *from == sink);
        let subtask = subtasks.get_mut(index(sink)).filter(|_| !is_followed);
        let subtask = subtask.ok_or_else(|| format!("dag `{name}` has no sink {sink}"))?;
        subtask.relative_deadline_ns = Some(deadline_ns);
    }
    Ok(DagSpec {
        cluster: dag.cluster.map(ClusterId),
        name: name.clone(),
        activation: match dag.is_sporadic {
            true => Activation::Sporadic,
            false => Activation::Periodic,
        },
        period_ns: Some(dag.period_ns),
        relative_deadline_ns: Some(dag.relative_deadline_ns),
        offset_ns: dag.offset_ns,
        in_flight: Some(dag.in_flight),
        overrun: match dag.overrun {
            0 => OverrunPolicy::Queue,
            1 => OverrunPolicy::Skip,
            2 => OverrunPolicy::Abort,
            other => {
                return Err(format!(
                    "dag `{name}` has overrun policy {other}; 0 to 2 are known"
                ));
            }
        },
        on_fault: match dag.survives {
            None => OnFault::EndDag,
            Some((faults, window, in_all)) => OnFault::DropJob(FaultLimit {
                faults,
                window,
                in_all,
            }),
        },
        subtasks,
        edges: edges.collect(),
        ..DagSpec::default()
    })
}
