//! Replaying a case through the real scheduler, and comparing.

use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{CoreId, DagId, Instance, JobOutcome, Observer, SchedulerOptions};

use ::replay::{Case, CaseDag, InstanceTimes, JobTimes};

/// More cores than these are only simulated if there are as many subtasks: of
/// each subtask at most one instance runs at a time.
const ALWAYS_SIMULATED: usize = 1024;

/// Replays a case and compares everything that it expects.
///
/// # Errors
///
/// The first difference in the order of DAGs, jobs and subtasks, in one line.
pub fn check(case: &Case) -> Result<(), String> {
    let record = replay(case)?;
    for (index, dag) in case.dags.iter().enumerate() {
        for job in 0..dag.jobs {
            for subtask in 0..dag.subtasks {
                let position = dag.position(job, subtask);
                let (expected, replayed) = (case.instances[position], record.instances[position]);
                let place = format!("dag {index} job {job} subtask {subtask}");
                compare(&place, "start", expected.start_ns, replayed.start_ns)?;
                compare(&place, "finish", expected.finish_ns, replayed.finish_ns)?;
                compare(
                    &place,
                    "preemptions",
                    expected.preemptions,
                    replayed.preemptions,
                )?;
            }
            let (expected, replayed) = (case.jobs[index][job], record.jobs[index][job]);
            let place = format!("dag {index} job {job}");
            compare(&place, "release", expected.release_ns, replayed.release_ns)?;
            compare(&place, "finish", expected.finish_ns, replayed.finish_ns)?;
            compare(
                &place,
                "response",
                expected.response_ns,
                replayed.response_ns,
            )?;
            compare(
                &place,
                "missed",
                expected.missed.into(),
                replayed.missed.into(),
            )?;
        }
    }
    Ok(())
}

fn compare(place: &str, what: &str, expected: u64, replayed: u64) -> Result<(), String> {
    if expected == replayed {
        Ok(())
    } else {
        Err(format!(
            "{place}: {what}: expected {expected}, replayed {replayed}"
        ))
    }
}

fn replay(case: &Case) -> Result<Record<'_>, String> {
    let subtasks: usize = case.dags.iter().map(|dag| dag.subtasks).sum();
    let useful = u32::try_from(subtasks.max(ALWAYS_SIMULATED)).unwrap_or(u32::MAX);
    let options = SchedulerOptions {
        policy: case.policy,
        preemption: case.preemption,
        cores: case.cores.min(useful),
    };
    let mut record = Record {
        dags: &case.dags,
        now_ns: 0,
        instances: vec![InstanceTimes::default(); case.instances.len()],
        jobs: case
            .dags
            .iter()
            .map(|dag| vec![JobTimes::default(); dag.jobs])
            .collect(),
        ended: 0,
    };
    let mut run = VirtualTime::of_clusters(&case.task_set, options);
    match run.run(&mut record) {
        End::Finished => {}
        End::TimeReached | End::Stopped => return Err("the replay stopped early".to_owned()),
        End::TimeOverflow(instance) => return Err(format!("{instance} never finishes")),
    }
    let jobs: usize = case.dags.iter().map(|dag| dag.jobs).sum();
    if record.ended == jobs && run.is_finished() {
        Ok(record)
    } else {
        Err(format!("{} of {jobs} jobs ended", record.ended))
    }
}

/// What a replay has done so far.
struct Record<'a> {
    dags: &'a [CaseDag],
    now_ns: u64,
    instances: Vec<InstanceTimes>,
    jobs: Vec<Vec<JobTimes>>,
    ended: usize,
}

impl Record<'_> {
    fn times(&mut self, instance: Instance) -> &mut InstanceTimes {
        let dag = &self.dags[instance.dag.index()];
        &mut self.instances[dag.position(index(instance.job), instance.subtask.index())]
    }
}

impl Observer for Record<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.jobs[dag.index()][index(job)].release_ns = release_ns;
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        let times = &mut self.jobs[dag.index()][index(job)];
        times.finish_ns = self.now_ns;
        times.response_ns = self.now_ns - times.release_ns;
        times.missed = outcome != JobOutcome::Met;
        self.ended += 1;
    }
}

impl Workload for Record<'_> {
    const WANTED: &'static [sched_dag::journal::What] = sched_dag::told::ALL;

    fn heard(&mut self, news: &sched_dag::News) {
        sched_dag::told::tell(news, self);
    }

    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        let dag = &self.dags[instance.dag.index()];
        dag.executions_ns[instance.subtask.index()][index(instance.job)]
    }

    fn started(&mut self, instance: Instance, _core: CoreId, now_ns: u64) {
        self.times(instance).start_ns = now_ns;
    }

    fn preempted(&mut self, instance: Instance, _core: CoreId, _now_ns: u64) {
        self.times(instance).preemptions += 1;
    }

    fn finished(&mut self, instance: Instance, _core: CoreId, now_ns: u64) {
        self.now_ns = now_ns;
        self.times(instance).finish_ns = now_ns;
    }
}

fn index(job: u64) -> usize {
    usize::try_from(job).expect("the file's jobs were counted in memory")
}
