//! Rules R1 and R4: when a job is released, and when it is complete.
//!
//! R1: a job is released, queued or skipped at or after its nominal release, and is not both
//! released and skipped. Sporadic jobs are due at least the minimum inter-arrival time T apart, and
//! never before the offset O. The number of jobs in flight never exceeds its maximum. Where times
//! are exact, a release is carried out at its nominal instant or, after queueing, when an older job
//! ends.
//!
//! R4: a job is complete with the last of its instances: all instances must be over, and the
//! completion belongs to the scheduler step in which the last instance ends, within the tolerance.
//! The same is true of a job that was aborted or cut by a fault. If its DAG was ended, instances
//! may be left. The next section says when a job is late.
//!
//! # R4: when a job is late
//!
//! A job has missed a deadline if and only if a sink has not finished by the sink's own deadline. A
//! core may finish in time while another core is just noticing the miss: this is a breach only
//! beyond the tolerance. Where times are exact, a miss is noticed at once: with several sinks,
//! right after the first deadline not met by its sink.
//!
//! No miss is demanded of a job that was aborted, cut by a fault, or cut short by the end of its
//! DAG.
//!
//! # R2 and R3: what an instance waits for, and what makes it ready
//!
//! The *conditions* of an instance are the finish of each predecessor in its job, the end of the
//! same subtask's instance in the precursor and, for a source, the release of its job.
//!
//! R2: an instance is neither ready nor started before all its conditions hold. As each instance
//! waits for the same subtask's previous instance, no two instances of one subtask overlap.
//!
//! R3: an instance becomes ready in the scheduler step that fulfils one of its conditions. With R2
//! this is the last condition, so all instances waiting for nothing but one finish are released in
//! one step. The rule leaves open which of two finishes is the last, for two cores may finish and
//! then take the scheduler's lock in the other order. And the instance does become ready, within
//! the tolerance, unless its job was cut or its DAG ended.

use alloc::vec::Vec;

use super::{DagHistory, InstanceLife, LifeJudge, StepTime};
use crate::ids::{DagId, Instance, SubtaskId};
use crate::journal::{Event, EventKind};
use crate::law::sweep::DispatchState;
use crate::law::{Violation, latest};
use crate::policy::OverrunPolicy;

/// The state of a job after the events so far.
#[derive(Default)]
pub(super) struct JobState {
    /// The nominal release; `None` for a sporadic job before its release.
    pub(super) release_ns: Option<u64>,
    /// Whether the release may be among the lost events.
    pub(super) is_partial: bool,
    pub(super) released: Option<StepTime>,
    pub(super) queued: Option<StepTime>,
    pub(super) skipped: Option<StepTime>,
    /// When the job was aborted, or cut by a fault.
    pub(super) cut: Option<StepTime>,
    pub(super) missed: Option<StepTime>,
    pub(super) completed: Option<StepTime>,
    /// By subtask, up to the last subtask with an event.
    pub(super) lives: Vec<Option<InstanceLife>>,
}

impl JobState {
    pub(super) fn partial(release_ns: Option<u64>) -> Self {
        Self {
            release_ns,
            is_partial: true,
            ..Self::default()
        }
    }

    /// Returns the life of an instance, as far as it is known.
    pub(super) fn life(&self, subtask: SubtaskId) -> Option<&InstanceLife> {
        self.lives.get(subtask.index())?.as_ref()
    }

    /// Returns the life of an instance; an unknown life begins at the given stage.
    pub(super) fn life_from(
        &mut self,
        subtask: SubtaskId,
        first: DispatchState,
    ) -> &mut InstanceLife {
        if self.lives.len() <= subtask.index() {
            self.lives.resize_with(subtask.index() + 1, || None);
        }
        self.lives[subtask.index()].get_or_insert_with(|| InstanceLife::new(first))
    }

