//! Rule R4: when a job is late.
//!
//! A job has missed a deadline if and only if a sink finishes later than its own. A core
//! may finish in time while another one is just noticing the miss: that is a breach only
//! if more than the tolerance lies between. Where times are exact, a miss is noticed at
//! once: of several sinks, when the first deadline has passed that one of them does not
//! meet.
//!
//! Of a job that was aborted, or cut short by its DAG's end, it is not judged.

use alloc::vec::Vec;

use super::Replay;
use super::jobs::Job;
use crate::ids::{DagId, SubtaskId};
use crate::journal::{Event, What};
use crate::law::Violation;

/// The absolute deadline of a sink, and its finish.
struct Due {
    deadline_ns: u64,
    finish_ns: Option<u64>,
}

impl Due {
    fn is_met(&self) -> bool {
        (self.finish_ns).is_some_and(|finish_ns| finish_ns <= self.deadline_ns)
    }
}

impl Replay<'_> {
    /// Returns what is due of a job; `None` if it is not known since when.
    fn dues(&self, dag: DagId, known: &Job) -> Option<Vec<Due>> {
        let release_ns = known.release_ns?;
        let model = self.task_set.dag(dag);
        let due = |sink: &SubtaskId| Due {
            deadline_ns: release_ns.saturating_add(model.subtask(*sink).relative_deadline_ns()),
            finish_ns: (known.life(*sink))
                .and_then(|life| life.finish)
                .map(|finish| finish.time_ns),
        };
        Some(model.sinks().iter().map(due).collect())
    }

    /// R4 for the deadlines of a job, as far as it has come.
    pub(super) fn missed_wrongly(&self, dag: DagId, job: u64) -> Option<Violation> {
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job)?;
        let dues = self.dues(dag, known)?;
        let Some(missed) = known.missed else {
            let late = dues
                .iter()
                .filter(|due| due.finish_ns.is_some() && !due.is_met());
            let late = late.max_by_key(|due| due.finish_ns)?;
            let finish_ns = late.finish_ns?;
            let may_be_lost = self.may_be_lost(&dues);
            let is_cut = known.cut.is_some() || of_dag.is_stopped;
            return (!may_be_lost && !is_cut).then_some(Violation::NotMissed {
                dag,
                job,
                finish_ns,
                deadline_ns: late.deadline_ns,
            });
        };
        // Which of several sinks is meant is not known if a finish may be lost.
        if known.is_partial && dues.len() > 1 {
            return None;
        }
        let event = Event {
            time_ns: missed.time_ns,
            what: What::Missed,
            core: missed.core,
            dag,
            job,
            subtask: None,
        };
        let may_be_meant = |due: &&Due| {
            let finish_ns = due.finish_ns.filter(|_| due.is_met());
            finish_ns.is_none_or(|finish_ns| self.is_tolerable(finish_ns, missed.time_ns))
        };
        let meant_ns = dues
            .iter()
            .filter(may_be_meant)
            .map(|due| due.deadline_ns)
            .min();
        let earliest_ns = dues.iter().map(|due| due.deadline_ns).min()?;
        let deadline_ns = meant_ns.unwrap_or(earliest_ns);
        if missed.time_ns <= deadline_ns {
            return Some(Violation::MissedEarly { event, deadline_ns });
        }
        if meant_ns.is_none() {
            let last = dues.iter().max_by_key(|due| due.finish_ns)?;
            return Some(Violation::MissedInTime {
                event,
                finish_ns: last.finish_ns?,
                deadline_ns: last.deadline_ns,
            });
        }
        let is_late = self.is_exact() && missed.time_ns > deadline_ns + 1;
        is_late.then_some(Violation::MissedLate { event, deadline_ns })
    }

    /// Reports whether what followed from one of the deadlines may be among the events
    /// that are lost: the job's miss, or an abort before.
    fn may_be_lost(&self, dues: &[Due]) -> bool {
        let earliest_ns = dues.iter().map(|due| due.deadline_ns).min();
        !self.terms.is_whole && earliest_ns < self.first_ns
    }

    /// R4 at the end, for the deadlines of a job that is not complete.
    pub(super) fn never_missed(&self, dag: DagId, job: u64) -> Option<Violation> {
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job)?;
        if known.completed.is_some() {
            return None;
        }
        let judged = self.missed_wrongly(dag, job);
        if judged.is_some() || known.missed.is_some() || known.cut.is_some() {
            return judged;
        }
        let dues = self.dues(dag, known)?;
        let unfinished = dues.iter().filter(|due| due.finish_ns.is_none());
        let deadline_ns = unfinished.map(|due| due.deadline_ns).min()?;
        let has_passed = !self.is_tolerable(deadline_ns, self.end_ns);
        let is_missing = has_passed && !of_dag.is_stopped && !self.may_be_lost(&dues);
        is_missing.then_some(Violation::NeverMissed {
            dag,
            job,
            deadline_ns,
            end_ns: self.end_ns,
        })
    }
}
