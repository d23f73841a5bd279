//! Checking jobs against the deadlines of their sinks (R4).
//!
//! To *judge* a job by a deadline means to find out whether any sinks with the deadline are late.
//! For each relative deadline, jobs are judged in the order of their numbers, each at most once: a
//! job in flight when the deadline has passed, or when the job ends; a waiting job, none of whose
//! sinks can have finished, when the deadline has passed. A cut counts as the judgement of a job.
//!
//! The progress of the sinks shows which are late, as long as each sink is looked at before another
//! instant begins. So a sink ending after an unnoticed deadline is judged at once, and counts as
//! late: had the deadline passed before, the scheduler would have noticed it.

use alloc::boxed::Box;

use super::JobTable;
use crate::ids::{DagId, SubtaskId};
use crate::journal::EventKind;
use crate::order::sorted_by_key;
use crate::scheduler::Scheduler;
use crate::scheduler::vertices::VertexTable;
use crate::task_set::Dag;

/// One relative deadline of a DAG, with the progress of judging jobs by it.
#[derive(Clone, Debug, Hash)]
pub(in crate::scheduler) struct Deadline {
    relative_ns: u64,
    sinks: Box<[SinkLateness]>,
    /// The sequence number of the first job in flight not judged, unless all jobs in flight are
    /// younger.
    judged: u64,
    /// The first waiting job not judged, unless all waiting jobs are younger.
    judged_waiting: u64,
}

/// A sink, and the number of jobs in which it was late.
#[derive(Clone, Debug, Hash)]
struct SinkLateness {
    subtask: SubtaskId,
    misses: u64,
}

/// The job to judge next.
#[derive(Clone, Copy, Debug)]
struct UnjudgedJob {
    number: u64,
    /// The job's sequence number; `None` if the job waits.
    sequence: Option<u64>,
    /// The number of the deadline, and its time.
    deadline: usize,
    deadline_ns: u64,
}