    /// Records an event, and returns the breach if the same event has happened before.
    fn note(&mut self, event: &Event, moment: StepTime) -> Option<Violation> {
        let place = match event.what {
            EventKind::Released => &mut self.released,
            EventKind::Queued => &mut self.queued,
            EventKind::Skipped => &mut self.skipped,
            EventKind::Aborted => &mut self.cut,
            EventKind::Missed => &mut self.missed,
            _ => &mut self.completed,
        };
        let earlier = place.replace(moment)?;
        // The first event counts for later judgements: the second event is the breach.
        *place = Some(earlier);
        let (event, before, before_ns) = (*event, event.what, earlier.time_ns);
        Some(match before {
            EventKind::Released | EventKind::Queued | EventKind::Skipped => {
                Violation::ReleasedAgain {
                    event,
                    before,
                    before_ns,
                }
            }
            _ => Violation::EndedAgain {
                event,
                before,
                before_ns,
            },
        })
    }
}

impl DagHistory {
    /// Forgets the jobs before a complete job, as long as they are over themselves.
    fn forget_before(&mut self, job: u64) {
        while let Some(first) = self.jobs.first_entry()
            && *first.key() < job
            // Only from the front: the next job's instances may still ask for one in the middle.
            && first.get().completed.is_some()
        {
            self.forgotten = first.key() + 1;
            first.remove();
        }
        self.waiting.forget_before(job);
    }
}

