//! The life of an instance: ready, started, ended.
//!
//! An instance ends by finishing, by a fault or, in a job that is cut (aborted, at fault,
//! or of a DAG that is ended), by being cancelled. In all cases all its outgoing edges
//! are released at that instant (R3), so such a job ends by the same rules as
//! any other, only without running.

use super::groups::ReadyLines;
use super::jobs::Job;
use super::jobs::TimerKind;
use super::vertices::{EndKind, InstancePhase, Vertex, VertexTable};
use super::{DagPhase, EventLog, OWED, Scheduler};
use crate::ids::{DagId, Instance};
use crate::journal::EventKind;

impl Scheduler {
    /// Ends an instance that has started.
    #[inline]
    pub(super) fn finish(&mut self, instance: Instance) {
        let vertex = self.take_off(instance, "is completed");
        self.end_instance(vertex);
        // Earlier no deadline of any DAG has passed, so nothing can be late.
        if self.log.now_ns >= self.quiet_until_ns {
            self.judge_ended(vertex);
        }
    }

    /// Takes a started instance from its core, or out of line if it has none,
    /// and returns its vertex. `event` says what the driver claims, if the
    /// instance has not started.
    #[inline]
    pub(super) fn take_off(&mut self, instance: Instance, event: &str) -> u32 {
        let number = self.vertex(instance).0;
        let vertex = self.vertices.get(number);
        let jobs = &self.dags[instance.dag.index()].jobs;
        // A driver may name an instance of another job of the vertex, or one that has ended: that
        // is its mistake, and must not end the wrong one.
        let in_flight = vertex.dag == instance.dag
            && vertex.progress < jobs.next
            && jobs.job(vertex.progress).number == instance.job;
        match vertex.phase {
            InstancePhase::Running(core) if in_flight => {
                self.cores.free(core);
                self.ready.lists.end(core, number);
                // The core is idle until a dispatch; the short way must not be taken before.
                self.fresh |= OWED;
            }
            // It lost its core in the scheduler's eyes, but finished before the machine took the
            // core away.
            InstancePhase::Preempted if in_flight => {
                // No vertex keeps its key: it is absolute, so it comes out as when it was put in
                // line.
                let key = (self.ready).key(number, vertex, || jobs.job(vertex.progress));
                self.ready.remove(vertex, key);
            }
            _ => panic!("{instance} {event} and has not started; complete each once, or fail it"),
        }
        number
    }

    /// Releases the sources of a DAG in the job with a sequence number.
    #[inline]
    pub(super) fn release_sources(&mut self, dag: DagId, sequence: u64) {
        let Self {
            task_set,
            dags,
            vertices,
            ready,
            fresh,
            log,
            ..
        } = self;
        let state = &dags[dag.index()];
        let job = state.jobs.job(sequence);
        let first_vertex = task_set.first_vertex(dag);
        for source in task_set.dag(dag).sources() {
            let number = first_vertex + source.0;
            // A source may still do the job before (R2); then the end of that lines this one up.
            if let Some(vertex) = vertices.arrive(number, sequence) {
                line_up(number, vertex, job, ready, log);
                *fresh += 1;
            }
        }
    }

    /// Cancels all instances of a DAG that are ready, have not started, and do
    /// the job with a sequence number (all jobs if that is `u64::MAX`), and all
    /// that thereby would become ready.
    #[inline]
    pub(super) fn cancel_ready(&mut self, dag: DagId, sequence: u64) {
        self.cancel_waits(dag, sequence);
        self.touch_lists();
        let state = &self.dags[dag.index()];
        // In topological order each vertex is looked at after its predecessors, so none becomes
        // ready behind the loop's back.
        for &subtask in self.task_set.dag(dag).topological_order() {
            let number = self.task_set.first_vertex(dag) + subtask.0;
            let vertex = self.vertices.get_mut(number);
            // From now on an end has to ask whether its job is cut, which the short way does not.
            vertex.ends = EndKind::Any;
            let is_meant = sequence == u64::MAX || vertex.progress == sequence;
            if vertex.phase == InstancePhase::Ready && is_meant {
                let job = state.jobs.job(vertex.progress);
                let key = self.ready.key(number, vertex, || job);
                self.ready.remove(vertex, key);
                self.log
                    .of_instance(EventKind::Cancelled, vertex.instance(job));
                vertex.phase = InstancePhase::Absent;
                // Ended below, not here: an end makes further instances ready, which the loop must
                // not meet half-way.
                self.ending.push(number);
            }
        }
        self.end_all();
    }

    /// Ends the instance that a vertex is doing, and all that are cancelled by
    /// that.
    #[inline]
    pub(super) fn end_instance(&mut self, vertex: u32) {
        self.end_one(vertex);
        if !self.ending.is_empty() {
            // Its next instance may be among them, and then hide that this one was late.
            if self.log.now_ns >= self.quiet_until_ns {
                self.judge_ended(vertex);
            }
            self.end_all();
        }
    }

    /// Ends all instances in `ending`.
    ///
    /// A vertex is in it at most once at a time: its next instance can only be
    /// ready when this one has been taken out. So each round of the loop ends
    /// another instance in flight.
    #[inline]
    pub(super) fn end_all(&mut self) {
        // A stack in memory of its own, not recursion: a chain may be 100,000 subtasks long.
        while let Some(vertex) = self.ending.pop() {
            self.end_one(vertex);
        }
    }

