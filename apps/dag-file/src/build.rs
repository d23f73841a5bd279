//! Makes a set into DAGs that execute for the set's times.
//!
//! Instances occupy their cores for their execution times. Waiting instances sleep for as long as a
//! simulated device takes to answer.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

use fass::commit::{Commit, CommitError, ConstructionPolicy, finish_create_dags_in_order};
use fass::{Dag, Occupation, SubtaskAttributes, UntypedSubtask, create_dag};
use fass_dag_file::{Execution, FileDag, Length, Set};
use random::nth;

use crate::times::ExecutionTimes;

/// The settings of a set's run.
#[derive(Clone, Copy, Debug)]
pub struct RunSettings {
    /// The rule for execution times.
    pub execution: Execution,
    /// The seed of the drawn times.
    pub seed: u64,
    /// How execution occupies a core.
    pub occupation: Occupation,
    /// The number of jobs, as a length.
    pub length: Length,
    /// If not 0, a segment's execution counts from the latest multiple of this time on the clock.
    /// So the kernel's time before the segment is a part of the execution, as in a model without
    /// overheads.
    pub grid_ns: u64,
}

impl RunSettings {
    fn execute(&self, ns: u64) {
        let early_ns = self.grid_ns / 4;
        let late_ns = match self.grid_ns {
            0 => 0,
            grid_ns => (fass::now_ns() + early_ns) % grid_ns,
        };
        let ns = ns.saturating_add(early_ns).saturating_sub(late_ns);
        fass::execute_for(Duration::from_nanos(ns), self.occupation);
    }
}

/// Builds the DAGs of a set, to be committed with any shape of graph allowed.
pub fn build(set: &Set, settings: &RunSettings) -> Vec<Dag> {
    let mut seeds = (0..).map(|n| nth(settings.seed, n));
    let length = settings.length.of(set);
    let settings = RunSettings {
        length,
        ..*settings
    };
    let dags = set.dags.iter();
    dags.map(|dag| build_dag(dag, &settings, &mut seeds))
        .collect()
}

/// Builds and commits the DAGs of a set, with its lists of cores.
///
/// # Errors
///
/// The faults of the commit.
pub fn commit(set: &Set, settings: &RunSettings) -> Result<Commit, CommitError> {
    let dags = build(set, settings);
    finish_create_dags_in_order(&dags, ConstructionPolicy::any_graph(), &set.core_lists())
}

fn build_dag(
    described: &FileDag,
    settings: &RunSettings,
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
        .affinity(&spec.affinity)
        .jobs(settings.length.jobs(spec));
    if let Some(jobs) = spec.in_flight {
        dag.in_flight(jobs);
    }
    if let Some(cluster) = spec.cluster {
        dag.cluster(cluster.0);
    }
    let subtasks = spec.subtasks.iter().enumerate().zip(seeds);
    let subtasks: Vec<UntypedSubtask> = subtasks
        .map(|((number, subtask), seed)| {
            let later_ns: u64 = subtask.waits.iter().filter_map(|of| of.segment_ns).sum();
            let mut attributes = SubtaskAttributes::named(&subtask.name);
            if let Some(wcet_ns) = subtask.wcet_ns {
                attributes = attributes.wcet(time(Some(wcet_ns.saturating_sub(later_ns))));
            }
            for wait in &subtask.waits {
                attributes = attributes.wait(time(Some(wait.limit_ns)));
                if wait.segment_ns.is_some() {
                    attributes = attributes.wcet(time(wait.segment_ns));
                }
            }
            if let Some(priority) = subtask.priority {
                attributes = attributes.priority(priority.0);
            }
            if subtask.non_preemptive {
                attributes = attributes.non_preemptive();
            }
            let times = ExecutionTimes {
                execution: settings.execution,
                wcet_ns: described.most_ns(number),
                samples_ns: described.subtasks[number].samples_ns.clone(),
                seed,
                waits: subtask.waits.to_vec(),
            };
            register(&dag, times, *settings, attributes)
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

fn register(
    dag: &Dag,
    times: ExecutionTimes,
    settings: RunSettings,
    attributes: SubtaskAttributes,
) -> UntypedSubtask {
    if times.waits.is_empty() {
        let execute = move |job| settings.execute(times.of_job(job));
        return dag.register_untyped_subtask(execute, attributes);
    }
    let times = Arc::new(times);
    let execute_and_wait = move |job| {
        let times = Arc::clone(&times);
        async move {
            for number in 0.. {
                settings.execute(times.of_segment(job, number));
                match times.of_wait(job, number) {
                    Some(ns) => fass::sleep(Duration::from_nanos(ns)).await,
                    None => break,
                }
            }
        }
    };
    dag.register_untyped_async_subtask(execute_and_wait, attributes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fass_dag_file::parse;
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
        // On a grid, what has begun late ends in time.
        for grid_ns in [0, 1_000_000] {
            let settings = RunSettings {
                execution: Execution::Wcet,
                seed: 1,
                occupation: Occupation::Hold,
                length: Length::Jobs(3),
                grid_ns,
            };
            let late = Duration::from_nanos(grid_ns / 10);
            let machine = VirtualTime::new().cores(2).late(late, 1);
            commit(&parse(TEXT).unwrap().sets[0], &settings).unwrap();
            let report = machine.run();
            assert_eq!(report.violations(), []);
            let responses = report.jobs.iter().map(|job| job.response_time_ns());
            let responses: Vec<_> = responses.flatten().collect();
            assert_eq!(responses.len(), 6);
            assert!(responses.contains(&6_000_000), "{responses:?}");
            assert!(responses.iter().all(|ns| ns % 1_000_000 == 0));
        }
    }
}
