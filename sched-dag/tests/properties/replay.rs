//! A set in the real scheduler, through commit and virtual time.

use std::sync::Arc;

use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, CoreId, DagId, DagStatistics, Instance, Observer, Scheduler,
    verify,
};

use crate::set::Set;
use crate::{InstanceOutcome, JobOutcome, Outcome};

/// Runs a set and returns what happened, or why that contradicts itself.
pub(crate) fn replay(set: &Set) -> Result<Outcome, String> {
    let options = CommitOptions::new(set.options.policy, set.options.cores)
        .with_construction(ConstructionPolicy::any_graph());
    let verified = verify(&set.specs(), &options).map_err(|rejected| rejected.to_string())?;
    let jobs = |jobs: u64| 0..jobs;
    let mut record = Record {
        set,
        now_ns: 0,
        instances: set
            .dags
            .iter()
            .map(|dag| {
                jobs(dag.jobs)
                    .map(|_| vec![InstanceOutcome::default(); dag.subtasks.len()])
                    .collect()
            })
            .collect(),
        jobs: set
            .dags
            .iter()
            .map(|dag| jobs(dag.jobs).map(|_| JobOutcome::default()).collect())
            .collect(),
        busy: 0,
        ends: Vec::new(),
        contradiction: None,
    };
    let mut run = VirtualTime::new(Scheduler::new(Arc::new(verified.task_set), set.options));
    if run.run(&mut record) != End::Finished || !run.scheduler().is_finished() {
        return Err("the run does not finish".to_owned());
    }
    if let Some(contradiction) = record.contradiction.take() {
        return Err(contradiction);
    }
    let mut dropped = Vec::new();
    for (dag, jobs) in (0..).zip(&record.jobs) {
        let statistics = run.scheduler().statistics(DagId(dag));
        check_statistics(statistics, jobs)?;
        record.check_end(run.scheduler(), DagId(dag))?;
        dropped.push(statistics.dropped);
    }
    Ok(Outcome {
        instances: record.instances,
        jobs: record.jobs,
        dropped,
    })
}

/// The counters must be those of the events.
fn check_statistics(statistics: &DagStatistics, jobs: &[JobOutcome]) -> Result<(), String> {
    let count = |is: fn(&JobOutcome) -> bool| jobs.iter().filter(|job| is(job)).count() as u64;
    let counted = [
        (statistics.released, count(|job| job.released_ns.is_some())),
        (statistics.skips, count(|job| job.skipped_ns.is_some())),
        (statistics.aborts, count(|job| job.aborted_ns.is_some())),
        (statistics.misses, count(|job| job.missed_ns.is_some())),
        (
            statistics.completed,
            count(|job| job.ended_ns.is_some() && job.aborted_ns.is_none() && !job.is_cut),
        ),
        (statistics.cut_short, count(|job| job.is_cut)),
    ];
    if counted.iter().all(|(counter, events)| counter == events) {
        Ok(())
    } else {
        Err(format!(
            "{statistics:?} differs from the events {counted:?}"
        ))
    }
}

struct Record<'a> {
    set: &'a Set,
    now_ns: u64,
    instances: Vec<Vec<Vec<InstanceOutcome>>>,
    jobs: Vec<Vec<JobOutcome>>,
    busy: u32,
    /// The DAGs that were reported as ended.
    ends: Vec<DagId>,
    contradiction: Option<String>,
}

impl Record<'_> {
    fn instance(&mut self, instance: Instance) -> &mut InstanceOutcome {
        let job = usize::try_from(instance.job).expect("few jobs");
        &mut self.instances[instance.dag.index()][job][instance.subtask.index()]
    }

    fn job(&mut self, dag: DagId, job: u64) -> &mut JobOutcome {
        &mut self.jobs[dag.index()][usize::try_from(job).expect("few jobs")]
    }

    /// A DAG is ended, and reported so once, if and only if one of its
    /// instances has failed; each failure is counted.
    fn check_end(&self, scheduler: &Scheduler, dag: DagId) -> Result<(), String> {
        let instances = self.instances[dag.index()].iter().flatten();
        let faults = instances
            .filter(|instance| instance.failed_ns.is_some())
            .count();
        let reports = self.ends.iter().filter(|&&ended| ended == dag).count();
        let is_right = scheduler.is_ended(dag) == (faults > 0)
            && reports == faults.min(1)
            && scheduler.statistics(dag).faults == faults as u64
            && scheduler.is_over(dag);
        if is_right {
            return Ok(());
        }
        Err(format!(
            "dag {} has {faults} faults and {reports} reported ends, {:?}",
            dag.0,
            scheduler.statistics(dag)
        ))
    }

    fn once(&mut self, time: fn(&mut JobOutcome) -> &mut Option<u64>, dag: DagId, job: u64) {
        let now_ns = self.now_ns;
        if time(self.job(dag, job)).replace(now_ns).is_some() {
            self.contradiction = Some(format!("dag {} job {job}: an event came twice", dag.0));
        }
    }
}

impl Observer for Record<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let nominal = &self.set.dags[dag.index()];
        if release_ns != nominal.offset_ns + nominal.period_ns * job {
            self.contradiction = Some(format!("dag {} job {job} is off the grid", dag.0));
        }
        self.once(|job| &mut job.released_ns, dag, job);
    }

    fn skipped(&mut self, dag: DagId, job: u64, _release_ns: u64) {
        self.once(|job| &mut job.skipped_ns, dag, job);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.once(|job| &mut job.aborted_ns, dag, job);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _deadline_ns: u64) {
        self.once(|job| &mut job.missed_ns, dag, job);
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: sched_dag::JobOutcome) {
        self.job(dag, job).is_cut = outcome == sched_dag::JobOutcome::DagEnded;
        self.once(|job| &mut job.ended_ns, dag, job);
    }

    fn cancelled(&mut self, instance: Instance) {
        let now_ns = self.now_ns;
        let cancelled_ns = &mut self.instance(instance).cancelled_ns;
        if cancelled_ns.replace(now_ns).is_some() {
            self.contradiction = Some(format!("{instance} is cancelled twice"));
        }
    }

    fn ended(&mut self, dag: DagId) {
        self.ends.push(dag);
    }
}

impl Workload for Record<'_> {
    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        let subtask = &self.set.dags[instance.dag.index()].subtasks[instance.subtask.index()];
        subtask.executions_ns[usize::try_from(instance.job).expect("few jobs")]
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let dag = &self.set.dags[instance.dag.index()];
        dag.subtasks[instance.subtask.index()].fails_in == Some(instance.job)
    }

    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn started(&mut self, instance: Instance, _core: CoreId, now_ns: u64) {
        self.instance(instance).start_ns = Some(now_ns);
        self.busy += 1;
        if self.busy > self.set.options.cores {
            self.contradiction = Some(format!("at {now_ns} more instances run than cores"));
        }
    }

    fn preempted(&mut self, instance: Instance, _core: CoreId, _now_ns: u64) {
        self.instance(instance).preemptions += 1;
        self.busy -= 1;
    }

    fn resumed(&mut self, _instance: Instance, _core: CoreId, _now_ns: u64) {
        self.busy += 1;
    }

    fn finished(&mut self, instance: Instance, _core: CoreId, now_ns: u64) {
        self.instance(instance).finish_ns = Some(now_ns);
        self.busy -= 1;
    }

    fn failed(&mut self, instance: Instance, _core: CoreId, now_ns: u64) {
        self.instance(instance).failed_ns = Some(now_ns);
        self.busy -= 1;
    }
}
