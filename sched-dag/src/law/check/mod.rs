//! Holding a record against the rules R1 to R4, and each instance to one run.
//!
//! Words: a job's *precursor* is the job of the same DAG that was released
//! before it; with skipped releases that need not be the one numbered before.
//!
//! # What counts as right
//!
//! - A release that had to queue counts from when it was carried out.
//! - Of a job that was *cut*, because it was aborted or its DAG was ended,
//!   instances may end without having run. Where the precursor was cut, "ready
//!   exactly when" becomes "not ready before", because it is not recorded when
//!   an instance that never ran has ended.
//! - A job without an outcome was in flight when the record ended. What it has
//!   done so far is checked; that it did all is not asked.
//! - A job that was not recorded is not missed: a record may end before its
//!   DAGs do, and a DAG without end has no record or one of its first jobs.

use alloc::vec::Vec;

use super::{InstanceRecord, JobRecord, Precision, Record, Violation};
use crate::ids::{DagId, Instance, SubtaskId};
use crate::policy::JobOutcome;
use crate::policy::OverrunPolicy;
use crate::task_set::TaskSet;

/// Returns every breach of R1 to R4 that a record shows, as strictly as its
/// [`Precision`] allows, and every instance of a complete job that did not run
/// exactly once (R5).
///
/// Which instance should have run first is checked by
/// [`dispatch_violations`](super::dispatch_violations).
pub fn violations<'a>(
    task_set: &'a TaskSet,
    record: &'a Record,
) -> impl Iterator<Item = Violation> + 'a {
    let check = Check { task_set, record };
    let ids = (0..).map(DagId).zip(task_set.dags());
    ids.flat_map(move |(dag, _)| {
        let mut released = None;
        // Of a run that was shut down most jobs may be blank, which is no breach.
        let is_told = move |&(job, times): &(u64, &JobRecord)| {
            let mut instances = record.instances(dag, job).iter();
            times.release_ns.is_some() || instances.any(|times| *times != Default::default())
        };
        let jobs = record.numbered(dag).filter(is_told);
        jobs.flat_map(move |(job, times)| {
            let precursor = released;
            if times.release_ns.is_some() {
                released = Some(job);
            }
            // A vector, which stays empty as a rule: iterators within iterators would
            // hold rooms for violations at every level, 7 KiB that a build without
            // optimization moves from frame to frame.
            let mut found = Vec::new();
            check.job(dag, job, times, precursor, &mut found);
            for (subtask, of_subtask) in (0..).map(SubtaskId).zip(record.instances(dag, job)) {
                let instance = Instance { dag, job, subtask };
                check.instance(instance, of_subtask, times, precursor, &mut found);
            }
            found
        })
    })
}

#[derive(Clone, Copy)]
struct Check<'a> {
    task_set: &'a TaskSet,
    record: &'a Record,
}

