//! Replaying a journal: R1 to R4, one life of each instance, one instance on each core.
//!
//! The events are taken in their order, in which each comes after all that it follows
//! from, and held against what is known by then: so what is not there yet has not
//! happened, whatever its time says. Jobs are forgotten once they are complete and
//! nothing waits for them any more, and of those that are due and wait only runs are kept
//! ([`backlog`]), so the memory that it takes is that of the jobs in flight.
//!
//! Words. A *step* of the scheduler is known by the core that made it and by that core's
//! last machine event before it: between two machine events of a core, a completion's
//! step cannot begin. A *moment* is when and in which step something happened. A job's
//! *precursor* is the job of the same DAG that was released before it.
//!
//! If the oldest events are lost, a job is *partial* if its release may be among them:
//! of what is not there of it, nothing can be concluded. All other jobs are judged as in
//! a whole journal.
//!
//! # One life of each instance, and one instance on each core
//!
//! *One life*: an instance becomes ready once, starts once and only when ready, is
//! suspended only where it runs, resumed only when suspended, and finishes once, where it
//! runs. That also says that it is on one core at a time. It is cancelled only if its job
//! was cut, and each of this is no earlier than what comes before it.
//!
//! *One core*: what is left over from one instance is a core's *occupant*: it must be
//! gone before the next one starts or is resumed.
//!
//! If its job is partial, an instance's first event tells what it must have been before.

mod backlog;
mod jobs;

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::sweep::DispatchState;
use super::{JudgeOptions, Violation};
use crate::ids::{CoreId, DagId, Instance, SubtaskId};
use crate::journal::{Event, EventKind};
use crate::policy::OnFault;
use crate::spec::Wait;
use crate::task_set::TaskSet;
use backlog::Backlog;
use jobs::JobState;

/// The findings about R1 to R4, lives of DAGs and cores in a journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReplayVerdict {
    /// Every breach, in the order in which they were found.
    pub violations: Vec<Violation>,
    /// The longest time from a finish that an instance waited for last to its
    /// readiness.
    pub finish_to_ready_max_ns: u64,
}

/// Holds a journal against the rules R1 to R4, and each instance and each core against
/// what no machine may do.
///
/// Which instance should have run is judged by
/// [`dispatch_violations`](super::dispatch_violations).
#[must_use]
pub fn judge(
    task_set: &TaskSet,
    terms: JudgeOptions,
    events: impl IntoIterator<Item = Event>,
) -> ReplayVerdict {
    let mut replay = JournalReplay {
        task_set,
        terms,
        dags: task_set
            .dags()
            .iter()
            .map(|_| DagReplay::default())
            .collect(),
        cores: Vec::new(),
        first_ns: None,
        end_ns: 0,
        found: Vec::new(),
        finish_to_ready_max_ns: 0,
    };
    for event in events {
        replay.judge_event(&event);
    }
    replay.finish();
    ReplayVerdict {
        violations: replay.found,
        finish_to_ready_max_ns: replay.finish_to_ready_max_ns,
    }
}

/// Returns the breaches that [`judge`] finds.
#[must_use]
pub fn violations(
    task_set: &TaskSet,
    terms: JudgeOptions,
    events: impl IntoIterator<Item = Event>,
) -> Vec<Violation> {
    judge(task_set, terms, events).violations
}

struct JournalReplay<'a> {
    task_set: &'a TaskSet,
    terms: JudgeOptions,
    dags: Vec<DagReplay>,
    cores: Vec<CoreReplay>,
    /// The time at which the first event was written.
    first_ns: Option<u64>,
    /// The latest time so far.
    end_ns: u64,
    found: Vec<Violation>,
    finish_to_ready_max_ns: u64,
}

#[derive(Default)]
struct DagReplay {
    /// The jobs that are released, or partial, and not forgotten.
    jobs: BTreeMap<u64, JobState>,
    /// The jobs that are due and not released.
    waiting: Backlog,
    /// The latest waiting job that missed its deadline at that instant, and is to be skipped.
    given_up: Option<Event>,
    /// How many jobs were released and are not complete.
    in_flight: u32,
    /// All jobs before this one are forgotten or not complete.
    forgotten: u64,
    /// The sporadic job that is being released, and when it was due.
    due: Option<(u64, u64)>,
    /// The job that was released last, and its nominal release.
    latest: Option<(u64, Option<u64>)>,
    /// When a job was complete last.
    completed_ns: Option<u64>,
    is_ended: bool,
    /// Whether it is paused or closed, and so releases nothing.
    is_off: bool,
    /// The jobs of the faults after which it went on.
    faults: Vec<u64>,
}