impl LifeJudge<'_> {
    /// Judges the release, queueing or skipping of a job.
    pub(super) fn release(&mut self, event: &Event) {
        let event = *event;
        let Event { dag, job, .. } = event;
        let moment = self.moment(&event);
        let model = self.task_set.dag(dag);
        let is_released = event.what == EventKind::Released;
        let of_dag = self.dag(dag);
        let due_ns = of_dag.due.filter(|due| due.0 == job).map(|due| due.1);
        let release_ns = match model.is_sporadic() {
            true => due_ns,
            false => Some(model.grid_ns(job)),
        };
        let mut found = [None; 4];
        if let Some(known) = of_dag.jobs.get_mut(&job)
            && known.released.is_some()
        {
            let before_ns = known.released.map_or(0, |released| released.time_ns);
            let before = EventKind::Released;
            // Released twice, or queued or skipped after the release.
            found[0] = Some(Violation::ReleasedAgain {
                event,
                before,
                before_ns,
            });
            self.found.extend(found.into_iter().flatten());
            return;
        }
        // A job is first due, and in flight only after its release.
        let mut waiting = of_dag.waiting.take(job).unwrap_or_default();
        found[0] = waiting.note(&event, moment);
        if is_released && let Some(skipped) = waiting.skipped {
            let (before, before_ns) = (EventKind::Skipped, skipped.time_ns);
            found[1] = Some(Violation::ReleasedAgain {
                event,
                before,
                before_ns,
            });
        }
        // R1: each of these events is at the nominal release or later.
        found[2] = release_ns
            .filter(|release_ns| event.time_ns < *release_ns)
            .map(|release_ns| Violation::BeforeRelease { event, release_ns });
        if is_released {
            let was_queued = waiting.queued.is_some();
            found[3] = self.released_at_wrong_time(&event, release_ns, was_queued);
        }
        self.found.extend(found.into_iter().flatten());
        match is_released {
            true => self.open_job(&event, release_ns, waiting),
            false => self.dag(dag).waiting.put(job, &waiting),
        }
    }

    /// Returns the first breach by a release, other than an early release.
    fn released_at_wrong_time(
        &self,
        event: &Event,
        release_ns: Option<u64>,
        was_queued: bool,
    ) -> Option<Violation> {
        let event = *event;
        let Event { dag, job, .. } = event;
        let model = self.task_set.dag(dag);
        let of_dag = &self.dags[dag.index()];
        // The order of the checks decides which breach is reported: one release, one breach.
        if let Some((later, _)) = of_dag.latest.filter(|latest| latest.0 > job) {
            return Some(Violation::OutOfOrder { event, later });
        }
        if of_dag.is_off {
            return Some(Violation::WhileOff { event });
        }
        if of_dag.in_flight >= model.in_flight() {
            let in_flight = of_dag.in_flight;
            return Some(Violation::TooMany { event, in_flight });
        }
        let Some(release_ns) = release_ns else {
            // Where events are lost, the signal may be among them.
            return self.terms.is_whole.then_some(Violation::NotDue { event });
        };
        if model.is_sporadic() {
            // Between nominal releases, however late each was carried out.
            let before_ns = of_dag.latest.and_then(|(_, release_ns)| release_ns);
            let earliest_ns = before_ns.map_or(model.offset_ns(), |before_ns| {
                before_ns.saturating_add(model.period_ns())
            });
            if release_ns < earliest_ns {
                return Some(Violation::TooSoon {
                    dag,
                    job,
                    release_ns,
                    earliest_ns,
                });
            }
        }
        let expected_ns = match was_queued {
            // A queued job is released by the completion that makes room.
            true => of_dag.completed_ns,
            false => Some(release_ns),
        };
        // On a machine interrupts are late, so only virtual time is held to the nanosecond.
        let is_late = self.is_exact() && self.terms.is_whole && expected_ns != Some(event.time_ns);
        is_late.then_some(match expected_ns {
            Some(expected_ns) => Violation::Unpunctual { event, expected_ns },
            None => Violation::StillQueued { event },
        })
    }

    /// Puts a released job in flight.
    fn open_job(&mut self, event: &Event, release_ns: Option<u64>, mut begun: JobState) {
        let Event { dag, job, .. } = *event;
        let moment = self.moment(event);
        // Only a job skipped at its deadline misses at that very instant (rule 4 of `overrun`).
        // This job was released after all, so its miss came too early.
        let early = self.dag(dag).given_up.take_if(|missed| missed.job == job);
        if let (Some(event), Some(deadline_ns)) = (early, self.deadline_ns(dag, job)) {
            self.found
                .push(Violation::MissedEarly { event, deadline_ns });
        }
        // Judged when it was written; by now only the latest miss of its run is known.
        if let (Some(missed), Some(deadline_ns)) = (&mut begun.missed, self.deadline_ns(dag, job)) {
            missed.time_ns = deadline_ns + 1;
        }
        let of_dag = self.dag(dag);
        // Events of a partial job may have come before, such as a miss of its deadline.
        if let Some(partial) = of_dag.jobs.remove(&job) {
            begun.missed = begun.missed.or(partial.missed);
            begun.lives = partial.lives;
        }
        begun.released = Some(moment);
        begun.release_ns = release_ns;
        of_dag.jobs.insert(job, begun);
        of_dag.in_flight += 1;
        of_dag.latest = of_dag.latest.max(Some((job, release_ns)));
    }

    /// Judges a job's miss, abort or completion.
    pub(super) fn job(&mut self, event: &Event) {
        let Event { dag, job, .. } = *event;
        let moment = self.moment(event);
        let of_dag = self.dag(dag);
        // A job may miss its deadline while its release waits.
        if event.what == EventKind::Missed
            && let Some(mut waiting) = of_dag.waiting.take(job)
        {
            let again = waiting.note(event, moment);
            of_dag.waiting.put(job, &waiting);
            let wrong = again.or_else(|| self.missed_while_waiting(event));
            self.found.extend(wrong);
            return;
        }
        if !self.find_job(event) {
            return;
        }
        let Some(known) = self.dag(dag).jobs.get_mut(&job) else {
            return;
        };
        if let Some(again) = known.note(event, moment) {
            self.found.push(again);
            return;
        }
        // A deadline is judged when all is known: at the completion, or by a miss coming after it.
        let is_judged = event.what != EventKind::Aborted && known.completed.is_some();
        let was_counted = known.released.is_some();
        if event.what == EventKind::Completed {
            let wrong = self.completed_at_wrong_time(event, moment);
            self.found.extend(wrong);
            if let Some(Violation::BeforeItsEnd { awaited, .. }) = wrong {
                self.found.extend(self.never_ready(awaited));
            }
            let of_dag = self.dag(dag);
            of_dag.completed_ns = of_dag.completed_ns.max(Some(event.time_ns));
            of_dag.in_flight -= u32::from(was_counted);
        }
        if is_judged {
            self.found.extend(self.missed_wrongly(dag, job));
        }
        if event.what == EventKind::Completed {
            self.dag(dag).forget_before(job);
        }
    }

    /// Returns the first deadline of a job of a periodic DAG, in nanoseconds.
    fn deadline_ns(&self, dag: DagId, job: u64) -> Option<u64> {
        let model = self.task_set.dag(dag);
        let of_sinks = model.sinks().iter();
        let first_ns = of_sinks.map(|sink| model.subtask(*sink).relative_deadline_ns());
        let is_on_grid = !model.is_sporadic();
        (first_ns.min().filter(|_| is_on_grid)).map(|ns| model.grid_ns(job).saturating_add(ns))
    }

    /// R4 for a job that missed its deadline before its release.
    fn missed_while_waiting(&mut self, event: &Event) -> Option<Violation> {
        let event = *event;
        let deadline_ns = self.deadline_ns(event.dag, event.job)?;
        let may_be_given_up = self.task_set.dag(event.dag).overrun() == OverrunPolicy::Abort;
        if event.time_ns == deadline_ns && may_be_given_up {
            self.dag(event.dag).given_up = Some(event);
            return None;
        }
        if event.time_ns <= deadline_ns {
            return Some(Violation::MissedEarly { event, deadline_ns });
        }
        let is_late = self.is_exact() && event.time_ns > deadline_ns + 1;
        is_late.then_some(Violation::MissedLate { event, deadline_ns })
    }

    fn subtasks(&self, dag: DagId) -> u32 {
        crate::ids::to_u32(self.task_set.dag(dag).subtasks().len())
    }

    /// R4: a job is complete with its last instance, in the same step.
    fn completed_at_wrong_time(&self, event: &Event, completed: StepTime) -> Option<Violation> {
        let event = *event;
        let Event { dag, job, .. } = event;
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job)?;
        let mut last = completed;
        let mut last_ns = 0;
        let is_same_step = |moment: StepTime| moment.is_same_step(completed);
        let mut has_cause = known.cut.is_some_and(is_same_step);
        for subtask in (0..self.subtasks(dag)).map(SubtaskId) {
            let life = known.life(subtask);
            match life.and_then(InstanceLife::over) {
                Some(over) if over.time_ns <= completed.time_ns => {
                    // The completion has to follow the latest end.
                    if over.time_ns >= last_ns {
                        (last, last_ns) = (over, over.time_ns);
                    }
                    has_cause |= is_same_step(over);
                }
                // In an ended DAG, an instance may be taken away for good.
                _ if of_dag.is_ended => return None,
                // All events of the instance may be lost.
                None if known.is_partial && life.is_none() => return None,
                late => {
                    let awaited = Instance { dag, job, subtask };
                    let over_ns = late.map(|over| over.time_ns);
                    return Some(Violation::BeforeItsEnd {
                        event,
                        awaited,
                        over_ns,
                    });
                }
            }
        }
        if !has_cause {
            return Some(Violation::CompletedOutOfStep {
                event,
                last_ns,
                last_core: last.core,
            });
        }
        let is_late = !self.is_tolerable(last_ns, completed.time_ns);
        is_late.then_some(Violation::CompletedLate {
            event,
            since_ns: last_ns,
        })
    }

    /// R4 at the end of the journal, for an incomplete job.
    pub(super) fn never_completed(&self, dag: DagId, job: u64) -> Option<Violation> {
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job)?;
        if known.completed.is_some() || known.released.is_none() || of_dag.is_ended {
            return None;
        }
        let over_ns = |subtask| {
            let life = known.life(SubtaskId(subtask))?;
            Some(life.over()?.time_ns)
        };
        let end_ns = self.end_ns;
        // All instances are over, and the completion is overdue, if the latest end was long ago.
        let over_ns = latest((0..self.subtasks(dag)).map(over_ns))
            .filter(|over_ns| !self.is_tolerable(*over_ns, end_ns));
        let unfinished = Violation::Unfinished { dag, job, end_ns };
        match over_ns {
            Some(over_ns) => Some(Violation::NeverCompleted { dag, job, over_ns }),
            // A trace cut off early may end in the middle of a job.
            None => self.terms.is_complete.then_some(unfinished),
        }
    }
}

