//! The life of an instance: ready, started, ended.
//!
//! An instance ends by finishing, by a fault or, in a job that is aborted or
//! whose DAG is ended, by being cancelled. In all cases all its outgoing edges
//! are released at that instant (R3), so such a job ends by the same rules as
//! any other, only without running.

use super::{DagState, Key, Scheduler, key_of};
use crate::ids::{CoreId, DagId, Instance, SubtaskId};
use crate::scheduler::{JobOutcome, Observer};

/// What the next instance of a subtask does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// It is not ready.
    Absent,
    /// It is ready and has not started.
    Ready,
    /// It executes.
    Running(CoreId),
    /// It has started and lost its core.
    Preempted,
}

impl Scheduler {
    /// Ends an instance that has started.
    pub(super) fn finish(&mut self, instance: Instance, observer: &mut impl Observer) {
        self.take_off(instance, "is completed");
        self.ending.push(instance.subtask);
        self.spread_ends(instance.dag, observer);
    }

    /// Takes a started instance from its core, or out of line if it has none.
    /// `event` says what the driver claims, if the instance has not started.
    pub(super) fn take_off(&mut self, instance: Instance, event: &str) {
        let Instance { dag, job, subtask } = instance;
        let state = &self.dags[dag.index()];
        let sequence = state.joins.progress(subtask);
        let index = self.subtask_index(dag, subtask);
        let in_flight = sequence < state.jobs.next && state.jobs.job(sequence).number == job;
        match self.phases[index] {
            Phase::Running(core) if in_flight => self.cores.free(core),
            Phase::Preempted if in_flight => self.ready.remove(index),
            _ => panic!("{instance} {event} and has not started; complete each once, or fail it"),
        }
        self.phases[index] = Phase::Absent;
    }

    /// Releases a source in the job with a sequence number.
    pub(super) fn release_source(
        &mut self,
        dag: DagId,
        sequence: u64,
        source: SubtaskId,
        observer: &mut impl Observer,
    ) {
        if self.dags[dag.index()].joins.release(sequence, source) {
            let job = self.dags[dag.index()].jobs.job(sequence);
            let instance = Instance {
                dag,
                job: job.number,
                subtask: source,
            };
            let model = self.task_set.dag(dag);
            let key = key_of(self.options.policy, model, instance, job.release_ns);
            let index = self.subtask_index(dag, source);
            self.phases[index] = Phase::Ready;
            self.ready.set(index, key);
            observer.ready(instance);
        }
    }

    /// Cancels all instances of an aborted job that are ready and have not
    /// started, and all that thereby would become ready.
    pub(super) fn cancel_ready(&mut self, dag: DagId, sequence: u64, observer: &mut impl Observer) {
        let model = self.task_set.dag(dag);
        let state = &self.dags[dag.index()];
        let job = state.jobs.job(sequence).number;
        for &subtask in model.topological_order() {
            let index = state.first_subtask + subtask.index();
            if self.phases[index] == Phase::Ready && state.joins.progress(subtask) == sequence {
                self.phases[index] = Phase::Absent;
                self.ready.remove(index);
                observer.cancelled(Instance { dag, job, subtask });
                self.ending.push(subtask);
            }
        }
        self.spread_ends(dag, observer);
    }

    /// Tells the successors of all instances in `ending` that these have ended,
    /// and ends jobs of which no instance is left.
    ///
    /// A subtask is in `ending` at most once at a time: its next instance can
    /// only be ready when this one has been taken out. So each round of the
    /// loop ends another instance in flight.
    pub(super) fn spread_ends(&mut self, dag: DagId, observer: &mut impl Observer) {
        while let Some(subtask) = self.ending.pop() {
            let Self {
                task_set,
                options,
                dags,
                phases,
                ready,
                ending,
                ..
            } = self;
            let model = task_set.dag(dag);
            let DagState {
                first_subtask,
                jobs,
                joins,
                ..
            } = &mut dags[dag.index()];
            let sequence = joins.end(model, subtask, jobs.next, |joins, next| {
                let sequence = joins.progress(next);
                let job = jobs.job(sequence);
                let instance = Instance {
                    dag,
                    job: job.number,
                    subtask: next,
                };
                if jobs.is_cut(sequence) {
                    observer.cancelled(instance);
                    ending.push(next);
                } else {
                    let index = *first_subtask + next.index();
                    let key: Key = key_of(options.policy, model, instance, job.release_ns);
                    phases[index] = Phase::Ready;
                    ready.set(index, key);
                    observer.ready(instance);
                }
            });
            let job = jobs.job_mut(sequence);
            job.unfinished -= 1;
            if job.unfinished == 0 {
                self.end_job(dag, sequence, observer);
            }
        }
    }

    /// Ends the oldest job of a DAG, all of whose instances have ended (R4).
    fn end_job(&mut self, dag: DagId, sequence: u64, observer: &mut impl Observer) {
        self.judge(dag, observer);
        let state = &mut self.dags[dag.index()];
        debug_assert_eq!(sequence, state.jobs.oldest, "jobs end in their order");
        let job = *state.jobs.job(sequence);
        let outcome = if state.jobs.is_aborted(sequence) {
            JobOutcome::Aborted
        } else if state.jobs.is_ended() {
            JobOutcome::DagEnded
        } else if job.missed {
            state.statistics.completed += 1;
            JobOutcome::Missed
        } else {
            state.statistics.completed += 1;
            state.statistics.count_met();
            JobOutcome::Met
        };
        state.jobs.end_oldest();
        observer.job_completed(dag, job.number, outcome);
        self.set_timer(dag);
    }

    /// Notices all deadlines of a DAG that have passed.
    pub(super) fn judge(&mut self, dag: DagId, observer: &mut impl Observer) {
        let model = self.task_set.dag(dag);
        let state = &mut self.dags[dag.index()];
        while let Some((job, deadline_ns)) = state.jobs.take_late(model, self.now_ns) {
            state.statistics.count_miss();
            observer.deadline_missed(dag, job, deadline_ns);
        }
    }

    /// Notes when something happens next to a DAG without a completion.
    pub(super) fn set_timer(&mut self, dag: DagId) {
        let model = self.task_set.dag(dag);
        match self.dags[dag.index()]
            .jobs
            .next_event_ns(model, self.now_ns)
        {
            Some(event_ns) => self.timers.set(dag.index(), event_ns),
            None => self.timers.remove(dag.index()),
        }
    }
}
