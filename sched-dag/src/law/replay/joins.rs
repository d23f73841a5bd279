//! Rules R2 and R3: what an instance waits for, and what makes it ready.
//!
//! The *conditions* of an instance are the finish of each predecessor in its job, the end
//! of its subtask's instance in the precursor and, for a source, its job's release.
//!
//! R2: it is neither ready nor started before all of them. As each instance waits for the
//! one before it, no two of one subtask overlap.
//!
//! R3: it becomes ready in the scheduler's step that one of its conditions brings about.
//! With R2 that is the last one, so all that waits for a finish and for nothing else is
//! released in one step. Which of two is the last is left open, for two cores may finish
//! and then take the scheduler's lock in the other order. And it does become ready, within
//! the tolerance.

use super::{Moment, Replay};
use crate::ids::Instance;
use crate::journal::{Event, What};
use crate::law::Violation;

/// A condition of an instance.
struct Condition {
    /// The instance that must be over; `None`: the release.
    awaited: Option<Instance>,
    /// When it held; `None`: it is not known to have held.
    held: Option<Moment>,
    /// Whether it may have held without leaving an event.
    may_be_lost: bool,
}

impl Replay<'_> {
    /// Judges that an instance becomes ready, or starts without having been.
    pub(super) fn join(&mut self, event: &Event, instance: Instance, moment: Moment) {
        let too_early = self.before_release(event, instance);
        self.found.extend(too_early);
        let too_early = self.before_join(event, instance);
        let is_early = too_early.is_some();
        self.found.extend(too_early);
        if is_early || event.what != What::Ready {
            return;
        }
        let Some(last) = self.last_condition(instance) else {
            return;
        };
        let Some(held) = last.held else {
            return;
        };
        let mut conditions = self.conditions(instance);
        let is_same_step = |held: Moment| held.is_same_step(moment);
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

    fn conditions(&self, instance: Instance) -> impl Iterator<Item = Condition> {
        let Instance { dag, job, subtask } = instance;
        let predecessors = self.task_set.dag(dag).predecessors(subtask);
        let of_dag = &self.dags[dag.index()];
        let known = of_dag.jobs.get(&job);
        let is_partial = known.is_none_or(|known| known.is_partial);
        let of_predecessors = predecessors.iter().map(move |&subtask| {
            let life = known.and_then(|known| known.life(subtask));
            Condition {
                awaited: Some(Instance { dag, job, subtask }),
                held: life.and_then(|life| life.finish),
                may_be_lost: life.is_none() && is_partial,
            }
        });
        let precursor = of_dag.jobs.range(..job).next_back();
        let of_precursor = precursor.map(|(&job, known)| {
            let life = known.life(subtask);
            Condition {
                awaited: Some(Instance { dag, job, subtask }),
                held: life.and_then(super::lives::Life::over),
                may_be_lost: life.is_none() && (known.is_partial || of_dag.is_stopped),
            }
        });
        let of_release = predecessors.is_empty().then(|| Condition {
            awaited: None,
            held: known.and_then(|known| known.released),
            may_be_lost: true,
        });
        of_predecessors.chain(of_precursor).chain(of_release)
    }

    /// Returns the condition that held last, if all are known to have held.
    fn last_condition(&self, instance: Instance) -> Option<Condition> {
        let mut last: Option<Condition> = None;
        let rank = |condition: &Condition| {
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

    /// R1 for an instance.
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

    /// R2: the first condition that did not hold.
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

    /// R3 at the end: all conditions hold, and nothing happens.
    pub(super) fn never_ready(&self, instance: Instance) -> Option<Violation> {
        let of_dag = &self.dags[instance.dag.index()];
        let job = of_dag.jobs.get(&instance.job)?;
        let is_cut = job.cut.is_some() || of_dag.is_stopped;
        if is_cut || job.life(instance.subtask).is_some() {
            return None;
        }
        let held = self.last_condition(instance)?.held?;
        let is_tolerable = self.is_tolerable(held.time_ns, self.end_ns);
        (!is_tolerable || self.terms.is_complete).then_some(Violation::NeverReady {
            instance,
            since_ns: held.time_ns,
            core: held.core,
        })
    }
}
