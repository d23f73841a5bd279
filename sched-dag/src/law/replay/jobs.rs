//! Rules R1 and R4: when a job is released, and when it is complete.
//!
//! R1: a job is released, queued or skipped at or after its nominal release, and not
//! both released and skipped; sporadic ones are due at least T apart, and never before
//! O. No more jobs are in flight than may be. Where times are exact, a release is carried
//! out at the nominal instant or, if it was queued, when an older job ends.
//!
//! R4: a job is complete with the last of its instances, which must all be over, in the
//! scheduler's step that the last one brings about, within the tolerance. So is one that
//! was aborted, or cut short by its DAG's end. Whether it is late is the affair of
//! `deadlines`.

use alloc::vec::Vec;

use super::lives::Life;
use super::{Moment, OfDag, Replay};
use crate::ids::{DagId, Instance, SubtaskId};
use crate::journal::{Event, What};
use crate::law::sweep::Stage;
use crate::law::{Violation, latest};

/// What is known of a job.
#[derive(Default)]
pub(super) struct Job {
    /// The nominal release; `None` for a sporadic job until it is released.
    pub(super) release_ns: Option<u64>,
    /// Whether its release may be among the events that are lost.
    pub(super) is_partial: bool,
    pub(super) released: Option<Moment>,
    queued: Option<Moment>,
    skipped: Option<Moment>,
    /// When it was aborted, or a fault has cut it.
    pub(super) cut: Option<Moment>,
    pub(super) missed: Option<Moment>,
    pub(super) completed: Option<Moment>,
    /// By subtask, as far as there is one.
    lives: Vec<Option<Life>>,
}

impl Job {
    pub(super) fn partial(release_ns: Option<u64>) -> Self {
        Self {
            release_ns,
            is_partial: true,
            ..Self::default()
        }
    }

    /// Returns what is known of an instance.
    pub(super) fn life(&self, subtask: SubtaskId) -> Option<&Life> {
        self.lives.get(subtask.index())?.as_ref()
    }

    /// Returns what is known of an instance, whose life begins at a stage if nothing is.
    pub(super) fn life_from(&mut self, subtask: SubtaskId, first: Stage) -> &mut Life {
        if self.lives.len() <= subtask.index() {
            self.lives.resize_with(subtask.index() + 1, || None);
        }
        self.lives[subtask.index()].get_or_insert_with(|| Life::new(first))
    }

    /// Takes note of an event; that it happens twice is a breach.
    fn note(&mut self, event: &Event, moment: Moment) -> Option<Violation> {
        let place = match event.what {
            What::Released => &mut self.released,
            What::Queued => &mut self.queued,
            What::Skipped => &mut self.skipped,
            What::Aborted => &mut self.cut,
            What::Missed => &mut self.missed,
            _ => &mut self.completed,
        };
        let earlier = place.replace(moment)?;
        *place = Some(earlier);
        let (event, before, before_ns) = (*event, event.what, earlier.time_ns);
        Some(match before {
            What::Released | What::Queued | What::Skipped => Violation::ReleasedAgain {
                event,
                before,
                before_ns,
            },
            _ => Violation::EndedAgain {
                event,
                before,
                before_ns,
            },
        })
    }
}

impl OfDag {
    /// Forgets the jobs before a complete one that are over.
    fn forget_before(&mut self, job: u64) {
        while let Some(first) = self.jobs.first_entry()
            && *first.key() < job
            && first.get().completed.is_some()
        {
            self.forgotten = first.key() + 1;
            first.remove();
        }
        while let Some(first) = self.waiting.first_entry()
            && *first.key() < job
            && first.get().skipped.is_some()
        {
            first.remove();
        }
    }
}

