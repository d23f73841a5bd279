//! One life of each instance, and one instance on each core.
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

use super::{Moment, Replay};
use crate::ids::Instance;
use crate::journal::{Event, What};
use crate::law::Violation;
use crate::law::sweep::Stage;
use crate::policy::OnFault;

/// What is known of an instance.
pub(super) struct Life {
    stage: Stage,
    /// What happened to it last, and when.
    last: Option<(What, u64)>,
    pub(super) ready: Option<Moment>,
    pub(super) finish: Option<Moment>,
    /// When it was cancelled, or ended by a fault.
    dropped: Option<Moment>,
}

impl Life {
    pub(super) const fn new(stage: Stage) -> Self {
        Self {
            stage,
            last: None,
            ready: None,
            finish: None,
            dropped: None,
        }
    }

    /// Returns when the instance was over: finished, cancelled or ended.
    pub(super) fn over(&self) -> Option<Moment> {
        self.finish.or(self.dropped)
    }

    /// Takes note of an event, whether it is allowed or not, and says what is wrong.
    fn note(&mut self, event: &Event, moment: Moment) -> Option<Violation> {
        let (stage, last) = (self.stage, self.last);
        self.stage = stage_after(event);
        self.last = Some((event.what, event.time_ns));
        let place = match event.what {
            What::Ready => Some(&mut self.ready),
            What::Finish => Some(&mut self.finish),
            What::Cancelled | What::Ended => Some(&mut self.dropped),
            _ => None,
        };
        if let Some(place) = place {
            place.get_or_insert(moment);
        }
        let event = *event;
        let was_ended = last.is_some_and(|(what, _)| what == What::Ended);
        let is_answer = was_ended && event.what == What::Restarted;
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

fn is_allowed(stage: Stage, event: &Event) -> bool {
    match (stage, event.what) {
        (Stage::Absent, What::Ready | What::Cancelled)
        | (Stage::Ready, What::Start | What::Cancelled)
        | (Stage::Suspended, What::Resume)
        // Whichever core finds the fault, or stops the DAG, ends the instance.
        | (Stage::Running(_) | Stage::Suspended, What::Ended) => true,
        (Stage::Running(core), What::Suspend | What::Finish) => core == event.core,
        _ => false,
    }
}

/// Returns what an instance is after an event.
pub(in crate::law) const fn stage_after(event: &Event) -> Stage {
    match event.what {
        What::Ready => Stage::Ready,
        What::Start | What::Resume => Stage::Running(event.core),
        What::Suspend => Stage::Suspended,
        _ => Stage::Over,
    }
}

/// Returns what an instance must have been before its first known event.
pub(in crate::law) const fn stage_before(event: &Event) -> Stage {
    match event.what {
        What::Start => Stage::Ready,
        What::Resume => Stage::Suspended,
        What::Suspend | What::Finish | What::Ended => Stage::Running(event.core),
        _ => Stage::Absent,
    }
}

impl Replay<'_> {
    /// Takes what happens to an instance.
    pub(super) fn instance(&mut self, event: &Event) {
        let Some(instance) = event.instance() else {
            return;
        };
        self.occupy(event, instance);
        let moment = self.moment(event);
        let is_known = self.find_job(event);
        let ends_its_dag = self.task_set.dag(instance.dag).on_fault() == OnFault::EndDag;
        let of_dag = self.dag(instance.dag);
        of_dag.is_stopped |= event.what == What::Ended && ends_its_dag;
        let is_stopped = of_dag.is_stopped;
        let Some(job) = of_dag.jobs.get_mut(&instance.job).filter(|_| is_known) else {
            return;
        };
        let first = match job.is_partial {
            true => stage_before(event),
            false => Stage::Absent,
        };
        if event.what == What::Restarted {
            job.cut.get_or_insert(moment);
        }
        let is_uncut = job.cut.is_none() && !is_stopped && !job.is_partial;
        let life = job.life_from(instance.subtask, first);
        let ready_ns = life.ready.map(|ready| ready.time_ns);
        let out_of_turn = life.note(event, moment);
        self.found.extend(out_of_turn);
        let event = *event;
        if event.what == What::Restarted {
            let beyond_limit = self.beyond_limit(event);
            self.found.extend(beyond_limit);
        }
        if event.what == What::Cancelled && is_uncut {
            self.found.push(Violation::CancelledUncut { event });
        }
        // A start is judged like a readiness where that did not come before.
        let is_first = event.what == What::Start && ready_ns.is_none_or(|ns| event.time_ns < ns);
        if event.what == What::Ready || is_first {
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
        if event.what == What::Ended {
            // Another core may have ended it.
            for core in &mut self.cores {
                core.occupant = core.occupant.filter(|occupant| *occupant != instance);
            }
        }
        if !event.what.is_of_machine() {
            return;
        }
        let core = self.core(event.core);
        core.step += 1;
        let event = *event;
        match event.what {
            What::Start | What::Resume => {
                if let Some(occupant) = core.occupant.replace(instance) {
                    self.found.push(Violation::CoreNotFree { event, occupant });
                }
            }
            _ => core.occupant = core.occupant.filter(|occupant| *occupant != instance),
        }
    }
}