#[derive(Clone, Default)]
struct CoreReplay {
    /// Counts its machine events.
    step: u64,
    /// The instance that it runs.
    occupant: Option<Instance>,
}

/// When and in which step of the scheduler something happened.
#[derive(Clone, Copy)]
struct StepTime {
    time_ns: u64,
    core: CoreId,
    step: u64,
}

impl StepTime {
    fn is_same_step(self, other: Self) -> bool {
        (self.core, self.step) == (other.core, other.step)
    }
}

impl JournalReplay<'_> {
    fn judge_event(&mut self, event: &Event) {
        // The time of these may be before that of events that are lost.
        if !matches!(event.what, EventKind::Finish | EventKind::Due) {
            self.first_ns.get_or_insert(event.time_ns);
        }
        self.end_ns = self.end_ns.max(event.time_ns);
        match event.what {
            EventKind::Due => self.dag(event.dag).due = Some((event.job, event.time_ns)),
            EventKind::DagEnded => self.dag(event.dag).is_ended = true,
            EventKind::Off | EventKind::Closed => self.dag(event.dag).is_off = true,
            EventKind::On => self.dag(event.dag).is_off = false,
            EventKind::Signalled | EventKind::Dropped | EventKind::Request | EventKind::Entered => {
            }
            EventKind::Released | EventKind::Queued | EventKind::Skipped => self.release(event),
            EventKind::Aborted | EventKind::Missed | EventKind::Completed => self.job(event),
            _ => self.instance(event),
        }
    }

    fn dag(&mut self, dag: DagId) -> &mut DagReplay {
        &mut self.dags[dag.index()]
    }

    fn core(&mut self, core: CoreId) -> &mut CoreReplay {
        if self.cores.len() <= core.index() {
            self.cores.resize(core.index() + 1, CoreReplay::default());
        }
        &mut self.cores[core.index()]
    }

    fn moment(&mut self, event: &Event) -> StepTime {
        StepTime {
            time_ns: event.time_ns,
            core: event.core,
            step: self.core(event.core).step,
        }
    }

    /// Reports whether something may last so long.
    const fn is_tolerable(&self, from_ns: u64, to_ns: u64) -> bool {
        to_ns <= from_ns.saturating_add(self.terms.tolerance_ns)
    }

    /// Reports whether the times are those at which the model lets things happen.
    const fn is_exact(&self) -> bool {
        self.terms.tolerance_ns == 0
    }

    /// Finds the job of an event; takes it for a partial one if it may be. That it can
    /// be neither is a breach.
    fn find_job(&mut self, event: &Event) -> bool {
        let Event { dag, job, .. } = *event;
        let model = self.task_set.dag(dag);
        let release_ns = (!model.is_sporadic()).then(|| model.grid_ns(job));
        let is_old = self.first_ns.is_none() || release_ns <= self.first_ns;
        let may_be_lost = !self.terms.is_whole && is_old;
        let of_dag = self.dag(dag);
        if of_dag.jobs.contains_key(&job) {
            return true;
        }
        let is_over = job < of_dag.forgotten;
        let is_partial = may_be_lost && !is_over && !of_dag.waiting.contains(job);
        // In both cases nothing is concluded from what is not there of it.
        of_dag.jobs.insert(job, JobState::partial(release_ns));
        if !is_partial {
            let event = *event;
            self.found.push(match is_over {
                true => Violation::Forgotten { event },
                false => Violation::NotReleased { event },
            });
        }
        is_partial
    }

    fn finish(&mut self) {
        for dag in (0..).map(DagId).take(self.dags.len()) {
            let jobs: Vec<u64> = self.dag(dag).jobs.keys().copied().collect();
            for job in jobs {
                self.found.extend(self.never_completed(dag, job));
                self.found.extend(self.never_missed(dag, job));
                for subtask in (0..).take(self.task_set.dag(dag).subtasks().len()) {
                    let subtask = SubtaskId(subtask);
                    let instance = Instance { dag, job, subtask };
                    self.found.extend(self.never_ready(instance));
                }
            }
        }
    }
}