impl Replay<'_> {
    /// Takes what happens to a job that is due.
    pub(super) fn release(&mut self, event: &Event) {
        let event = *event;
        let Event { dag, job, .. } = event;
        let moment = self.moment(&event);
        let model = self.task_set.dag(dag);
        let is_released = event.what == What::Released;
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
            let before = What::Released;
            // Twice, or queued or skipped after all.
            found[0] = Some(Violation::ReleasedAgain {
                event,
                before,
                before_ns,
            });
            self.found.extend(found.into_iter().flatten());
            return;
        }
        let waiting = of_dag.waiting.entry(job).or_default();
        waiting.release_ns = release_ns;
        found[0] = waiting.note(&event, moment);
        if is_released && let Some(skipped) = waiting.skipped {
            let (before, before_ns) = (What::Skipped, skipped.time_ns);
            found[1] = Some(Violation::ReleasedAgain {
                event,
                before,
                before_ns,
            });
        }
        found[2] = release_ns
            .filter(|release_ns| event.time_ns < *release_ns)
            .map(|release_ns| Violation::BeforeRelease { event, release_ns });
        if is_released {
            found[3] = self.released_at_wrong_time(&event, release_ns);
        }
        self.found.extend(found.into_iter().flatten());
        if is_released {
            self.begin(&event, release_ns);
        }
    }

    /// The first thing that is wrong with a release but that it is early.
    fn released_at_wrong_time(&self, event: &Event, release_ns: Option<u64>) -> Option<Violation> {
        let event = *event;
        let Event { dag, job, .. } = event;
        let model = self.task_set.dag(dag);
        let of_dag = &self.dags[dag.index()];
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
            return self.terms.is_whole.then_some(Violation::NotDue { event });
        };
        if model.is_sporadic() {
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
        let was_queued = of_dag.waiting.get(&job)?.queued.is_some();
        let expected_ns = match was_queued {
            true => of_dag.completed_ns,
            false => Some(release_ns),
        };
        let is_late = self.is_exact() && self.terms.is_whole && expected_ns != Some(event.time_ns);
        is_late.then_some(match expected_ns {
            Some(expected_ns) => Violation::Unpunctual { event, expected_ns },
            None => Violation::StillQueued { event },
        })
    }

    /// From now on the job is in flight.
    fn begin(&mut self, event: &Event, release_ns: Option<u64>) {
        let Event { dag, job, .. } = *event;
        let moment = self.moment(event);
        let of_dag = self.dag(dag);
        let mut begun = of_dag.waiting.remove(&job).unwrap_or_default();
        // Something of a partial one may have happened, such as its deadline's passing.
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

    /// Takes what happens to a job later.
    pub(super) fn job(&mut self, event: &Event) {
        let Event { dag, job, .. } = *event;
        let moment = self.moment(event);
        let of_dag = self.dag(dag);
        // A job may miss its deadline while its release waits.
        if event.what == What::Missed
            && let Some(waiting) = of_dag.waiting.get_mut(&job)
        {
            let again = waiting.note(event, moment);
            self.found.extend(again);
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
        let is_judged = event.what != What::Aborted && known.completed.is_some();
        let was_counted = known.released.is_some();
        if event.what == What::Completed {
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
        if event.what == What::Completed {
            self.dag(dag).forget_before(job);
        }
    }

    fn subtasks(&self, dag: DagId) -> u32 {
        crate::ids::to_u32(self.task_set.dag(dag).subtasks().len())
    }

    /// R4: complete with the last instance, in its step.
    fn completed_at_wrong_time(&self, event: &Event, completed: Moment) -> Option<Violation> {
        let event = *event;
        let Event { dag, job, .. } = event;
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job)?;
        let mut last = completed;
        let mut last_ns = 0;
        let is_same_step = |moment: Moment| moment.is_same_step(completed);
        let mut has_cause = known.cut.is_some_and(is_same_step);
        for subtask in (0..self.subtasks(dag)).map(SubtaskId) {
            let life = known.life(subtask);
            match life.and_then(Life::over) {
                Some(over) if over.time_ns <= completed.time_ns => {
                    if over.time_ns >= last_ns {
                        (last, last_ns) = (over, over.time_ns);
                    }
                    has_cause |= is_same_step(over);
                }
                // Of an ended DAG, an instance may be taken away for good.
                _ if of_dag.is_stopped => return None,
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

    /// R4 at the end, for a job that is not complete.
    pub(super) fn never_completed(&self, dag: DagId, job: u64) -> Option<Violation> {
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job)?;
        if known.completed.is_some() || known.released.is_none() || of_dag.is_stopped {
            return None;
        }
        let over_ns = |subtask| {
            let life = known.life(SubtaskId(subtask))?;
            Some(life.over()?.time_ns)
        };
        let end_ns = self.end_ns;
        let over_ns = latest((0..self.subtasks(dag)).map(over_ns))
            .filter(|over_ns| !self.is_tolerable(*over_ns, end_ns));
        let unfinished = Violation::Unfinished { dag, job, end_ns };
        match over_ns {
            Some(over_ns) => Some(Violation::NeverCompleted { dag, job, over_ns }),
            None => self.terms.is_complete.then_some(unfinished),
        }
    }
}