/// The absolute deadline of a sink, and its finish.
struct SinkDeadline {
    deadline_ns: u64,
    finish_ns: Option<u64>,
}

impl SinkDeadline {
    fn is_met(&self) -> bool {
        (self.finish_ns).is_some_and(|finish_ns| finish_ns <= self.deadline_ns)
    }
}

impl LifeJudge<'_> {
    /// Returns the deadlines of a job's sinks, or `None` if the job's release is not known.
    fn dues(&self, dag: DagId, known: &JobState) -> Option<Vec<SinkDeadline>> {
        let release_ns = known.release_ns?;
        let model = self.task_set.dag(dag);
        let due = |sink: &SubtaskId| SinkDeadline {
            deadline_ns: release_ns.saturating_add(model.subtask(*sink).relative_deadline_ns()),
            finish_ns: (known.life(*sink))
                .and_then(|life| life.finish)
                .map(|finish| finish.time_ns),
        };
        Some(model.sinks().iter().map(due).collect())
    }

    /// R4 for the deadlines of a job, judged by the events so far.
    fn missed_wrongly(&self, dag: DagId, job: u64) -> Option<Violation> {
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
            // A job cut before its deadline never counts as a miss (rule 4 of `overrun`).
            let is_cut = known.cut.is_some() || of_dag.is_ended;
            return (!may_be_lost && !is_cut).then_some(Violation::NotMissed {
                dag,
                job,
                finish_ns,
                deadline_ns: late.deadline_ns,
            });
        };
        // If a finish may be lost, nobody knows which of several sinks missed.
        if known.is_partial && dues.len() > 1 {
            return None;
        }
        let event = Event {
            time_ns: missed.time_ns,
            what: EventKind::Missed,
            core: missed.core,
            dag,
            job,
            subtask: None,
        };
        // Sinks that met their deadlines are candidates, too: the core may have finished while
        // another core was noticing the miss.
        let may_be_meant = |due: &&SinkDeadline| {
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
        // A job given up at its deadline misses at that very instant (rule 4 of `overrun`).
        let is_given_up = known.cut.is_some_and(|cut| cut.time_ns == missed.time_ns);
        if missed.time_ns + u64::from(is_given_up) <= deadline_ns {
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
        // The first instant after the deadline notices the miss.
        let is_late = self.is_exact() && missed.time_ns > deadline_ns + 1;
        is_late.then_some(Violation::MissedLate { event, deadline_ns })
    }

    /// Reports whether events following one of the deadlines may be lost: the job's miss, or an
    /// earlier abort.
    fn may_be_lost(&self, dues: &[SinkDeadline]) -> bool {
        let earliest_ns = dues.iter().map(|due| due.deadline_ns).min();
        !self.terms.is_whole && earliest_ns < self.first_ns
    }

    /// R4 at the end of the journal, for the deadlines of an incomplete job.
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
        let is_missing = has_passed && !of_dag.is_ended && !self.may_be_lost(&dues);
        is_missing.then_some(Violation::NeverMissed {
            dag,
            job,
            deadline_ns,
            end_ns: self.end_ns,
        })
    }
}

