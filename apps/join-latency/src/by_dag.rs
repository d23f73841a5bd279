//! The DAG-native condition: `fork-join`'s DAG, joined by the scheduler.

use fork_join::Workload;
use join_latency::{Joined, Samples, Span};
use kernel::{Ending, Machine, Run};
use sched_dag::law::InstanceRecord;
use sched_dag::{Instance, SubtaskId};

use super::output::Outcome;

/// Runs all jobs.
pub(crate) fn run(machine: &Machine, workload: &Workload) -> Result<Outcome, Ending> {
    let (dag, joins) = workload.build();
    // As many jobs in flight as the subscriptions' queues have room for by default,
    // so that no release waits for the backlog on either side.
    dag.in_flight(
        u32::try_from(workload.jobs)
            .unwrap_or(u32::MAX)
            .clamp(1, 1000),
    );
    fass::finish_create_dags(&[dag])?;
    let run = machine.run()?;
    Ok(Outcome {
        samples: samples(&run, workload.parallel),
        allocations: run.allocations(),
        violations: run.violations().count() as u64 + joins.mixed(),
    })
}

/// Reads the times from the scheduler's record. Each join has the values of its own
/// job, which `fork-join` checks and counts otherwise.
fn samples(run: &Run, parallel: usize) -> Samples {
    let dag = run.task_set().find("fork-join");
    let jobs = run.record().numbered(dag).map(|(job, _)| job);
    let instances = |subtask: usize| {
        jobs.clone().filter_map(move |job| {
            let subtask = SubtaskId(u32::try_from(subtask).ok()?);
            let instance = Instance { dag, job, subtask };
            Some((job, *run.record().instance(instance)?))
        })
    };
    let spans = |subtask| {
        instances(subtask)
            .filter_map(|(_, times)| span(&times))
            .collect()
    };
    let joins = instances(parallel + 1).filter_map(|(job, times)| {
        let joined = Joined {
            ready_ns: times.ready_ns?,
            span: span(&times)?,
        };
        Some((job, joined))
    });
    Samples {
        source: spans(0),
        parallel: (1..=parallel).map(spans).collect(),
        joins: joins.clone().map(|(_, joined)| joined).collect(),
        indices: joins
            .flat_map(|(job, _)| core::iter::repeat_n(job, parallel))
            .collect(),
        lost_inputs: 0,
    }
}

fn span(times: &InstanceRecord) -> Option<Span> {
    Some(Span {
        start_ns: times.start_ns?,
        finish_ns: times.finish_ns?,
    })
}
