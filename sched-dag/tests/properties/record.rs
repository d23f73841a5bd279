//! What happens in a run of the real scheduler, and what instances do there.

use std::collections::VecDeque;

use sched_dag::virtual_time::Workload;
use sched_dag::{CoreId, DagId, Instance, Observer, Scheduler, SubtaskId};

use crate::set::{Dag, Set};
use crate::{InstanceOutcome, JobOutcome, Outcome};

/// Everything that was reported, by place.
pub(crate) struct Record<'a> {
    set: &'a Set,
    now_ns: u64,
    instances: Vec<Vec<Vec<InstanceOutcome>>>,
    jobs: Vec<Vec<JobOutcome>>,
    busy: u32,
    /// The instances whose subtasks were replaced.
    restarted: Vec<Instance>,
    /// The DAGs that were reported as ended.
    ends: Vec<DagId>,
    /// The signals that are to come, with their DAGs, in order.
    signals: VecDeque<(u64, DagId)>,
    contradiction: Option<String>,
}

impl<'a> Record<'a> {
    pub(crate) fn new(set: &'a Set) -> Self {
        let jobs = |dag: &Dag| 0..dag.jobs;
        let instances = |dag: &Dag| vec![InstanceOutcome::default(); dag.subtasks.len()];
        let dags = set.dags.iter();
        let mut signals: Vec<_> = (0..)
            .map(DagId)
            .zip(dags.clone())
            .flat_map(|(id, dag)| {
                let signals_ns = dag.signals_ns.iter().flatten();
                signals_ns.map(move |&at_ns| (at_ns, id))
            })
            .collect();
        signals.sort_by_key(|&(at_ns, _)| at_ns);
        Self {
            set,
            now_ns: 0,
            instances: dags
                .clone()
                .map(|dag| jobs(dag).map(|_| instances(dag)).collect())
                .collect(),
            jobs: dags
                .map(|dag| jobs(dag).map(|_| JobOutcome::default()).collect())
                .collect(),
            busy: 0,
            restarted: Vec::new(),
            ends: Vec::new(),
            signals: signals.into(),
            contradiction: None,
        }
    }

    /// Returns what happened, or why that contradicts itself.
    pub(crate) fn finish(self, scheduler: &Scheduler) -> Result<Outcome, String> {
        let dags = (0..).map(DagId).take(self.set.dags.len());
        let statistics = dags
            .map(|dag| {
                self.check_end(scheduler, dag)?;
                Ok(*scheduler.statistics(dag))
            })
            .collect::<Result<_, String>>()?;
        if let Some(contradiction) = self.contradiction {
            return Err(contradiction);
        }
        let sink_misses = |(id, dag): (DagId, &Dag)| {
            let of_sink = |sink: u32| scheduler.sink_misses(id, SubtaskId(sink));
            let subtasks = (0..).zip(0..dag.subtasks.len());
            subtasks
                .map(|(number, subtask)| dag.is_sink(subtask).then(|| of_sink(number)))
                .collect()
        };
        let dags = (0..).map(DagId).zip(&self.set.dags);
        Ok(Outcome {
            sink_misses: dags.map(sink_misses).collect(),
            instances: self.instances,
            jobs: self.jobs,
            statistics,
        })
    }

    fn instance(&mut self, instance: Instance) -> &mut InstanceOutcome {
        let job = usize::try_from(instance.job).expect("few jobs");
        &mut self.instances[instance.dag.index()][job][instance.subtask.index()]
    }

    fn job(&mut self, dag: DagId, job: u64) -> &mut JobOutcome {
        &mut self.jobs[dag.index()][usize::try_from(job).expect("few jobs")]
    }

    /// A DAG is ended, and reported so once, if and only if one of its instances
    /// has failed and was not replaced, or it was stopped; nothing is left of it.
    fn check_end(&self, scheduler: &Scheduler, dag: DagId) -> Result<(), String> {
        let instances = self.instances[dag.index()].iter().flatten();
        let failed = instances.filter(|instance| instance.failed_ns.is_some());
        let restarted = self.restarted.iter().filter(|it| it.dag == dag);
        let is_ended =
            failed.count() > restarted.count() || self.set.dags[dag.index()].stop_ns.is_some();
        let reports = self.ends.iter().filter(|&&ended| ended == dag).count();
        let is_right = scheduler.is_ended(dag) == is_ended
            && reports == usize::from(is_ended)
            && scheduler.is_over(dag) != self.has_jobs_left(scheduler, dag)
            && scheduler.in_flight(dag) == 0;
        if is_right {
            return Ok(());
        }
        Err(format!(
            "dag {} should be ended: {is_ended}; {reports} reported ends, {:?}",
            dag.0,
            scheduler.statistics(dag)
        ))
    }

    /// A sporadic DAG that got too few signals is not over.
    fn has_jobs_left(&self, scheduler: &Scheduler, dag: DagId) -> bool {
        let begun = scheduler.statistics(dag).released + scheduler.statistics(dag).skips;
        !scheduler.is_ended(dag) && begun < self.set.dags[dag.index()].jobs
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
        self.job(dag, job).nominal_ns = Some(release_ns);
        self.once(|job| &mut job.released_ns, dag, job);
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.job(dag, job).nominal_ns = Some(release_ns);
        self.once(|job| &mut job.skipped_ns, dag, job);
    }

    fn ready(&mut self, instance: Instance) {
        let now_ns = self.now_ns;
        if self.instance(instance).ready_ns.replace(now_ns).is_some() {
            self.contradiction = Some(format!("{instance} is ready twice"));
        }
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.once(|job| &mut job.aborted_ns, dag, job);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _deadline_ns: u64) {
        self.once(|job| &mut job.missed_ns, dag, job);
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: sched_dag::JobOutcome) {
        self.job(dag, job).is_cut = outcome == sched_dag::JobOutcome::DagEnded;
        self.job(dag, job).has_failed = outcome == sched_dag::JobOutcome::Failed;
        self.once(|job| &mut job.ended_ns, dag, job);
    }

    fn cancelled(&mut self, instance: Instance) {
        let now_ns = self.now_ns;
        let cancelled_ns = &mut self.instance(instance).cancelled_ns;
        if cancelled_ns.replace(now_ns).is_some() {
            self.contradiction = Some(format!("{instance} is cancelled twice"));
        }
    }

    fn restarted(&mut self, instance: Instance) {
        self.restarted.push(instance);
    }

    fn ended(&mut self, dag: DagId) {
        self.ends.push(dag);
    }
}

impl Workload for Record<'_> {
    const WANTED: &'static [sched_dag::journal::What] = sched_dag::told::ALL;

    fn heard(&mut self, news: &sched_dag::News) {
        sched_dag::told::tell(news, self);
    }

    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        self.set.execution_ns(instance)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let dag = &self.set.dags[instance.dag.index()];
        dag.subtasks[instance.subtask.index()].fails_in == Some(instance.job)
    }

    fn is_replaceable(&mut self, instance: Instance) -> bool {
        self.set.dags[instance.dag.index()].subtasks[instance.subtask.index()].is_replaceable
    }

    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn next_signal_ns(&self) -> Option<u64> {
        self.signals.front().map(|&(at_ns, _)| at_ns)
    }

    fn take_signal(&mut self, now_ns: u64) -> Option<DagId> {
        let (_, dag) = self.signals.pop_front_if(|(at_ns, _)| *at_ns <= now_ns)?;
        Some(dag)
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