/// A condition of an instance.
struct InstanceCondition {
    /// The instance that must be over, or `None` for the release.
    awaited: Option<Instance>,
    /// When the condition was met, or `None` if not known.
    held: Option<StepTime>,
    /// Whether the condition may have been met without leaving an event.
    may_be_lost: bool,
}

impl LifeJudge<'_> {
    /// Judges the readiness of an instance, or its start without a readiness.
    pub(super) fn join(&mut self, event: &Event, instance: Instance, moment: StepTime) {
        let too_early = self.before_release(event, instance);
        self.found.extend(too_early);
        let too_early = self.before_join(event, instance);
        let is_early = too_early.is_some();
        self.found.extend(too_early);
        // One breach is reported once: consequences of a wrong readiness are no news.
        if is_early || event.what != EventKind::Ready {
            return;
        }
        let Some(last) = self.last_condition(instance) else {
            return;
        };
        let Some(held) = last.held else {
            return;
        };
        let mut conditions = self.conditions(instance);
        let is_same_step = |held: StepTime| held.is_same_step(moment);
        let has_cause = conditions.any(|condition| condition.held.is_some_and(is_same_step));
        drop(conditions);
        let (event, since_ns) = (*event, held.time_ns);
        if !has_cause {
            self.found.push(Violation::ReadyOutOfStep {
                event,
                last_ns: held.time_ns,
                last_core: held.core,
            });
        } else if !self.is_tolerable(since_ns, event.time_ns) {
            self.found.push(Violation::ReadyLate { event, since_ns });
        }
        if last.awaited.is_some() {
            let latency_ns = event.time_ns.saturating_sub(since_ns);
            self.finish_to_ready_max_ns = self.finish_to_ready_max_ns.max(latency_ns);
        }
    }

    fn conditions(&self, instance: Instance) -> impl Iterator<Item = InstanceCondition> {
        let Instance { dag, job, subtask } = instance;
        let predecessors = self.task_set.dag(dag).predecessors(subtask);
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job);
        let is_partial = known.is_none_or(|known| known.is_partial);
        let of_predecessors = predecessors.iter().map(move |&subtask| {
            let life = known.and_then(|known| known.life(subtask));
            InstanceCondition {
                awaited: Some(Instance { dag, job, subtask }),
                held: life.and_then(|life| life.finish),
                may_be_lost: life.is_none() && is_partial,
            }
        });
        // Not job - 1: a skipped job has no instances, so only released jobs count.
        let precursor = of_dag.jobs.range(..job).next_back();
        let of_precursor = precursor.map(|(&job, known)| {
            let life = known.life(subtask);
            InstanceCondition {
                awaited: Some(Instance { dag, job, subtask }),
                held: life.and_then(super::InstanceLife::over),
                may_be_lost: life.is_none() && (known.is_partial || of_dag.is_ended),
            }
        });
        let of_release = predecessors.is_empty().then(|| InstanceCondition {
            awaited: None,
            held: known.and_then(|known| known.released),
            may_be_lost: true,
        });
        of_predecessors.chain(of_precursor).chain(of_release)
    }

    /// Returns the condition met last, if all are met.
    fn last_condition(&self, instance: Instance) -> Option<InstanceCondition> {
        let mut last: Option<InstanceCondition> = None;
        // At equal times a finish comes after the release: the latency is measured from the finish.
        let rank = |condition: &InstanceCondition| {
            let time_ns = condition.held.map(|held| held.time_ns);
            (time_ns, condition.awaited.is_some())
        };
        for condition in self.conditions(instance) {
            condition.held?;
            if last
                .as_ref()
                .is_none_or(|last| rank(last) <= rank(&condition))
            {
                last = Some(condition);
            }
        }
        last
    }

    /// R1 for an instance: it neither becomes ready nor starts before its job's release.
    fn before_release(&self, event: &Event, instance: Instance) -> Option<Violation> {
        let event = *event;
        let job = self.dags[instance.dag.index()].jobs.get(&instance.job)?;
        if let Some(release_ns) = job.release_ns.filter(|&ns| event.time_ns < ns) {
            return Some(Violation::BeforeRelease { event, release_ns });
        }
        let released_ns = job.released?.time_ns;
        let is_early = event.time_ns < released_ns;
        is_early.then_some(Violation::BeforeReleased { event, released_ns })
    }

    /// R2: returns the first unmet condition as a breach.
    fn before_join(&self, event: &Event, instance: Instance) -> Option<Violation> {
        let mut early = self.conditions(instance).filter_map(|condition| {
            let awaited = condition.awaited?;
            let is_early = match condition.held {
                Some(held) => event.time_ns < held.time_ns,
                None => !condition.may_be_lost,
            };
            let over = condition.held.map(|held| (held.time_ns, held.core));
            is_early.then_some(Violation::BeforeJoin {
                event: *event,
                awaited,
                over,
            })
        });
        early.next()
    }

    /// R3 at the end of the journal: all conditions are met, and nothing happens.
    pub(super) fn never_ready(&self, instance: Instance) -> Option<Violation> {
        let of_dag = &self.dags[instance.dag.index()];
        let job = of_dag.jobs.get(&instance.job)?;
        let is_cut = job.cut.is_some() || of_dag.is_ended;
        if is_cut || job.life(instance.subtask).is_some() {
            return None;
        }
        let held = self.last_condition(instance)?.held?;
        let is_tolerable = self.is_tolerable(held.time_ns, self.end_ns);
        // After a run in which every job has ended, nothing is still to come, however recent the
        // last condition.
        (!is_tolerable || self.terms.is_complete).then_some(Violation::NeverReady {
            instance,
            since_ns: held.time_ns,
            core: held.core,
        })
    }
}