impl Check<'_> {
    fn is_exact(&self) -> bool {
        self.record.precision() == Precision::Exact
    }

    fn job(
        self,
        dag: DagId,
        job: u64,
        times: &JobRecord,
        precursor: Option<u64>,
        found: &mut Vec<Violation>,
    ) {
        let Some(release_ns) = times.release_ns else {
            return;
        };
        found.extend(self.off_grid(dag, job, release_ns, precursor));
        found.extend(self.released_at_wrong_time(dag, job, release_ns, times));
        found.extend(self.ended_at_wrong_time(dag, job, times));
        found.extend(self.wrong_outcome(dag, job, release_ns, times));
    }

    fn instance(
        self,
        instance: Instance,
        times: &InstanceRecord,
        of_job: &JobRecord,
        precursor: Option<u64>,
        found: &mut Vec<Violation>,
    ) {
        let Some(release_ns) = of_job.release_ns else {
            let is_recorded = *times != InstanceRecord::default();
            found.extend(is_recorded.then_some(Violation::NotReleased { instance }));
            return;
        };
        found.extend(before_release(instance, times, release_ns));
        found.extend(self.ready_at_wrong_time(instance, times, of_job, precursor));
        found.extend(before_ready(instance, times));
        found.extend(self.overlap(instance, times));
        found.extend(self.before_predecessor(instance, times));
        found.extend(not_once(instance, times, of_job));
    }

    /// R1: releases lie on the grid, or, of a sporadic DAG, far enough apart.
    fn off_grid(
        self,
        dag: DagId,
        job: u64,
        release_ns: u64,
        precursor: Option<u64>,
    ) -> Option<Violation> {
        let model = self.task_set.dag(dag);
        if model.is_sporadic() {
            let before = precursor.and_then(|before| self.record.job(dag, before)?.release_ns);
            let earliest_ns = before.map_or(model.offset_ns(), |before_ns| {
                before_ns.saturating_add(model.period_ns())
            });
            return (release_ns < earliest_ns).then_some(Violation::TooSoon {
                dag,
                job,
                release_ns,
                earliest_ns,
            });
        }
        let grid_ns = model.grid_ns(job);
        (release_ns != grid_ns).then_some(Violation::OffGrid {
            dag,
            job,
            release_ns,
            grid_ns,
        })
    }

    /// R1: no release is carried out early; nor late, unless the overrun policy
    /// lets it wait.
    fn released_at_wrong_time(
        self,
        dag: DagId,
        job: u64,
        release_ns: u64,
        times: &JobRecord,
    ) -> Option<Violation> {
        let released_ns = times.released_ns?;
        let model = self.task_set.dag(dag);
        let expected_ns = match model.overrun() {
            OverrunPolicy::Skip => Some(release_ns),
            // It waits for the job that many places before it, and jobs end in
            // their order.
            OverrunPolicy::Queue => match job.checked_sub(model.in_flight().into()) {
                None => Some(release_ns),
                // That job is not recorded any more.
                Some(blocking) if blocking < self.record.first_job(dag) => {
                    Some(released_ns.max(release_ns))
                }
                Some(blocking) => {
                    let blocking = self.record.job(dag, blocking);
                    let ended_ns = blocking.and_then(|blocking| blocking.ended_ns);
                    ended_ns.map(|ended_ns| ended_ns.max(release_ns))
                }
            },
            // Which job makes room depends on what was aborted and skipped.
            OverrunPolicy::Abort => Some(released_ns.max(release_ns)),
        };
        let is_wrong = match self.record.precision() {
            Precision::Exact => expected_ns != Some(released_ns),
            Precision::Measured => released_ns < release_ns,
        };
        is_wrong.then_some(Violation::ReleasedAtWrongTime {
            dag,
            job,
            released_ns,
            expected_ns,
        })
    }

    /// R4: a job is complete when its last sink has finished.
    fn ended_at_wrong_time(self, dag: DagId, job: u64, times: &JobRecord) -> Option<Violation> {
        let outcome = times.outcome?;
        let ended_ns = times.ended_ns.filter(|_| is_complete(outcome))?;
        let last_sink_ns = self.last_sink_ns(dag, job);
        let is_right = last_sink_ns.is_some_and(|last_ns| match self.record.precision() {
            Precision::Exact => ended_ns == last_ns,
            Precision::Measured => ended_ns >= last_ns,
        });
        (!is_right).then_some(Violation::EndedAtWrongTime {
            dag,
            job,
            ended_ns,
            last_sink_ns,
        })
    }

    /// R4: a job meets its deadline if and only if it is complete by then; a
    /// miss is noticed.
    fn wrong_outcome(
        self,
        dag: DagId,
        job: u64,
        release_ns: u64,
        times: &JobRecord,
    ) -> Option<Violation> {
        let outcome = times.outcome?;
        let finish_ns = self.last_sink_ns(dag, job)?;
        let relative_deadline_ns = self.task_set.dag(dag).relative_deadline_ns();
        let deadline_ns = release_ns.saturating_add(relative_deadline_ns);
        let missed = times.missed_ns.is_some();
        let in_time = finish_ns <= deadline_ns;
        let is_wrong = match self.record.precision() {
            Precision::Exact => (outcome == JobOutcome::Met) != in_time || in_time == missed,
            // The scheduler may have heard too late of a finish in time.
            Precision::Measured => outcome == JobOutcome::Met && (!in_time || missed),
        };
        (is_wrong && is_complete(outcome)).then_some(Violation::WrongOutcome {
            dag,
            job,
            outcome,
            missed,
            finish_ns,
            deadline_ns,
        })
    }

    /// R2: an instance is ready when its job is released, its predecessors have
    /// finished, and its subtask has finished for the precursor.
    fn ready_at_wrong_time(
        self,
        instance: Instance,
        times: &InstanceRecord,
        of_job: &JobRecord,
        precursor: Option<u64>,
    ) -> Option<Violation> {
        let Instance { dag, job, subtask } = instance;
        let mut expected_ns = of_job.released_ns.or(of_job.release_ns);
        let mut wait_for = |finish_ns: Option<u64>| {
            let both = expected_ns.zip(finish_ns);
            expected_ns = both.map(|(earlier, later)| earlier.max(later));
        };
        for &predecessor in self.task_set.dag(dag).predecessors(subtask) {
            wait_for(self.finish_ns(dag, job, predecessor));
        }
        // The job before the first one that is recorded is not known.
        let is_first = precursor.is_none() && self.record.first_job(dag) > 0;
        let mut is_exact = self.is_exact() && !is_first;
        if let Some(precursor) = precursor {
            let finish_ns = self.finish_ns(dag, precursor, subtask);
            let is_cut = self.is_cut(dag, precursor);
            is_exact &= !is_cut;
            if finish_ns.is_some() || !is_cut {
                wait_for(finish_ns);
            }
        }
        let ready_ns = times.ready_ns.or(times.start_ns);
        let is_wrong = match (ready_ns, expected_ns) {
            (None, None) => false,
            // A job that is cut makes nothing ready any more.
            (None, Some(_)) => is_exact && !self.is_cut(dag, job),
            (Some(_), None) => true,
            (Some(ready_ns), Some(expected_ns)) => {
                ready_ns < expected_ns || (is_exact && ready_ns > expected_ns)
            }
        };
        is_wrong.then_some(Violation::ReadyAtWrongTime {
            instance,
            ready_ns,
            expected_ns,
        })
    }

    /// R2: a subtask is sequential over its own jobs, cut ones included.
    fn overlap(self, instance: Instance, times: &InstanceRecord) -> Option<Violation> {
        let start_ns = times.start_ns?;
        let older = (self.record.first_job(instance.dag)..instance.job).rev();
        let mut started = older.filter_map(|job| {
            let older = self.record.instance(Instance { job, ..instance })?;
            older.start_ns.map(|_| older.finish_ns)
        });
        let finish_ns = started.next()?;
        let is_free = finish_ns.is_some_and(|finish_ns| finish_ns <= start_ns);
        (!is_free).then_some(Violation::OverlapsItself { instance, start_ns })
    }

    /// R3: an instance's effects are there when it has finished, not before.
    fn before_predecessor(self, instance: Instance, times: &InstanceRecord) -> Option<Violation> {
        let start_ns = times.start_ns?;
        let Instance { dag, job, subtask } = instance;
        let predecessors = self.task_set.dag(dag).predecessors(subtask).iter();
        let mut early = predecessors.filter_map(|&predecessor| {
            let finish_ns = self.finish_ns(dag, job, predecessor);
            let is_finished = finish_ns.is_some_and(|finish_ns| finish_ns <= start_ns);
            (!is_finished).then_some(Violation::StartedBeforePredecessor {
                instance,
                start_ns,
                predecessor,
                finish_ns,
            })
        });
        early.next()
    }

    fn is_cut(self, dag: DagId, job: u64) -> bool {
        self.record.job(dag, job).is_some_and(|times| {
            let ended_early = times.outcome.is_some_and(|outcome| !is_complete(outcome));
            times.cut_ns.is_some() || ended_early
        })
    }

    fn finish_ns(self, dag: DagId, job: u64, subtask: SubtaskId) -> Option<u64> {
        let instance = Instance { dag, job, subtask };
        self.record.instance(instance)?.finish_ns
    }

    fn last_sink_ns(self, dag: DagId, job: u64) -> Option<u64> {
        let sinks = self.task_set.dag(dag).sinks().iter();
        super::latest(sinks.map(|&sink| self.finish_ns(dag, job, sink)))
    }
}