    /// Tells the successors that the instance has ended, and ends its job if no
    /// instance of that is left.
    #[inline(always)]
    fn end_one(&mut self, number: u32) {
        let Self {
            dags,
            vertices,
            ready,
            ending,
            fresh,
            log,
            ..
        } = self;
        let ended = vertices.end_instance(number);
        let (dag, sequence) = (ended.dag, ended.progress);
        let jobs = &mut dags[dag.index()].jobs;
        // Read before `job_mut` borrows the jobs: whether a younger job is in flight, in which the
        // vertex may already be awaited.
        let overlaps = sequence + 1 < jobs.next;
        let job = jobs.job_mut(sequence);
        let is_cut = job.cut.is_some();
        let successors = VertexTable::successors(&ended);
        // Only sinks count: every other instance ends before some sink of its job.
        job.unfinished -= u32::from(successors.is_empty());
        let is_last = job.unfinished == 0;
        for place in successors {
            let next = vertices.successor(place);
            if let Some(successor) = vertices.arrive(next, sequence) {
                // R3 holds in a cut job, too: edges are released, but the successors are cancelled
                // instead of lined up.
                if is_cut {
                    log.of_instance(EventKind::Cancelled, successor.instance(job));
                    ending.push(next);
                } else {
                    line_up(next, successor, job, ready, log);
                    *fresh += 1;
                }
            }
        }
        // The other half of R2: the next job's instance may have waited for this one alone.
        if overlaps {
            self.go_on_to_next_job(number);
        }
        // After the successors and the vertex's next instance: the job's slot is free only now.
        if is_last {
            self.end_job(dag, sequence, number);
        }
    }

    /// Lets a vertex whose instance has ended go on with the next job, which is in
    /// flight, if that waits for nothing else.
    #[inline]
    fn go_on_to_next_job(&mut self, number: u32) {
        if let Some(vertex) = self.vertices.next_is_ready(number) {
            let jobs = &self.dags[vertex.dag.index()].jobs;
            let job = jobs.job(vertex.progress);
            // The job was cut while this instance still waited for its turn: it is cancelled now
            // that it would be ready.
            if job.cut.is_some() {
                self.log
                    .of_instance(EventKind::Cancelled, vertex.instance(job));
                self.ending.push(number);
            } else {
                line_up(number, vertex, job, &mut self.ready, &mut self.log);
                self.fresh += 1;
            }
        }
    }

    /// Ends the oldest job of a DAG, all of whose instances have ended, that of the vertex
    /// `last` at this instant (R4).
    #[inline]
    fn end_job(&mut self, dag: DagId, sequence: u64, last: u32) {
        // Before then no deadline has passed.
        if self.log.now_ns >= self.quiet_until_ns {
            self.judge(dag, Some(last));
        }
        let state = &mut self.dags[dag.index()];
        debug_assert_eq!(sequence, state.jobs.oldest, "jobs end in their order");
        let job = *state.jobs.job(sequence);
        // Its end makes the short way possible again, unless the DAG is ended for good.
        if job.cut.is_some() {
            if state.jobs.phase != DagPhase::Ended {
                let first = self.task_set.first_vertex(dag) as usize;
                let subtasks = self.task_set.dag(dag).subtasks().len();
                self.vertices.allow_passing_on(first..first + subtasks);
            }
        } else {
            // Not for a cut job: it does not even end a run of misses (rule 5 of `overrun`).
            state.statistics.completed += 1;
            if !job.missed {
                state.statistics.count_met();
            }
        }
        state.jobs.end_oldest();
        let has_limit = self.task_set.dag(dag).jobs().is_some();
        self.log.jobs_ended += u64::from(has_limit);
        self.log.of_job(EventKind::Completed, dag, job.number, None);
        // A release that was blocked by this job may be due now.
        self.set_timer(dag);
    }

    /// Notes when something happens next to a DAG without a completion.
    #[inline]
    pub(super) fn set_timer(&mut self, dag: DagId) {
        let model = self.task_set.dag(dag);
        let jobs = &self.dags[dag.index()].jobs;
        self.set_timer_to(dag, jobs.next_event(model, self.log.now_ns));
    }

    /// Notes the next event of a DAG without a completion.
    #[inline(always)]
    pub(super) fn set_timer_to(&mut self, dag: DagId, event: Option<(u64, TimerKind)>) {
        self.timers.set_dag(dag.index(), event);
        self.quiet_until_ns = self.timers.earliest_ns();
    }
}

/// Puts the next instance of a vertex, which is ready and of a job, in line.
#[inline(always)]
pub(super) fn line_up(
    number: u32,
    vertex: &mut Vertex,
    job: &Job,
    ready: &mut ReadyLines,
    log: &mut EventLog,
) {
    vertex.job = job.number;
    make_ready(number, vertex, || job, ready, log);
}

/// Puts the instance that a vertex is to do next in line. It is of the job that `job` finds.
#[inline(always)]
pub(super) fn make_ready<'j>(
    number: u32,
    vertex: &mut Vertex,
    job: impl FnOnce() -> &'j Job,
    ready: &mut ReadyLines,
    log: &mut EventLog,
) {
    vertex.phase = InstancePhase::Ready;
    ready.insert(vertex, ready.key(number, vertex, job));
    // No driver hears of it: the short way leaves it to the driver to write it down.
    log.on_this(EventKind::Ready, log.now_ns, vertex.present_instance());
}
