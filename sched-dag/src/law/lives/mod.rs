//! Judges a journal by the rules R1 to R4, by the rules W1 and W2 for waits, by one life of each
//! instance, and by one instance on each core.
//!
//! The judge takes the events in their order, where each event comes after all its causes, and
//! compares each event with the state known so far. An event not yet seen has not happened,
//! whatever time it carries. Complete jobs are forgotten once nothing waits for them any more, and
//! jobs that are due and waiting are kept as runs ([`backlog`]). So the judge mostly needs memory
//! for the jobs in flight only.
//!
//! Words. A *step* of the scheduler is identified by its core and by the core's last machine event
//! before the step. (A completion's step begins with a machine event, never between two of them.) A
//! *moment* is the time and the step of an event. A job's *precursor* is the job of the same DAG
//! released before it.
//!
//! If the oldest events are lost, a job is *partial* if its release may be among the lost events:
//! nothing can be concluded from a missing event of a partial job. All other jobs are judged as in
//! a whole journal.
//!
//! # One life of each instance, and one instance on each core
//!
//! *One life*: an instance becomes ready at most once, starts at most once and only when ready, is
//! suspended only on the core where it runs, resumed only when suspended or after a wait, and
//! finishes at most once, on the core where it runs. So an instance is on one core at a time. An
//! instance is cancelled only if its job was cut or its DAG ended. An event of an instance never
//! has an earlier time than the instance's event before.
//!
//! *One core*: an instance on a core is the core's *occupant*. The occupant must be gone before the
//! next instance starts or is resumed there.
//!
//! The first known event of an instance of a partial job tells the instance's state before the
//! event.

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

/// The findings about R1 to R4, waits, lives of instances, and cores in a journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LifeVerdict {
    /// Every breach, in the order in which they were found.
    pub violations: Vec<Violation>,
    /// The longest time from the finish an instance waited for last to the instance's readiness.
    pub finish_to_ready_max_ns: u64,
}

/// Checks a journal against the rules R1 to R4 and, for waits, W1 and W2, and each instance and
/// each core against the rules of every machine: one life, and one instance on a core at a time.
///
/// [`dispatch_violations`](super::dispatch_violations) judges which instance should have run.
#[must_use]
pub fn judge(
    task_set: &TaskSet,
    terms: JudgeOptions,
    events: impl IntoIterator<Item = Event>,
) -> LifeVerdict {
    let mut lives = LifeJudge {
        task_set,
        terms,
        dags: task_set
            .dags()
            .iter()
            .map(|_| DagHistory::default())
            .collect(),
        cores: Vec::new(),
        first_ns: None,
        end_ns: 0,
        found: Vec::new(),
        finish_to_ready_max_ns: 0,
    };
    for event in events {
        lives.judge_event(&event);
    }
    lives.finish();
    LifeVerdict {
        violations: lives.found,
        finish_to_ready_max_ns: lives.finish_to_ready_max_ns,
    }
}

/// Returns the breaches found by [`judge`].
#[must_use]
pub fn violations(
    task_set: &TaskSet,
    terms: JudgeOptions,
    events: impl IntoIterator<Item = Event>,
) -> Vec<Violation> {
    judge(task_set, terms, events).violations
}

struct LifeJudge<'a> {
    task_set: &'a TaskSet,
    terms: JudgeOptions,
    dags: Vec<DagHistory>,
    cores: Vec<CoreHistory>,
    /// When the first event was written.
    first_ns: Option<u64>,
    /// The latest time so far.
    end_ns: u64,
    found: Vec<Violation>,
    finish_to_ready_max_ns: u64,
}

#[derive(Default)]
struct DagHistory {
    /// The jobs that are released or partial, and not forgotten.
    jobs: BTreeMap<u64, JobState>,
    /// The jobs that are due and not released.
    waiting: Backlog,
    /// The miss of the latest waiting job that missed at the very instant of its deadline. The job
    /// must be skipped.
    given_up: Option<Event>,
    /// The number of released jobs not yet complete.
    in_flight: u32,
    /// All jobs before this number are forgotten or not complete.
    forgotten: u64,
    /// The sporadic job being released, and when it was due.
    due: Option<(u64, u64)>,
    /// The latest released job, and its nominal release.
    latest: Option<(u64, Option<u64>)>,
    /// When the latest completion of a job happened.
    completed_ns: Option<u64>,
    is_ended: bool,
    /// Whether the DAG is paused or closed, and so releases nothing.
    is_off: bool,
    /// The jobs with faults that the DAG has survived.
    faults: Vec<u64>,
}

#[derive(Clone, Default)]
struct CoreHistory {
    /// The number of the core's machine events so far.
    step: u64,
    /// The instance running on the core.
    occupant: Option<Instance>,
}

/// The time and the scheduler step of an event.
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

impl LifeJudge<'_> {
    fn judge_event(&mut self, event: &Event) {
        // A finish or a due release may carry an earlier time than lost events.
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

    fn dag(&mut self, dag: DagId) -> &mut DagHistory {
        &mut self.dags[dag.index()]
    }

    fn core(&mut self, core: CoreId) -> &mut CoreHistory {
        if self.cores.len() <= core.index() {
            self.cores.resize(core.index() + 1, CoreHistory::default());
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

    /// Reports whether the tolerance allows this delay.
    const fn is_tolerable(&self, from_ns: u64, to_ns: u64) -> bool {
        to_ns <= from_ns.saturating_add(self.terms.tolerance_ns)
    }

    /// Reports whether times must be exactly those of the model.
    const fn is_exact(&self) -> bool {
        self.terms.tolerance_ns == 0
    }

    /// Finds the job of an event. Treats an unknown job as partial if its first events may be lost;
    /// otherwise records a breach. Returns whether the event can be judged.
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
        // In both cases, nothing is concluded from missing events of the job.
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

/// The state of an instance after the events so far.
#[derive(Default)]
struct InstanceLife {
    stage: DispatchState,
    /// The latest event, and its time.
    last: Option<(EventKind, u64)>,
    ready: Option<StepTime>,
    finish: Option<StepTime>,
    /// When the instance was cancelled, or ended by a fault.
    dropped: Option<StepTime>,
    /// The number of waits begun, and when the latest wait began.
    waits: (usize, u64),
}

impl InstanceLife {
    fn new(stage: DispatchState) -> Self {
        Self {
            stage,
            ..Self::default()
        }
    }

    /// Records a wait or the finish, and returns the breach of W1 or W2, if any.
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

    /// Records an event, whether allowed or not, and returns the breach, if any.
    fn note(&mut self, event: &Event, moment: StepTime) -> Option<Violation> {
        let (stage, last) = (self.stage, self.last);
        // Also after a breach: otherwise one slip would make every later event a breach.
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
        // Any core may find the fault or end the DAG, and so end the instance.
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

impl LifeJudge<'_> {
    /// Judges an event of an instance.
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
        // A start without an earlier readiness is judged like a readiness.
        let is_first =
            event.what == EventKind::Start && ready_ns.is_none_or(|ns| event.time_ns < ns);
        if event.what == EventKind::Ready || is_first {
            self.join(&event, instance, moment);
        }
    }

    /// D1: returns the breach if a DAG went on after a fault that should have ended it.
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
            // A fault may be found on any core, so the instance's own core must be looked for.
            for core in &mut self.cores {
                core.occupant = core.occupant.filter(|occupant| *occupant != instance);
            }
        }
        if !event.what.is_of_machine() {
            return;
        }
        let core = self.core(event.core);
        // All scheduler events from here to the core's next machine event belong to one step.
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