/// R1: nothing of a job runs before its release.
fn before_release(
    instance: Instance,
    times: &InstanceRecord,
    release_ns: u64,
) -> Option<Violation> {
    let start_ns = times.start_ns?;
    (start_ns < release_ns).then_some(Violation::StartedBeforeRelease {
        instance,
        start_ns,
        release_ns,
    })
}

/// R2: nothing runs that is not ready.
fn before_ready(instance: Instance, times: &InstanceRecord) -> Option<Violation> {
    let (start_ns, ready_ns) = (times.start_ns?, times.ready_ns?);
    (start_ns < ready_ns).then_some(Violation::StartedBeforeReady {
        instance,
        start_ns,
        ready_ns,
    })
}

/// R5: every instance of a job that is complete has run once, and none twice.
fn not_once(instance: Instance, times: &InstanceRecord, of_job: &JobRecord) -> Option<Violation> {
    let must_run = of_job.outcome.is_some_and(is_complete);
    let runs = times.runs;
    (runs > 1 || (must_run && runs == 0)).then_some(Violation::NotRunOnce { instance, runs })
}

/// Reports whether all subtasks of a job have finished.
fn is_complete(outcome: JobOutcome) -> bool {
    matches!(outcome, JobOutcome::Met | JobOutcome::Missed)
}

#[cfg(test)]
mod tests;
