//! From a run's journal to what is compared with the reference.

use sched_dag::journal::{Event, What};
use sched_dag::{DagId, Instance, Notice, Scheduler, SubtaskId};

use crate::set::{Dag, Set};
use crate::{InstanceOutcome, JobOutcome, Outcome};

struct Record {
    outcome: Outcome,
    /// The DAGs whose ends were reported.
    ends: Vec<DagId>,
    /// The DAGs that have survived a fault, once for each.
    restarted: Vec<DagId>,
}

/// Returns what happened, or why that contradicts itself. A nominal release is known from a notice
/// only, which bears the outcome of a completed job, too.
pub(crate) fn outcome(
    set: &Set,
    scheduler: &Scheduler,
    events: &[Event],
    notices: &[Notice],
) -> Result<Outcome, String> {
    let mut record = Record {
        outcome: Outcome::of(set),
        ends: Vec::new(),
        restarted: Vec::new(),
    };
    let mut busy = 0_u32;
    for event in events {
        busy += u32::from(matches!(event.what, What::Start | What::Resume));
        busy -= u32::from(matches!(
            event.what,
            What::Suspend | What::Finish | What::Ended
        ));
        if busy > set.options.cores {
            return Err(format!("more instances run than cores after {event:?}"));
        }
        let is_new = match event.instance() {
            Some(instance) => record.note_instance(instance, event),
            None => record.note_job(event),
        };
        if !is_new {
            return Err(format!("{event:?} came before"));
        }
    }
    for Notice {
        event,
        at_ns,
        outcome,
    } in notices
    {
        let job = record.job(event.dag, event.job);
        let derived = (job.has_failed, job.is_cut);
        if event.what != What::Completed {
            job.nominal_ns = Some(*at_ns);
        } else if outcome.map(|it| {
            let is = |of| it == of;
            (
                is(sched_dag::JobOutcome::Failed),
                is(sched_dag::JobOutcome::DagEnded),
            )
        }) != Some(derived)
        {
            return Err(format!("{event:?}: {outcome:?}, not {derived:?}"));
        }
    }
    record.finish(set, scheduler)
}

impl Record {
    fn job(&mut self, dag: DagId, job: u64) -> &mut JobOutcome {
        &mut self.outcome.jobs[dag.index()][usize::try_from(job).expect("few jobs")]
    }

    /// Notes what happens to a job or a DAG, and reports whether it is for the first time.
    fn note_job(&mut self, event: &Event) -> bool {
        let Event { dag, job, .. } = *event;
        let is_ended = self.ends.contains(&dag);
        let times = match event.what {
            What::Stopped => {
                self.ends.push(dag);
                return !is_ended;
            }
            What::Released | What::Skipped | What::Aborted | What::Missed | What::Completed => {
                self.job(dag, job)
            }
            _ => return true,
        };
        let time_ns = match event.what {
            What::Released => &mut times.released_ns,
            What::Skipped => &mut times.skipped_ns,
            What::Aborted => &mut times.aborted_ns,
            What::Missed => &mut times.missed_ns,
            _ => {
                times.is_cut = is_ended && times.aborted_ns.is_none() && !times.has_failed;
                &mut times.ended_ns
            }
        };
        time_ns.replace(event.time_ns).is_none()
    }

    fn note_instance(&mut self, instance: Instance, event: &Event) -> bool {
        let Instance { dag, job, subtask } = instance;
        if event.what == What::Restarted {
            self.restarted.push(dag);
            let job = self.job(dag, job);
            job.has_failed = job.aborted_ns.is_none();
            return true;
        }
        let job = usize::try_from(job).expect("few jobs");
        let times = &mut self.outcome.instances[dag.index()][job][subtask.index()];
        let time_ns = match event.what {
            What::Ready => &mut times.ready_ns,
            What::Start => &mut times.start_ns,
            What::Finish => &mut times.finish_ns,
            What::Ended => &mut times.failed_ns,
            What::Cancelled => &mut times.cancelled_ns,
            what => {
                times.preemptions += u64::from(what == What::Suspend);
                return true;
            }
        };
        time_ns.replace(event.time_ns).is_none()
    }

    fn finish(mut self, set: &Set, scheduler: &Scheduler) -> Result<Outcome, String> {
        for (id, dag) in (0..).map(DagId).zip(&set.dags) {
            self.check_end(set, scheduler, id)?;
            self.outcome.statistics.push(*scheduler.statistics(id));
            let subtasks = (0..).map(SubtaskId).take(dag.subtasks.len());
            let misses = subtasks.map(|subtask| {
                let is_sink = dag.is_sink(subtask.index());
                is_sink.then(|| scheduler.sink_misses(id, subtask))
            });
            self.outcome.sink_misses.push(misses.collect());
        }
        Ok(self.outcome)
    }

    /// A DAG is ended, and reported so, if and only if one of its instances
    /// has failed and was not replaced, or it was stopped; nothing is left of it.
    fn check_end(&self, set: &Set, scheduler: &Scheduler, dag: DagId) -> Result<(), String> {
        let instances = self.outcome.instances[dag.index()].iter().flatten();
        let failed = instances.filter(|instance| instance.failed_ns.is_some());
        let restarted = self.restarted.iter().filter(|it| **it == dag);
        let of_set = &set.dags[dag.index()];
        let is_ended = failed.count() > restarted.count() || of_set.stop_ns.is_some();
        let statistics = scheduler.statistics(dag);
        // A sporadic DAG that got too few signals is not over.
        let has_jobs_left = !is_ended && statistics.released + statistics.skips < of_set.jobs;
        let is_right = scheduler.is_ended(dag) == is_ended
            && self.ends.contains(&dag) == is_ended
            && scheduler.is_over(dag) != has_jobs_left
            && scheduler.in_flight(dag) == 0;
        match is_right {
            true => Ok(()),
            false => Err(format!(
                "{dag:?} should be ended: {is_ended}; {statistics:?}"
            )),
        }
    }
}

impl Outcome {
    /// Nothing has happened yet.
    fn of(set: &Set) -> Self {
        let of_job = |dag: &Dag| vec![InstanceOutcome::default(); dag.subtasks.len()];
        let jobs = |dag: &Dag| (0..dag.jobs).map(|_| JobOutcome::default()).collect();
        let instances = |dag: &Dag| (0..dag.jobs).map(|_| of_job(dag)).collect();
        Self {
            instances: set.dags.iter().map(instances).collect(),
            jobs: set.dags.iter().map(jobs).collect(),
            statistics: Vec::new(),
            sink_misses: Vec::new(),
        }
    }
}
