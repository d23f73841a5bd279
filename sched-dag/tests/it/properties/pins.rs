//! Which instances run, by another definition of R5 and of P1 to P4 than the scheduler's and the law's.
//!
//! Of all that are eligible, first those that keep their core, then the pinned ones, then the others,
//! each kind by key, one after the other runs if cores can be found for it and all before it at once:
//! a matching (H. W. Kuhn, Naval Research Logistics Quarterly 2, 1955).

use std::collections::{BTreeMap, BTreeSet};

use sched_dag::journal::{Event, EventKind};
use sched_dag::{CoreId, DagId, Instance, Policy, Preemption, TaskSet};

use crate::support::set::Set;

/// The instances that are eligible, as the journal tells.
#[derive(Clone, Debug, Default)]
pub(crate) struct Eligible {
    instances: BTreeSet<Instance>,
    due_ns: BTreeMap<(DagId, u64), u64>,
    /// How many events have been read.
    read: usize,
}

impl Eligible {
    /// Reads on in a journal.
    pub(crate) fn read(&mut self, events: impl Iterator<Item = Event>) {
        for event in events.skip(self.read) {
            self.read += 1;
            if event.what == EventKind::Due {
                self.due_ns.insert((event.dag, event.job), event.time_ns);
            }
            let Some(instance) = event.instance() else {
                continue;
            };
            match event.what {
                EventKind::Ready | EventKind::Wake => self.instances.insert(instance),
                EventKind::Finish | EventKind::Ended | EventKind::Wait | EventKind::Cancelled => {
                    self.instances.remove(&instance)
                }
                _ => true,
            };
        }
    }

    /// Returns what should run, where cores kept an instance before.
    pub(crate) fn should_run(
        &self,
        set: &Set,
        task_set: &TaskSet,
        kept: &BTreeMap<Instance, CoreId>,
    ) -> BTreeSet<Instance> {
        let mut order: Vec<Instance> = self.instances.iter().copied().collect();
        order.sort_by_key(|&of| {
            let is_bound = (kept.contains_key(&of), pin(set, of).is_some());
            (!is_bound.0, !is_bound.1, self.key(set, task_set, of))
        });
        let cores = |of: Instance| match kept.get(&of) {
            Some(core) => vec![core.0],
            None => cores_of(set, of),
        };
        let mut of_cores: BTreeMap<u32, Instance> = BTreeMap::new();
        for of in order {
            place(of, &cores, &mut BTreeSet::new(), &mut of_cores);
        }
        of_cores.into_values().collect()
    }

    fn key(&self, set: &Set, task_set: &TaskSet, of: Instance) -> (u64, Instance) {
        let (dag, spec) = (task_set.dag(of.dag), &set.specs[of.dag.index()]);
        let subtask = dag.subtask(of.subtask);
        let number = match set.options.policy {
            Policy::StaticPriority => subtask.priority().0.into(),
            Policy::Edf => subtask.relative_deadline_ns(),
            policy => policy.numbers(dag)[of.subtask.index()],
        };
        if !set.options.policy.adds_release() {
            return (number, of);
        }
        let grid_ns = spec.offset_ns + of.job * dag.period_ns();
        let due_ns = self.due_ns.get(&(of.dag, of.job)).copied();
        (due_ns.unwrap_or(grid_ns) + number, of)
    }
}

/// Finds a core for an instance, moving others where that helps; reports whether there is one.
fn place(
    of: Instance,
    cores: &impl Fn(Instance) -> Vec<u32>,
    tried: &mut BTreeSet<u32>,
    of_cores: &mut BTreeMap<u32, Instance>,
) -> bool {
    for core in cores(of) {
        if !tried.insert(core) {
            continue;
        }
        let is_free = match of_cores.get(&core).copied() {
            None => true,
            Some(other) => place(other, cores, tried, of_cores),
        };
        if is_free {
            of_cores.insert(core, of);
            return true;
        }
    }
    false
}

/// Returns the core that an instance is pinned to.
fn pin(set: &Set, of: Instance) -> Option<u32> {
    set.specs[of.dag.index()].subtasks[of.subtask.index()].core
}

/// Returns the cores that may execute an instance.
pub(crate) fn cores_of(set: &Set, of: Instance) -> Vec<u32> {
    match (pin(set, of), &set.specs[of.dag.index()].affinity[..]) {
        (Some(core), _) => vec![core],
        (None, []) => (0..set.options.cores).collect(),
        (None, affinity) => affinity.to_vec(),
    }
}

/// Reports whether an instance, once it has a core, keeps it.
pub(crate) fn keeps_its_core(set: &Set, of: Instance) -> bool {
    let stated = &set.specs[of.dag.index()].subtasks[of.subtask.index()];
    stated.non_preemptive || set.options.preemption == Preemption::Disabled
}