/// The state of an instance as the events so far tell it.
#[derive(Default)]
struct InstanceLife {
    stage: DispatchState,
    /// Its latest event, and when that was.
    last: Option<(EventKind, u64)>,
    ready: Option<StepTime>,
    finish: Option<StepTime>,
    /// When it was cancelled, or ended by a fault.
    dropped: Option<StepTime>,
    /// How many waits it has begun, and when the latest one.
    waits: (usize, u64),
}

impl InstanceLife {
    fn new(stage: DispatchState) -> Self {
        Self {
            stage,
            ..Self::default()
        }
    }

    /// Takes note of a wait, or of the finish, and says what is wrong with the waits: W1 and W2.
    fn wait(&mut self, event: &Event, stated: &[Wait], terms: JudgeOptions) -> Option<Violation> {
        let (event, (waits, since_ns)) = (*event, self.waits);
        let other = Violation::OtherWaits {
            event,
            waits,
            stated: stated.len(),
        };
        match event.what {
            EventKind::Wait => {
                self.waits = (waits + 1, event.time_ns);
                (waits == stated.len()).then_some(other)
            }
            EventKind::Finish => (waits < stated.len()).then_some(other),
            EventKind::Wake => {
                let limit_ns = stated.get(waits.checked_sub(1)?)?.limit_ns;
                let latest_ns = since_ns.saturating_add(limit_ns);
                let owed_ns = terms.tolerance_ns.saturating_add(terms.late_ns);
                let is_late = event.time_ns > latest_ns.saturating_add(owed_ns);
                is_late.then_some(Violation::WaitBeyondLimit {
                    event,
                    since_ns,
                    limit_ns,
                })
            }
            _ => None,
        }
    }

    /// Returns when the instance was over: finished, cancelled or ended.
    fn over(&self) -> Option<StepTime> {
        self.finish.or(self.dropped)
    }

    /// Takes note of an event, whether it is allowed or not, and says what is wrong.
    fn note(&mut self, event: &Event, moment: StepTime) -> Option<Violation> {
        let (stage, last) = (self.stage, self.last);
        // Also after a breach: else one slip would make each later event a breach of its own.
        self.stage = stage_after(event);
        self.last = Some((event.what, event.time_ns));
        let place = match event.what {
            EventKind::Ready => Some(&mut self.ready),
            EventKind::Finish => Some(&mut self.finish),
            EventKind::Cancelled | EventKind::Ended => Some(&mut self.dropped),
            _ => None,
        };
        if let Some(place) = place {
            place.get_or_insert(moment);
        }
        let event = *event;
        let was_ended = last.is_some_and(|(what, _)| what == EventKind::Ended);
        let is_answer = was_ended && event.what == EventKind::Restarted;
        if !is_answer && !is_allowed(stage, &event) {
            return Some(Violation::OutOfTurn { event, stage });
        }
        let (before, before_ns) = last.filter(|last| event.time_ns < last.1)?;
        Some(Violation::Backwards {
            event,
            before,
            before_ns,
        })
    }
}

fn is_allowed(stage: DispatchState, event: &Event) -> bool {
    match (stage, event.what) {
        (DispatchState::Absent, EventKind::Ready | EventKind::Cancelled)
        | (DispatchState::Ready, EventKind::Start | EventKind::Cancelled)
        | (DispatchState::Suspended, EventKind::Resume)
        | (DispatchState::Waiting, EventKind::Wake | EventKind::Cancelled)
        // Whichever core finds the fault, or ends the DAG, ends the instance.
        | (DispatchState::Running(_) | DispatchState::Suspended, EventKind::Ended) => true,
        (
            DispatchState::Running(core),
            EventKind::Suspend | EventKind::Finish | EventKind::Wait,
        ) => core == event.core,
        _ => false,
    }
}

/// Returns the state of an instance after an event.
pub(super) const fn stage_after(event: &Event) -> DispatchState {
    match event.what {
        EventKind::Ready => DispatchState::Ready,
        EventKind::Start | EventKind::Resume => DispatchState::Running(event.core),
        EventKind::Suspend | EventKind::Wake => DispatchState::Suspended,
        EventKind::Wait => DispatchState::Waiting,
        _ => DispatchState::Over,
    }
}

