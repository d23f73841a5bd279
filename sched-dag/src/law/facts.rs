//! From events to times: the facts judged by the rules.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::RunRecord;
use crate::ids::{DagId, Instance};
use crate::journal::{Event, EventKind};
use crate::policy::JobOutcome;
use crate::task_set::TaskSet;

impl RunRecord {
    /// Computes the times from a journal's events, given in their order.
    ///
    /// If the oldest events are lost (`is_whole` is false), the record begins, for each DAG, with
    /// the first released job due after the first remaining event: no event of such jobs is
    /// missing.
    ///
    /// Returns `None` if there is no memory for so many jobs.
    pub fn of_events(
        task_set: &TaskSet,
        is_whole: bool,
        events: impl Iterator<Item = Event> + Clone,
    ) -> Option<Self> {
        let jobs = jobs(task_set, is_whole, events.clone());
        let mut record = Self::with_jobs(task_set, |dag| jobs[dag.index()].clone())?;
        let mut ended_ns = vec![None; jobs.len()];
        let mut due_ns = vec![0; jobs.len()];
        for event in events {
            let index = event.dag.index();
            match event.what {
                EventKind::Due => due_ns[index] = event.time_ns,
                EventKind::DagEnded => {
                    ended_ns[index].get_or_insert(event.time_ns);
                }
                what if what.is_of_dag() => {}
                _ => match event.instance() {
                    Some(instance) => {
                        record.note_instance(instance, &event);
                        if event.what == EventKind::Restarted {
                            record.note_failure(&event);
                        }
                    }
                    None => {
                        let model = task_set.dag(event.dag);
                        let release_ns = model.release_ns(event.job, due_ns[index]);
                        record.note_job(&event, release_ns, ended_ns[index]);
                    }
                },
            }
        }
        // The end of a DAG cuts its jobs in flight.
        for (dag, ended_ns) in (0..).map(DagId).zip(ended_ns) {
            for job in &mut record.dags[dag.index()].jobs {
                let was_in_flight = job.release_ns.is_some()
                    && matches!(job.outcome, None | Some(JobOutcome::DagEnded));
                if was_in_flight {
                    job.cut_ns = job.cut_ns.or(ended_ns);
                }
            }
        }
        Some(record)
    }

    fn note_job(&mut self, event: &Event, release_ns: u64, ended_ns: Option<u64>) {
        let Some(job) = self.job_mut(event.dag, event.job) else {
            return;
        };
        let time_ns = event.time_ns;
        match event.what {
            EventKind::Released => {
                job.release_ns = Some(release_ns);
                job.released_ns = Some(time_ns);
            }
            EventKind::Aborted => job.cut_ns = Some(time_ns),
            EventKind::Missed => job.missed_ns = Some(time_ns),
            EventKind::Completed => {
                job.ended_ns = Some(time_ns);
                job.outcome = Some(match (job.cut_ns, ended_ns, job.missed_ns) {
                    (Some(_), _, _) if job.has_failed => JobOutcome::Failed,
                    (Some(_), _, _) => JobOutcome::Aborted,
                    (None, Some(_), _) => JobOutcome::DagEnded,
                    (None, None, Some(_)) => JobOutcome::Missed,
                    (None, None, None) => JobOutcome::Met,
                });
            }
            _ => {}
        }
    }

    /// Records that a fault has cut a job, unless the job was cut before.
    fn note_failure(&mut self, event: &Event) {
        if let Some(job) = self.job_mut(event.dag, event.job) {
            job.has_failed |= job.cut_ns.is_none();
            job.cut_ns.get_or_insert(event.time_ns);
        }
    }

    fn note_instance(&mut self, instance: Instance, event: &Event) {
        let Some(times) = self.instance_mut(instance) else {
            return;
        };
        let time_ns = Some(event.time_ns);
        match event.what {
            EventKind::Ready => times.ready_ns = time_ns,
            EventKind::Start => {
                times.start_ns = time_ns;
                times.core = Some(event.core);
            }
            EventKind::Resume => times.core = Some(event.core),
            EventKind::Suspend => times.preemptions += 1,
            EventKind::Finish => {
                times.finish_ns = time_ns;
                times.core = Some(event.core);
                times.runs += 1;
            }
            EventKind::Ended => times.failed_ns = time_ns,
            _ => {}
        }
    }
}

/// Returns, for each DAG, the numbers of the jobs without missing events.
fn jobs(
    task_set: &TaskSet,
    is_whole: bool,
    events: impl Iterator<Item = Event> + Clone,
) -> Vec<Range<u64>> {
    // The first number, and the number after the last.
    let mut jobs = vec![(u64::MAX, 0); task_set.dags().len()];
    let mut due_ns = vec![0; jobs.len()];
    let oldest_ns = events.clone().next().map_or(0, |event| event.time_ns);
    for event in events {
        let of_dag = &mut jobs[event.dag.index()];
        match event.what {
            EventKind::Due => due_ns[event.dag.index()] = event.time_ns,
            EventKind::Signalled | EventKind::Dropped => {}
            what if what.is_of_dag() => {}
            _ if is_whole => {
                let first = task_set.dag(event.dag).first_job();
                *of_dag = (first, of_dag.1.max(event.job + 1));
            }
            EventKind::Released => {
                let model = task_set.dag(event.dag);
                let release_ns = model.release_ns(event.job, due_ns[event.dag.index()]);
                if release_ns > oldest_ns {
                    *of_dag = (of_dag.0.min(event.job), event.job + 1);
                }
            }
            _ => {}
        }
    }
    let ranges = jobs.into_iter().map(|(first, end)| first.min(end)..end);
    ranges.collect()
}
