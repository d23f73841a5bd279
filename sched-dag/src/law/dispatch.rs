//! Holding a record against R5: did the right instances run?
//!
//! A sweep over all times at which something changes. Between two of them it
//! knows what was *eligible* (ready, and neither finished nor cancelled) and
//! what *ran*, and compares: as many run as can, and none that runs is outranked
//! by one that waits, unless it keeps its core and has started before.
//!
//! The times must be exact ([`Precision::Exact`](super::Precision::Exact)): a
//! machine that takes time to switch always runs the wrong instance for a while.
//!
//! Not checked: what happens within one instant. An instance that executes for
//! no time is eligible and gone at one instant, so its order among others is
//! not seen; and where there is one, the dispatch that started a non-preemptive
//! instance at that instant may have come before another became ready.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;

use super::{Record, Violation};
use crate::ids::{CoreId, Instance};
use crate::policy::{Policy, Preemption};
use crate::scheduler::SchedulerOptions;
use crate::task_set::TaskSet;

/// A time during which one core ran one instance without interruption.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// The instance.
    pub instance: Instance,
    /// The core.
    pub core: CoreId,
    /// When it started or continued.
    pub from_ns: u64,
    /// When it finished, failed or was preempted; `u64::MAX` if none of that had
    /// happened at the end of the record.
    pub to_ns: u64,
}

/// Returns every breach of R5 that a record and its stretches, in any order,
/// show. A wrong choice that lasts is returned once.
///
/// The record must have all instances that were ready before its end, with exact
/// times.
#[must_use]
pub fn dispatch_violations(
    task_set: &TaskSet,
    options: &SchedulerOptions,
    record: &Record,
    stretches: &[Stretch],
) -> Vec<Violation> {
    let mut sweep = Sweep {
        task_set,
        options,
        record,
        eligible: BTreeSet::new(),
        running: BTreeMap::new(),
        busy: BTreeMap::new(),
        found: Vec::new(),
    };
    let changes = sweep.changes(stretches);
    let instants = changes.chunk_by(|one, other| one.time_ns == other.time_ns);
    let mut last = None;
    for instant in instants {
        let time_ns = instant[0].time_ns;
        for change in instant {
            sweep.apply(change);
        }
        let wrong = sweep.wrong_choice(time_ns);
        if let Some((waiting, running)) = wrong.filter(|_| wrong != last) {
            sweep.found.push(Violation::PassedOver {
                at_ns: time_ns,
                waiting,
                running,
            });
        }
        last = wrong;
    }
    sweep.found
}

/// The key of R5: the smaller one is served first.
type Key = (u64, Instance);

/// What changes at a time; at one time in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum What {
    Stops(CoreId),
    IsGone,
    IsEligible,
    Runs(CoreId),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Change {
    time_ns: u64,
    what: What,
    instance: Instance,
}

struct Sweep<'a> {
    task_set: &'a TaskSet,
    options: &'a SchedulerOptions,
    record: &'a Record,
    eligible: BTreeSet<Key>,
    running: BTreeMap<Key, CoreId>,
    busy: BTreeMap<CoreId, Instance>,
    found: Vec<Violation>,
}

