//! Holding jobs against the deadlines of their sinks (R4).
//!
//! To *judge* a job by a deadline is to find out whether the sinks that have it are
//! late. By each relative deadline jobs are judged in the order of their numbers, each
//! once: a job in flight when the deadline has passed, or when it ends; a waiting one, of
//! which no sink can have finished, when it has passed. A job that is cut is judged by
//! that.
//!
//! Which sinks are late shows in their progress, as long as each is looked at before
//! another instant begins. So a sink that ends after a deadline that nobody has noticed
//! yet is judged at once, and counts as late: had the deadline passed before, it would
//! have been noticed.

use alloc::boxed::Box;

use super::JobTable;
use crate::ids::{DagId, SubtaskId};
use crate::journal::EventKind;
use crate::order::sorted_by_key;
use crate::scheduler::Scheduler;
use crate::scheduler::vertices::VertexTable;
use crate::task_set::Dag;

/// One relative deadline of a DAG, and how far its jobs are judged by it.
#[derive(Clone, Debug, Hash)]
pub(in crate::scheduler) struct Deadline {
    relative_ns: u64,
    sinks: Box<[SinkLateness]>,
    /// The sequence number of the first job in flight that is not judged, if that is
    /// not older than all in flight.
    judged: u64,
    /// The first waiting job that is not judged, if that is not older than all waiting.
    judged_waiting: u64,
}

/// A sink, and how many jobs it was late in.
#[derive(Clone, Debug, Hash)]
struct SinkLateness {
    subtask: SubtaskId,
    misses: u64,
}

/// A job that is to be judged next.
#[derive(Clone, Copy, Debug)]
struct UnjudgedJob {
    number: u64,
    /// Its sequence number; `None` if it waits.
    sequence: Option<u64>,
    /// By which deadline, and when that is.
    deadline: usize,
    deadline_ns: u64,
}

impl Deadline {
    /// Returns the deadlines of a DAG, ascending, at least one.
    #[inline]
    pub(in crate::scheduler) fn all(dag: &Dag) -> Box<[Self]> {
        let sinks = dag.sinks();
        let relative_ns = |sink: usize| dag.subtask(sinks[sink]).relative_deadline_ns();
        // Ascending, so that a waiting job misses the first one first.
        let order = sorted_by_key(sinks.len(), relative_ns);
        let same = order.chunk_by(|one, other| relative_ns(*one) == relative_ns(*other));
        let deadline = |same: &[usize]| Self {
            relative_ns: relative_ns(same[0]),
            sinks: (same.iter())
                .map(|&sink| SinkLateness {
                    subtask: sinks[sink],
                    misses: 0,
                })
                .collect(),
            judged: 0,
            judged_waiting: 0,
        };
        same.map(deadline).collect()
    }

    /// Takes over what is known of a waiting job that is released, with a sequence number.
    #[inline]
    pub(in crate::scheduler) fn release(&mut self, number: u64, sequence: u64) {
        if number < self.judged_waiting {
            // Judged in order: so all in flight are.
            self.judged = sequence + 1;
        }
    }

    /// Reports whether a waiting job is judged.
    #[inline]
    pub(in crate::scheduler) const fn has_judged_waiting(&self, number: u64) -> bool {
        number < self.judged_waiting
    }
}

impl JobTable {
    /// Returns the first deadline of the job that is released at a time.
    #[inline]
    pub(in crate::scheduler) fn first_deadline_ns(&self, release_ns: u64) -> u64 {
        release_ns + self.deadlines[0].relative_ns
    }

    /// Returns when the first deadline has passed by which a job is not judged: the
    /// deadline itself is still in time.
    #[inline]
    pub(super) fn late_ns(&self, dag: &Dag) -> Option<u64> {
        // Where there is one, no time is spent on looking for the first.
        let deadline_ns = match &*self.deadlines {
            [only] => self.unjudged(dag, 0, only)?.deadline_ns,
            _ => self.first_unjudged(dag, None)?.deadline_ns,
        };
        Some(deadline_ns + 1)
    }

    /// Returns the job that is to be judged first, or when this job is, if one is given.
    #[inline(never)]
    fn first_unjudged(&self, dag: &Dag, only: Option<u64>) -> Option<UnjudgedJob> {
        let of_deadlines = self.deadlines.iter().enumerate();
        let unjudged = of_deadlines.filter_map(|(at, deadline)| self.unjudged(dag, at, deadline));
        let unjudged = unjudged.filter(|unjudged| only.is_none_or(|job| unjudged.number == job));
        unjudged.min_by_key(|unjudged| unjudged.deadline_ns)
    }

    #[inline(always)]
    fn unjudged(&self, dag: &Dag, at: usize, deadline: &Deadline) -> Option<UnjudgedJob> {
        // Jobs that have ended were judged by their end.
        let first = deadline.judged.max(self.oldest);
        // A cut job is never late, so the next one that is not cut is due for judgement.
        let mut uncut = (first..self.next).filter(|&sequence| self.job(sequence).cut.is_none());
        if let Some(sequence) = uncut.next() {
            let job = self.job(sequence);
            return Some(UnjudgedJob {
                number: job.number,
                sequence: Some(sequence),
                deadline: at,
                deadline_ns: job.release_ns + deadline.relative_ns,
            });
        }
        // All in flight are judged; of the waiting ones only numbers are known, in which order
        // they will be released.
        let number = self.first_waiting.max(deadline.judged_waiting);
        (number < self.announced).then(|| UnjudgedJob {
            number,
            sequence: None,
            deadline: at,
            deadline_ns: self.waiting_release_ns(dag, number) + deadline.relative_ns,
        })
    }

