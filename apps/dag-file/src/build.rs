//! From a set to DAGs that execute for its times.
//!
//! Instances occupy their cores for their execution times.

use alloc::vec::Vec;
use core::time::Duration;

use common::random::nth;
use fass::{Dag, Occupation, SubtaskAttributes, UntypedSubtask, create_dag};
use sched_dag::DagSpec;

use crate::execution::{Execution, Times};
use crate::file::{FileDag, Set};

/// How long a set runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// Each DAG releases this number of jobs.
    Jobs(u64),
    /// Each DAG releases the jobs of this time in nanoseconds, at least one.
    Span(u64),
}

/// How a set is run.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// How long instances execute.
    pub execution: Execution,
    /// The seed of what they draw.
    pub seed: u64,
    /// How execution occupies a core.
    pub occupation: Occupation,
    /// How many jobs there are.
    pub length: Length,
}

impl Length {
    /// Returns the number of jobs of a DAG.
    #[must_use]
    pub fn jobs(self, spec: &DagSpec) -> u64 {
        match self {
            Self::Jobs(jobs) => jobs,
            Self::Span(span_ns) => {
                let period_ns = spec.period_ns.unwrap_or(0).max(1);
                let after_offset_ns = span_ns.saturating_sub(spec.offset_ns);
                after_offset_ns.div_ceil(period_ns).max(1)
            }
        }
    }
}

/// Builds the DAGs of a set, to be committed with any shape of graph allowed.
#[must_use]
pub fn build(set: &Set, settings: &Settings) -> Vec<Dag> {
    let mut seeds = (0..).map(|n| nth(settings.seed, n));
    let dags = set.dags.iter();
    dags.map(|dag| build_dag(dag, settings, &mut seeds))
        .collect()
}

fn build_dag(
    described: &FileDag,
    settings: &Settings,
    seeds: &mut impl Iterator<Item = u64>,
) -> Dag {
    let spec = &described.spec;
    let time = |ns: Option<u64>| Duration::from_nanos(ns.unwrap_or(0));
    let dag = create_dag();
    dag.name(&spec.name)
        .period(time(spec.period_ns))
        .relative_deadline(time(spec.relative_deadline_ns))
        .offset(time(Some(spec.offset_ns)))
        .overrun(spec.overrun)
        .order(spec.order)
        .jobs(settings.length.jobs(spec));
    if let Some(jobs) = spec.in_flight {
        dag.in_flight(jobs);
    }
    if let Some(cluster) = spec.cluster {
        dag.cluster(cluster.0);
    }
    let subtasks = spec.subtasks.iter().zip(&described.subtasks).zip(seeds);
    let subtasks: Vec<UntypedSubtask> = subtasks
        .map(|((subtask, more), seed)| {
            let mut attributes =
                SubtaskAttributes::named(&subtask.name).wcet(time(subtask.wcet_ns));
            if let Some(priority) = subtask.priority {
                attributes = attributes.priority(priority.0);
            }
            if subtask.non_preemptive {
                attributes = attributes.non_preemptive();
            }
            let times = Times {
                execution: settings.execution,
                wcet_ns: subtask.wcet_ns.unwrap_or(0),
                samples_ns: more.samples_ns.clone(),
                seed,
            };
            let occupation = settings.occupation;
            let execute = move |job| {
                fass::execute_for(Duration::from_nanos(times.of_job(job)), occupation);
            };
            dag.register_untyped_subtask(execute, attributes)
        })
        .collect();
    for &(earlier, later) in &spec.edges {
        dag.precede(&subtasks[earlier], &subtasks[later]);
    }
    for (subtask, spec) in subtasks.iter().zip(&spec.subtasks) {
        if spec.relative_deadline_ns.is_some() {
            dag.sink_deadline(subtask, time(spec.relative_deadline_ns));
        }
    }
    dag
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse::parse;
    use fass::commit::{ConstructionPolicy, finish_create_dags_with};
    use virtual_time::VirtualTime;

    /// A fork and a join, and a pair without any edge.
    const TEXT: &str = "
        dag fork period 20ms deadline 10ms
        subtask a wcet 1ms
        subtask b wcet 4ms
        subtask c wcet 2ms
        subtask d wcet 1ms
        edge a -> b
        edge a -> c
        edge b -> d
        edge c -> d
        dag pair period 10ms offset 5ms
        subtask one wcet 1ms samples 10us,20us
        subtask other wcet 1ms
        end";

    #[test]
    fn a_set_runs_as_its_file_says() {
        let settings = Settings {
            execution: Execution::Wcet,
            seed: 1,
            occupation: Occupation::Hold,
            length: Length::Jobs(3),
        };
        let machine = VirtualTime::new().cores(2);
        let dags = build(&parse(TEXT).unwrap().sets[0], &settings);
        finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).unwrap();
        let report = machine.run();
        assert_eq!(report.violations(), []);
        let responses = report.jobs.iter().map(|job| job.response_time_ns());
        let responses: Vec<_> = responses.flatten().collect();
        assert_eq!(responses.len(), 6);
        assert!(responses.contains(&6_000_000), "{responses:?}");
    }

    #[test]
    fn a_span_gives_each_dag_its_jobs() {
        let file = parse(TEXT).unwrap();
        let of = |ns, dag: usize| Length::Span(ns).jobs(&file.sets[0].dags[dag].spec);
        assert_eq!((of(100_000_000, 0), of(100_000_000, 1)), (5, 10));
        assert_eq!((of(0, 0), of(15_000_001, 1)), (1, 2));
    }
}
