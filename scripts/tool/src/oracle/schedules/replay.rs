//! Replaying a case through the real scheduler, and comparing.

use sched_dag::law::Record;
use sched_dag::virtual_time::{End, ExecutionTimes, VirtualTime};
use sched_dag::{DagId, Instance, JobOutcome, SchedulerOptions};

use ::replay::{Case, InstanceTimes, JobTimes};

use crate::oracle::equal;

/// More cores than these are only simulated if there are as many subtasks: of
/// each subtask at most one instance runs at a time.
const ALWAYS_SIMULATED: usize = 1024;

/// Replays a case and compares everything that it expects.
///
/// # Errors
///
/// The first difference in the order of DAGs, jobs and subtasks, in one line.
pub fn check(case: &Case) -> Result<(), String> {
    let (instances, jobs) = replay(case)?;
    for (index, dag) in case.dags.iter().enumerate() {
        let of_dag = case.jobs[index].iter().zip(&jobs[index]);
        for (job, (expected_job, replayed_job)) in of_dag.enumerate() {
            for subtask in 0..dag.subtasks {
                let position = dag.position(job, subtask);
                let (expected, replayed) = (case.instances[position], instances[position]);
                let place = format!("dag {index} job {job} subtask {subtask}");
                let same = |what, expected, found| equal("replayed", &place, what, expected, found);
                same("start", expected.start_ns, replayed.start_ns)?;
                same("finish", expected.finish_ns, replayed.finish_ns)?;
                same("preemptions", expected.preemptions, replayed.preemptions)?;
            }
            let place = format!("dag {index} job {job}");
            let same = |what, expected, found| equal("replayed", &place, what, expected, found);
            same("release", expected_job.release_ns, replayed_job.release_ns)?;
            same("finish", expected_job.finish_ns, replayed_job.finish_ns)?;
            same(
                "response",
                expected_job.response_ns,
                replayed_job.response_ns,
            )?;
            let (expected, replayed) = (expected_job.missed, replayed_job.missed);
            same("missed", expected.into(), replayed.into())?;
        }
    }
    Ok(())
}

type Times = (Vec<InstanceTimes>, Vec<Vec<JobTimes>>);

/// Returns the times of all instances and of all jobs, in the order of the case's.
fn replay(case: &Case) -> Result<Times, String> {
    let subtasks: usize = case.dags.iter().map(|dag| dag.subtasks).sum();
    let useful = u32::try_from(subtasks.max(ALWAYS_SIMULATED)).unwrap_or(u32::MAX);
    let options = SchedulerOptions {
        policy: case.policy,
        preemption: case.preemption,
        cores: case.cores.min(useful),
    };
    let mut run = VirtualTime::new(&case.task_set, options).recording();
    let end = run.run(&mut ExecutionTimes(|instance: Instance| {
        let times = &case.dags[instance.dag.index()].executions_ns;
        times[instance.subtask.index()][usize::try_from(instance.job).expect("few jobs")]
    }));
    match end {
        End::Finished => {}
        End::TimeReached | End::Stopped => return Err("the replay stopped early".to_owned()),
        End::TimeOverflow(instance) => return Err(format!("{instance} never finishes")),
    }
    let events = run.events().into_iter();
    let record = Record::of_events(&case.task_set, true, events).ok_or("too many jobs")?;
    let dags = (0..).map(DagId).take(case.dags.len());
    let jobs = dags.map(|dag| record.jobs(dag).iter().map(job_times).collect());
    let jobs: Option<Vec<Vec<JobTimes>>> = jobs.collect();
    let instances = record.all_instances(&case.task_set);
    let instances = instances.map(|(_, times)| {
        Some(InstanceTimes {
            start_ns: times.start_ns?,
            finish_ns: times.finish_ns?,
            preemptions: times.preemptions.into(),
        })
    });
    let instances: Option<Vec<InstanceTimes>> = instances.collect();
    let all = instances.zip(jobs).filter(|(_, jobs)| {
        let ended = jobs.iter().map(Vec::len);
        run.is_finished() && ended.eq(case.dags.iter().map(|dag| dag.jobs))
    });
    all.ok_or_else(|| "some jobs have not ended".to_owned())
}

fn job_times(job: &sched_dag::law::JobRecord) -> Option<JobTimes> {
    let (release_ns, finish_ns) = (job.release_ns?, job.ended_ns?);
    Some(JobTimes {
        release_ns,
        finish_ns,
        response_ns: finish_ns - release_ns,
        missed: job.outcome? != JobOutcome::Met,
    })
}