impl Deadline {
    /// Returns the deadlines of a DAG, ascending, at least one.
    #[inline]
    pub(in crate::scheduler) fn all(dag: &Dag) -> Box<[Self]> {
        let sinks = dag.sinks();
        let relative_ns = |sink: usize| dag.subtask(sinks[sink]).relative_deadline_ns();
        // Ascending, so that a waiting job misses the first deadline first.
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

    /// Carries the judgement of a waiting job over to its release, with a sequence number.
    #[inline]
    pub(in crate::scheduler) fn release(&mut self, number: u64, sequence: u64) {
        if number < self.judged_waiting {
            // Jobs are judged in order, so all jobs in flight are judged.
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
    /// Returns the first deadline of a job released at `release_ns`.
    #[inline]
    pub(in crate::scheduler) fn first_deadline_ns(&self, release_ns: u64) -> u64 {
        release_ns + self.deadlines[0].relative_ns
    }

    /// Returns the first instant after the earliest deadline with an unjudged job: a finish at the
    /// deadline itself is in time.
    #[inline]
    pub(super) fn late_ns(&self, dag: &Dag) -> Option<u64> {
        // With a single deadline, no time is spent on looking for the first.
        let deadline_ns = match &*self.deadlines {
            [only] => self.unjudged(dag, 0, only)?.deadline_ns,
            _ => self.first_unjudged(dag, None)?.deadline_ns,
        };
        Some(deadline_ns + 1)
    }

    /// Returns the judgement due first: of any job, or of job `only` if given.
    #[inline(never)]
    fn first_unjudged(&self, dag: &Dag, only: Option<u64>) -> Option<UnjudgedJob> {
        let of_deadlines = self.deadlines.iter().enumerate();
        let unjudged = of_deadlines.filter_map(|(at, deadline)| self.unjudged(dag, at, deadline));
        let unjudged = unjudged.filter(|unjudged| only.is_none_or(|job| unjudged.number == job));
        unjudged.min_by_key(|unjudged| unjudged.deadline_ns)
    }

    #[inline(always)]
    fn unjudged(&self, dag: &Dag, at: usize, deadline: &Deadline) -> Option<UnjudgedJob> {
        // Ended jobs were judged by their end.
        let first = deadline.judged.max(self.oldest);
        // A cut job is never late, so the next uncut job is due for judgement.
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
        // All jobs in flight are judged; of the waiting jobs only the numbers are known, in the
        // order of their release.
        let number = self.first_waiting.max(deadline.judged_waiting);
        (number < self.announced).then(|| UnjudgedJob {
            number,
            sequence: None,
            deadline: at,
            deadline_ns: self.waiting_release_ns(dag, number) + deadline.relative_ns,
        })
    }

    /// Counts the late sinks, and reports whether any is late.
    fn count_late(&mut self, unjudged: &UnjudgedJob, is_late: impl Fn(SubtaskId) -> bool) -> bool {
        let deadline = &mut self.deadlines[unjudged.deadline];
        match unjudged.sequence {
            // Moves on before the sinks are looked at: each deadline judges each job once.
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

    /// Notes that a job has missed a deadline, and reports whether this is the job's first miss.
    #[inline]
    fn note_miss(&mut self, unjudged: &UnjudgedJob) -> bool {
        match unjudged.sequence {
            Some(sequence) => !core::mem::replace(&mut self.job_mut(sequence).missed, true),
            // None of its sinks has finished: the job misses all deadlines in turn.
            None => unjudged.deadline == 0,
        }
    }

    /// Returns the number of jobs in which a sink was late; `None` if the subtask is no sink.
    #[inline]
    fn misses_of(&self, subtask: SubtaskId) -> Option<u64> {
        let mut sinks = self.deadlines.iter().flat_map(|deadline| &deadline.sinks);
        let sink = sinks.find(|sink| sink.subtask == subtask)?;
        Some(sink.misses)
    }
}

impl Scheduler {
    /// Returns the number of jobs in which a sink has missed its deadline, whether they were
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

    /// Notices all passed deadlines of a DAG. The instance of the vertex `ended` has ended at this
    /// instant, and no other instance since the last look.
    #[inline]
    pub(in crate::scheduler) fn judge(&mut self, dag: DagId, ended: Option<u32>) {
        let late_ns = self.dags[dag.index()].jobs.late_ns(self.task_set.dag(dag));
        if late_ns.is_some_and(|late_ns| late_ns <= self.log.now_ns) {
            self.judge_late(dag, ended, None);
        }
    }

    /// Notices also the deadlines at this very instant, for a job given up at this instant:
    /// completions come first, so sinks not finished by now miss them.
    pub(in crate::scheduler) fn judge_given_up(&mut self, dag: DagId, job: u64) {
        self.judge_late(dag, None, Some(job));
    }

    #[inline]
    fn judge_late(&mut self, dag: DagId, ended: Option<u32>, given_up: Option<u64>) {
        let model = self.task_set.dag(dag);
        let first = self.task_set.first_vertex(dag);
        let state = &mut self.dags[dag.index()];
        // Each round judges one job by one deadline, in the order of time. So the cost is
        // proportional to the misses since the last look, and the misses are recorded in their
        // order.
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
            // Each deadline counts its sinks; a job counts as missed once.
            if state.jobs.count_late(&unjudged, is_late) && state.jobs.note_miss(&unjudged) {
                state.statistics.count_miss();
                let deadline_ns = Some(unjudged.deadline_ns);
                (self.log).of_job(EventKind::Missed, dag, unjudged.number, deadline_ns);
            }
        }
    }

    /// Judges the DAG of a vertex whose instance has just ended, if the vertex is one of several
    /// sinks.
    #[inline]
    pub(in crate::scheduler) fn judge_ended(&mut self, vertex: u32) {
        let ended = self.vertices.get(vertex);
        let (dag, subtask) = (ended.dag, ended.subtask);
        let sinks = self.task_set.dag(dag).sinks();
        // A single sink ends the job, and the end of the job judges it.
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