impl Sweep<'_> {
    fn changes(&self, stretches: &[Stretch]) -> Vec<Change> {
        let mut changes = Vec::new();
        let mut add = |from_ns, to_ns: Option<u64>, instance, begins, ends| {
            // What begins and ends at one instant is not there at any time.
            if to_ns != Some(from_ns) {
                let change = |time_ns, what| Change {
                    time_ns,
                    what,
                    instance,
                };
                changes.push(change(from_ns, begins));
                changes.extend(to_ns.map(|to_ns| change(to_ns, ends)));
            }
        };
        for (instance, times) in self.record.all_instances(self.task_set) {
            let Some(ready_ns) = times.ready_ns else {
                continue;
            };
            let of_job = self.record.job(instance.dag, instance.job);
            let gone_ns = match times.start_ns {
                // One that a fault ended does not finish. If the fault's time is
                // not recorded, it is gone with its job at the latest.
                Some(_) => {
                    (times.finish_ns.or(times.failed_ns)).or(of_job.and_then(|job| job.ended_ns))
                }
                None => of_job.and_then(|job| job.cut_ns),
            };
            add(ready_ns, gone_ns, instance, What::IsEligible, What::IsGone);
        }
        for stretch in stretches {
            let Stretch {
                instance,
                core,
                from_ns,
                to_ns,
            } = *stretch;
            let (begins, ends) = (What::Runs(core), What::Stops(core));
            let to_ns = Some(to_ns).filter(|&to_ns| to_ns < u64::MAX);
            add(from_ns, to_ns, instance, begins, ends);
        }
        changes.sort_unstable();
        changes
    }

    fn apply(&mut self, change: &Change) {
        let Change {
            time_ns,
            what,
            instance,
        } = *change;
        let key = self.key(instance);
        match what {
            What::Stops(core) => {
                self.running.remove(&key);
                self.busy.remove(&core);
            }
            What::IsGone => {
                self.eligible.remove(&key);
            }
            What::IsEligible => {
                self.eligible.insert(key);
            }
            What::Runs(core) => {
                let elsewhere = self.running.insert(key, core);
                let other = self.busy.insert(core, instance);
                if elsewhere.is_some() || other.is_some() {
                    self.found.push(Violation::CoreNotFree {
                        core,
                        instance,
                        at_ns: time_ns,
                    });
                }
                if self.keeps_core(instance) && self.start_ns(instance) != Some(time_ns) {
                    let at_ns = time_ns;
                    self.found.push(Violation::LostItsCore { instance, at_ns });
                }
            }
        }
    }

    /// Finds who waits from `now_ns` on and should not, and what runs instead.
    fn wrong_choice(&self, now_ns: u64) -> Option<(Instance, Option<Instance>)> {
        let mut waiting = (self.eligible.iter()).filter(|key| !self.running.contains_key(key));
        let first = waiting.next()?;
        if self.running.len() < self.options.cores as usize {
            return Some((first.1, None));
        }
        let outranked = self.running.range(*first..).map(|(key, _)| key.1);
        let mut replaceable = outranked.filter(|&running| !self.may_stay(running, now_ns));
        replaceable.next().map(|running| (first.1, Some(running)))
    }

    /// Reports whether an outranked instance may go on running.
    fn may_stay(&self, running: Instance, now_ns: u64) -> bool {
        let has_started = |start_ns| start_ns < now_ns || self.is_several_dispatches(now_ns);
        self.keeps_core(running) && self.start_ns(running).is_some_and(has_started)
    }

    /// Reports whether an instance executed for no time at this instant.
    fn is_several_dispatches(&self, now_ns: u64) -> bool {
        let mut times = self.record.all_instances(self.task_set);
        times.any(|(_, times)| {
            let gone_ns = times.finish_ns.or(times.failed_ns);
            times.start_ns == Some(now_ns) && gone_ns == Some(now_ns)
        })
    }

    fn keeps_core(&self, instance: Instance) -> bool {
        let dag = self.task_set.dag(instance.dag);
        self.options.preemption == Preemption::Disabled
            || dag.subtask(instance.subtask).is_non_preemptive()
    }

    fn start_ns(&self, instance: Instance) -> Option<u64> {
        self.record.instance(instance)?.start_ns
    }

    /// The grid says, or, of a sporadic DAG, the record.
    fn release_ns(&self, Instance { dag, job, .. }: Instance) -> u64 {
        let model = self.task_set.dag(dag);
        if model.is_sporadic() {
            let of_job = self.record.job(dag, job);
            return of_job.and_then(|job| job.release_ns).unwrap_or(u64::MAX);
        }
        model.grid_ns(job)
    }

    /// Static priority: (priority, DAG, job, subtask). EDF: the deadline instead.
    fn key(&self, instance: Instance) -> Key {
        let dag = self.task_set.dag(instance.dag);
        let urgency = match self.options.policy {
            Policy::StaticPriority => dag.subtask(instance.subtask).priority().0.into(),
            Policy::Edf => self
                .release_ns(instance)
                .saturating_add(dag.relative_deadline_ns()),
        };
        (urgency, instance)
    }
}

#[cfg(test)]
mod tests;
