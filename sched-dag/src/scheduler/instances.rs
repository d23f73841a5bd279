//! The life of an instance: ready, started, ended.
//!
//! An instance ends by finishing, by a fault, or by being cancelled in a cut job (aborted, at
//! fault, or of an ended DAG). In all cases all its outgoing edges are released at that instant
//! (R3), so a cut job ends by the same rules as any other job, only without running.

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

    /// Takes a started instance from its core, or out of line if it has no core, and returns its
    /// vertex. If the instance has not started, `event` names the driver's claim in the panic
    /// message.
    #[inline]
    pub(super) fn take_off(&mut self, instance: Instance, event: &str) -> u32 {
        let number = self.vertex(instance).0;
        let vertex = self.vertices.get(number);
        let jobs = &self.dags[instance.dag.index()].jobs;
        // A driver may name an instance of another job of the vertex, or an instance that has
        // ended. The driver's mistake must not end the wrong instance.
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
            // The scheduler had decided to preempt the instance, but it finished before the machine
            // took the core away.
            InstancePhase::Preempted if in_flight => {
                // No vertex keeps its key. Keys are absolute, so computing the key again gives the
                // key used for putting the instance in line.
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
            // A source may still do the job before (R2); then the end of that instance puts this
            // one in line.
            if let Some(vertex) = vertices.arrive(number, sequence) {
                line_up(number, vertex, job, ready, log);
                *fresh += 1;
            }
        }
    }

    /// Cancels the instances of a DAG that wait, or are ready and have not started, in the job with
    /// a sequence number (in all jobs if that is `u64::MAX`), and all instances that would become
    /// ready as a consequence.
    #[inline]
    pub(super) fn cancel_ready(&mut self, dag: DagId, sequence: u64) {
        self.cancel_waits(dag, sequence);
        self.touch_lists();
        let state = &self.dags[dag.index()];
        // In topological order each vertex comes after its predecessors, so none becomes ready
        // behind the loop's back.
        for &subtask in self.task_set.dag(dag).topological_order() {
            let number = self.task_set.first_vertex(dag) + subtask.0;
            let vertex = self.vertices.get_mut(number);
            // From now on an end has to check whether its job is cut; the short way does not.
            vertex.ends = EndKind::Any;
            let is_meant = sequence == u64::MAX || vertex.progress == sequence;
            if vertex.phase == InstancePhase::Ready && is_meant {
                let job = state.jobs.job(vertex.progress);
                let key = self.ready.key(number, vertex, || job);
                self.ready.remove(vertex, key);
                self.log
                    .of_instance(EventKind::Cancelled, vertex.instance(job));
                vertex.phase = InstancePhase::Absent;
                // Ended below, not here: an end makes further instances ready, and the loop must
                // not meet them half-way.
                self.ending.push(number);
            }
        }
        self.end_all();
    }

    /// Ends a vertex's present instance, and all instances cancelled as a consequence.
    #[inline]
    pub(super) fn end_instance(&mut self, vertex: u32) {
        self.end_one(vertex);
        if !self.ending.is_empty() {
            // The vertex's next instance may be among the cancelled, and would then hide that this
            // one was late.
            if self.log.now_ns >= self.quiet_until_ns {
                self.judge_ended(vertex);
            }
            self.end_all();
        }
    }

    /// Ends all instances in `ending`.
    ///
    /// A vertex is in `ending` at most once at a time, because its next instance can only be ready
    /// after the present instance has been taken out. So each round of the loop ends another
    /// instance in flight.
    #[inline]
    pub(super) fn end_all(&mut self) {
        // An explicit stack, not recursion: a chain may be 100,000 subtasks long.
        while let Some(vertex) = self.ending.pop() {
            self.end_one(vertex);
        }
    }

    /// Ends a vertex's present instance: tells its successors, and ends the job after the job's
    /// last instance.
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
        // Only instances without successors count: every other instance ends before one of these.
        job.unfinished -= u32::from(successors.is_empty());
        let is_last = job.unfinished == 0;
        for place in successors {
            let next = vertices.successor(place);
            if let Some(successor) = vertices.arrive(next, sequence) {
                // R3 holds in a cut job, too: edges are released, but the successors are cancelled
                // instead of put in line.
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

    /// Lets a vertex whose instance has ended go on with the next job in flight, if the next
    /// instance waits for nothing else.
    #[inline]
    fn go_on_to_next_job(&mut self, number: u32) {
        if let Some(vertex) = self.vertices.next_is_ready(number) {
            let jobs = &self.dags[vertex.dag.index()].jobs;
            let job = jobs.job(vertex.progress);
            // The job was cut while this instance still waited for its turn: now that the instance
            // would become ready, it is cancelled.
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

    /// Ends the oldest job of a DAG: all its instances have ended, that of vertex `last` at this
    /// instant (R4).
    #[inline]
    fn end_job(&mut self, dag: DagId, sequence: u64, last: u32) {
        // Before `quiet_until_ns` no deadline has passed.
        if self.log.now_ns >= self.quiet_until_ns {
            self.judge(dag, Some(last));
        }
        let state = &mut self.dags[dag.index()];
        debug_assert_eq!(sequence, state.jobs.oldest, "jobs end in their order");
        let job = *state.jobs.job(sequence);
        // The end of a cut job makes the short way possible again, unless the DAG is ended for
        // good.
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

    /// Sets the timer of a DAG to its next event that needs no completion.
    #[inline]
    pub(super) fn set_timer(&mut self, dag: DagId) {
        let model = self.task_set.dag(dag);
        let jobs = &self.dags[dag.index()].jobs;
        self.set_timer_to(dag, jobs.next_event(model, self.log.now_ns));
    }

    /// Sets the timer of a DAG to this event.
    #[inline(always)]
    pub(super) fn set_timer_to(&mut self, dag: DagId, event: Option<(u64, TimerKind)>) {
        self.timers.set_dag(dag.index(), event);
        self.quiet_until_ns = self.timers.earliest_ns();
    }
}

/// Puts a vertex's next instance, which is ready and belongs to the given job, in line.
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

/// Makes a vertex's next instance ready and puts it in line. The closure `job` finds the instance's
/// job.
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
    // Never a notice for the driver: on the short way the driver itself records this event.
    log.on_this(EventKind::Ready, log.now_ns, vertex.present_instance());
}