/// Returns the state that an instance must have had before its first known event.
pub(super) const fn stage_before(event: &Event) -> DispatchState {
    match event.what {
        EventKind::Start => DispatchState::Ready,
        EventKind::Resume => DispatchState::Suspended,
        EventKind::Wake => DispatchState::Waiting,
        EventKind::Suspend | EventKind::Wait | EventKind::Finish | EventKind::Ended => {
            DispatchState::Running(event.core)
        }
        _ => DispatchState::Absent,
    }
}

impl JournalReplay<'_> {
    /// Takes what happens to an instance.
    fn instance(&mut self, event: &Event) {
        let Some(instance) = event.instance() else {
            return;
        };
        self.occupy(event, instance);
        let moment = self.moment(event);
        let is_known = self.find_job(event);
        let ends_its_dag = self.task_set.dag(instance.dag).on_fault() == OnFault::EndDag;
        let (task_set, terms) = (self.task_set, self.terms);
        let of_dag = self.dag(instance.dag);
        of_dag.is_ended |= event.what == EventKind::Ended && ends_its_dag;
        let is_ended = of_dag.is_ended;
        let Some(job) = of_dag.jobs.get_mut(&instance.job).filter(|_| is_known) else {
            return;
        };
        let first = match job.is_partial {
            true => stage_before(event),
            false => DispatchState::Absent,
        };
        if event.what == EventKind::Restarted {
            job.cut.get_or_insert(moment);
        }
        let is_uncut = job.cut.is_none() && !is_ended && !job.is_partial;
        let is_partial = job.is_partial;
        let life = job.life_from(instance.subtask, first);
        let ready_ns = life.ready.map(|ready| ready.time_ns);
        let out_of_turn = life.note(event, moment);
        let stated = task_set.dag(instance.dag).subtask(instance.subtask).waits();
        let waited = life.wait(event, stated, terms);
        self.found.extend(out_of_turn);
        self.found.extend(waited.filter(|_| !is_partial));
        let event = *event;
        if event.what == EventKind::Restarted {
            let beyond_limit = self.beyond_limit(event);
            self.found.extend(beyond_limit);
        }
        if event.what == EventKind::Cancelled && is_uncut {
            self.found.push(Violation::CancelledUncut { event });
        }
        // A start is judged like a readiness where that did not come before.
        let is_first =
            event.what == EventKind::Start && ready_ns.is_none_or(|ns| event.time_ns < ns);
        if event.what == EventKind::Ready || is_first {
            self.join(&event, instance, moment);
        }
    }

    /// D1: a fault after which a DAG went on, although it should have ended.
    fn beyond_limit(&mut self, event: Event) -> Option<Violation> {
        let OnFault::DropJob(limit) = self.task_set.dag(event.dag).on_fault() else {
            return Some(Violation::FaultBeyondLimit { event });
        };
        let faults = &mut self.dag(event.dag).faults;
        let nth_before = faults.len().checked_sub(limit.faults as usize);
        let is_too_early = nth_before
            .and_then(|nth| faults.get(nth))
            .is_some_and(|job| job.saturating_add(limit.window) > event.job);
        faults.push(event.job);
        let is_wrong = is_too_early || faults.len() > limit.in_all as usize;
        is_wrong.then_some(Violation::FaultBeyondLimit { event })
    }

    fn occupy(&mut self, event: &Event, instance: Instance) {
        if event.what == EventKind::Ended {
            // Another core may have ended it.
            for core in &mut self.cores {
                core.occupant = core.occupant.filter(|occupant| *occupant != instance);
            }
        }
        if !event.what.is_of_machine() {
            return;
        }
        let core = self.core(event.core);
        // What the scheduler writes from here on, up to the core's next machine event, is of one
        // step.
        core.step += 1;
        let event = *event;
        match event.what {
            EventKind::Start | EventKind::Resume => {
                if let Some(occupant) = core.occupant.replace(instance) {
                    self.found.push(Violation::CoreNotFree { event, occupant });
                }
            }
            _ => core.occupant = core.occupant.filter(|occupant| *occupant != instance),
        }
    }
}
