//! R5 for a run whose times are recorded: the changes that its events are.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;

use super::sweep::{Blame, Change, Key, Ranking, Stage, Sweep, Wrong};
use super::{Record, Violation};
use crate::ids::{CoreId, Instance};
use crate::journal::{Event, What};
use crate::policy::SchedulerOptions;
use crate::policy::{Policy, Preemption};
use crate::task_set::TaskSet;

/// The model and the options of a run whose times are recorded.
struct Model<'a> {
    task_set: &'a TaskSet,
    options: &'a SchedulerOptions,
    record: &'a Record,
}

impl Ranking for Model<'_> {
    /// Static priority: (priority, DAG, job, subtask). EDF: the deadline instead.
    fn key(&self, instance: Instance) -> Key {
        let Instance { dag, job, subtask } = instance;
        let model = self.task_set.dag(dag);
        let urgency = match self.options.policy {
            Policy::StaticPriority => model.subtask(subtask).priority().0.into(),
            Policy::Edf => {
                // The grid says, or, of a sporadic DAG, the record.
                let recorded = || self.record.job(dag, job)?.release_ns;
                let release_ns = match model.is_sporadic() {
                    true => recorded().unwrap_or(u64::MAX),
                    false => model.grid_ns(job),
                };
                release_ns.saturating_add(model.relative_deadline_ns())
            }
        };
        (urgency, instance)
    }

    fn keeps_its_core(&self, instance: Instance) -> bool {
        let dag = self.task_set.dag(instance.dag);
        self.options.preemption == Preemption::Disabled
            || dag.subtask(instance.subtask).is_non_preemptive()
    }
}

/// Returns every breach of R5 that a whole run's events show, of which none lasts for
/// at most `bound_ns`; 0 is for exact times.
///
/// The events are in their order; one whose time is before that of an earlier one
/// counts as of that.
#[must_use]
pub fn dispatch_violations(
    task_set: &TaskSet,
    options: &SchedulerOptions,
    record: &Record,
    events: impl Iterator<Item = Event> + Clone,
    bound_ns: u64,
) -> Vec<Violation> {
    let model = Model {
        task_set,
        options,
        record,
    };
    let mut latest_ns = 0;
    let changes = events.clone().filter_map(move |event| {
        latest_ns = event.time_ns.max(latest_ns);
        let stage = match event.what {
            What::Ready => Stage::Ready,
            What::Start | What::Resume => Stage::Running(event.core),
            What::Suspend => Stage::Suspended,
            What::Finish | What::Ended | What::Cancelled => Stage::Over,
            _ => return None,
        };
        Some((latest_ns, Change::Stage(event.instance()?, stage)))
    });
    let cores = (0..options.cores).map(|_| (0, Change::CoreIsKnown));
    let end_ns = events.clone().map(|event| event.time_ns).max().unwrap_or(0);
    let (wrong, _) = Sweep::judge(&model, bound_ns, cores.chain(changes), end_ns);
    let mut found: Vec<Violation> = wrong.iter().map(in_numbers).collect();
    if bound_ns == 0 {
        found.extend(chosen_wrongly(&model, events.clone()));
    }
    found.extend(occupants(&model, events));
    found
}

/// Returns what started and keeps its core, although one that goes first had been ready
/// before in the same instant and got none. Only exact times tell: on a machine the one
/// may have become ready when the other was chosen already.
fn chosen_wrongly(model: &Model<'_>, events: impl Iterator<Item = Event>) -> Vec<Violation> {
    let mut fresh: BTreeSet<Key> = BTreeSet::new();
    // The one that goes first, the one that started, and when.
    let mut passed: Vec<(Key, Instance, u64)> = Vec::new();
    let mut found = Vec::new();
    let mut now_ns = 0;
    for event in events {
        if event.time_ns > now_ns {
            now_ns = event.time_ns;
            found.append(&mut passed);
            fresh.clear();
        }
        let Some(instance) = event.instance() else {
            continue;
        };
        let key = model.key(instance);
        match event.what {
            What::Ready => {
                fresh.insert(key);
            }
            What::Start => {
                fresh.remove(&key);
                passed.retain(|(first, ..)| *first != key);
                let first = fresh.first().filter(|first| **first < key);
                if let Some(first) = first
                    && model.keeps_its_core(instance)
                {
                    passed.push((*first, instance, now_ns));
                }
            }
            What::Cancelled => {
                fresh.remove(&key);
                passed.retain(|(first, ..)| *first != key);
            }
            _ => {}
        }
    }
    found.extend(passed);
    let in_numbers = |(first, started, at_ns): (Key, Instance, u64)| Violation::PassedOver {
        at_ns,
        waiting: first.1,
        running: Some(started),
    };
    found.into_iter().map(in_numbers).collect()
}

fn in_numbers(wrong: &Wrong) -> Violation {
    match *wrong {
        Wrong::Waits {
            waiting,
            since_ns,
            blame,
            ..
        } => Violation::PassedOver {
            at_ns: since_ns,
            waiting,
            running: match blame {
                Blame::Runs(running, _) => Some(running),
                Blame::Idle(_) => None,
            },
        },
        Wrong::OutOfTurn {
            started,
            at_ns,
            first,
            ..
        } => Violation::PassedOver {
            at_ns,
            waiting: first,
            running: Some(started),
        },
    }
}

/// Returns what began on a core that was not free, or while it ran elsewhere, and what
/// lost a core that it keeps.
fn occupants(model: &Model<'_>, events: impl Iterator<Item = Event>) -> Vec<Violation> {
    let mut running: BTreeMap<Instance, CoreId> = BTreeMap::new();
    let mut busy: BTreeMap<CoreId, Instance> = BTreeMap::new();
    let mut found = Vec::new();
    for event in events {
        let Some(instance) = event.instance() else {
            continue;
        };
        let (core, at_ns) = (event.core, event.time_ns);
        match event.what {
            What::Start | What::Resume => {
                let elsewhere = running.insert(instance, core);
                let other = busy.insert(core, instance);
                if elsewhere.is_some() || other.is_some() {
                    found.push(Violation::CoreNotFree {
                        core,
                        instance,
                        at_ns,
                    });
                }
                if event.what == What::Resume && model.keeps_its_core(instance) {
                    found.push(Violation::LostItsCore { instance, at_ns });
                }
            }
            What::Suspend | What::Finish | What::Ended => {
                if let Some(core) = running.remove(&instance)
                    && busy.get(&core) == Some(&instance)
                {
                    busy.remove(&core);
                }
            }
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests;