    /// Counts the sinks that are late, and reports whether any is.
    fn count_late(&mut self, unjudged: &UnjudgedJob, is_late: impl Fn(SubtaskId) -> bool) -> bool {
        let deadline = &mut self.deadlines[unjudged.deadline];
        match unjudged.sequence {
            // Moves on before the sinks are looked at: each job is judged once by each deadline.
            Some(sequence) => deadline.judged = sequence + 1,
            None => deadline.judged_waiting = unjudged.number + 1,
        }
        let mut late = 0_u64;
        for sink in &mut deadline.sinks {
            let is_late = u64::from(is_late(sink.subtask));
            sink.misses += is_late;
            late += is_late;
        }
        late > 0
    }

    /// Notes that a job has missed a deadline, and reports whether it is its first one.
    #[inline]
    fn note_miss(&mut self, unjudged: &UnjudgedJob) -> bool {
        match unjudged.sequence {
            Some(sequence) => !core::mem::replace(&mut self.job_mut(sequence).missed, true),
            // Nothing of it has finished: it misses one deadline after the other.
            None => unjudged.deadline == 0,
        }
    }

    /// Returns how many jobs a sink was late in; `None` if the subtask is no sink.
    #[inline]
    fn misses_of(&self, subtask: SubtaskId) -> Option<u64> {
        let mut sinks = self.deadlines.iter().flat_map(|deadline| &deadline.sinks);
        let sink = sinks.find(|sink| sink.subtask == subtask)?;
        Some(sink.misses)
    }
}

impl Scheduler {
    /// Returns how many jobs a sink has missed its deadline in, whether they were
    /// released or still waited for their release.
    ///
    /// # Panics
    ///
    /// If there is no such DAG, or the subtask is no sink of it.
    #[inline]
    pub fn sink_misses(&self, dag: DagId, sink: SubtaskId) -> u64 {
        let misses = self.dags[dag.index()].jobs.misses_of(sink);
        misses.expect("only sinks have deadlines; ask `Dag::sinks`")
    }

    /// Notices all deadlines of a DAG that have passed. The instance of the vertex
    /// `ended` has ended at this instant, and no other one since the last look.
    #[inline]
    pub(in crate::scheduler) fn judge(&mut self, dag: DagId, ended: Option<u32>) {
        let late_ns = self.dags[dag.index()].jobs.late_ns(self.task_set.dag(dag));
        if late_ns.is_some_and(|late_ns| late_ns <= self.log.now_ns) {
            self.judge_late(dag, ended, None);
        }
    }

    /// Notices the deadlines at this instant, too, of a job that is given up at it: completions
    /// come first, so what is not complete by now misses them.
    pub(in crate::scheduler) fn judge_given_up(&mut self, dag: DagId, job: u64) {
        self.judge_late(dag, None, Some(job));
    }

    #[inline]
    fn judge_late(&mut self, dag: DagId, ended: Option<u32>, given_up: Option<u64>) {
        let model = self.task_set.dag(dag);
        let first = self.task_set.first_vertex(dag);
        let state = &mut self.dags[dag.index()];
        // Each round judges one job by one deadline, in the order of time: so it costs what was
        // missed since the last look, and the misses are written down in their order.
        let end_ns = self.log.now_ns + u64::from(given_up.is_some());
        while let Some(unjudged) = state.jobs.first_unjudged(model, given_up)
            // A finish at the deadline itself is in time.
            && unjudged.deadline_ns < end_ns
        {
            let vertices = &self.vertices;
            let is_late = |sink: SubtaskId| match unjudged.sequence {
                Some(sequence) => is_unfinished(vertices, first + sink.0, sequence, ended),
                None => true,
            };
            // Sinks are counted by each deadline, the job once.
            if state.jobs.count_late(&unjudged, is_late) && state.jobs.note_miss(&unjudged) {
                state.statistics.count_miss();
                let deadline_ns = Some(unjudged.deadline_ns);
                (self.log).of_job(EventKind::Missed, dag, unjudged.number, deadline_ns);
            }
        }
    }

    /// Judges the DAG of a vertex whose instance has just ended, if that is one of several sinks.
    #[inline]
    pub(in crate::scheduler) fn judge_ended(&mut self, vertex: u32) {
        let ended = self.vertices.get(vertex);
        let (dag, subtask) = (ended.dag, ended.subtask);
        let sinks = self.task_set.dag(dag).sinks();
        // With one sink the job ends with it, and the end of the job judges it.
        if sinks.len() > 1 && sinks.binary_search(&subtask).is_ok() {
            self.judge(dag, Some(vertex));
        }
    }
}

/// Reports whether a sink had not finished its part of a job in flight before this instant.
#[inline]
fn is_unfinished(vertices: &VertexTable, sink: u32, sequence: u64, ended: Option<u32>) -> bool {
    let has_just_ended = u64::from(ended == Some(sink));
    // The end at this instant has moved the sink on by one, and counts as late.
    vertices.get(sink).progress - has_just_ended <= sequence
}
