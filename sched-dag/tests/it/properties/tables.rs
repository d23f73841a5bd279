//! Which instances run, by another definition of R5 and of T1 to T4 than the scheduler's and the
//! law's; and that nothing is later than in a table that is right.
//!
//! Of all that are eligible, first those that keep their core, then the innermost entry of each core,
//! then the members, each kind by key, one after the other runs if cores can be found for it and all
//! before it at once: a matching (H. W. Kuhn, Naval Research Logistics Quarterly 2, 1955).

use std::collections::{BTreeMap, BTreeSet, HashSet};

use sched_dag::journal::{Event, EventKind};
use sched_dag::{CoreId, CoreList, DagId, Instance, Policy, Preemption, TaskSet};

use crate::support::set::Set;

/// The instances that are eligible, as the journal tells, and how far each list has come.
#[derive(Clone, Debug, Default)]
pub(crate) struct Eligible {
    instances: BTreeSet<Instance>,
    due_ns: BTreeMap<(DagId, u64), u64>,
    /// Skipped and cut jobs, the released ones, and the DAGs of which no further one is.
    voids: HashSet<(DagId, u64)>,
    released: HashSet<(DagId, u64)>,
    closed: HashSet<DagId>,
    lists: Vec<ListReplay>,
    /// How many events have been read.
    read: usize,
}

/// How far a list has come.
#[derive(Clone, Debug)]
struct ListReplay {
    list: CoreList,
    /// Counted over all laps.
    next: usize,
    begun: Vec<(Instance, u32)>,
}

impl Eligible {
    pub(crate) fn new(set: &Set) -> Self {
        let lists = set.table.iter().flat_map(|table| table.lists.clone());
        let replay = |list| ListReplay {
            list,
            next: 0,
            begun: Vec::new(),
        };
        Self {
            lists: lists.map(replay).collect(),
            ..Self::default()
        }
    }

    /// Reads on in a journal.
    pub(crate) fn read(&mut self, events: impl Iterator<Item = Event>) {
        for event in events.skip(self.read) {
            self.read += 1;
            let job = (event.dag, event.job);
            match event.what {
                EventKind::Due => _ = self.due_ns.insert(job, event.time_ns),
                EventKind::Released => _ = self.released.insert(job),
                EventKind::Skipped | EventKind::Aborted | EventKind::Restarted => {
                    self.voids.insert(job);
                }
                EventKind::Closed => _ = self.closed.insert(event.dag),
                EventKind::DagEnded => {
                    self.closed.insert(event.dag);
                    self.voids
                        .extend(self.released.iter().filter(|of| of.0 == event.dag));
                }
                _ => {}
            }
            let Some(instance) = event.instance() else {
                continue;
            };
            match event.what {
                EventKind::Ready | EventKind::Wake => _ = self.instances.insert(instance),
                EventKind::Finish | EventKind::Ended | EventKind::Wait | EventKind::Cancelled => {
                    self.instances.remove(&instance);
                    for list in &mut self.lists {
                        list.begun.retain(|(of, _)| *of != instance);
                    }
                }
                _ => {}
            }
        }
    }

    /// Returns what should run, where cores kept an instance before.
    pub(crate) fn should_run(
        &mut self,
        set: &Set,
        task_set: &TaskSet,
        kept: &BTreeMap<Instance, CoreId>,
    ) -> BTreeSet<Instance> {
        let mut lists = std::mem::take(&mut self.lists);
        for list in &mut lists {
            let is_kept = kept.values().any(|core| core.0 == list.list.core);
            while !is_kept && self.goes_on(list, set, task_set) {}
        }
        let innermost: Vec<Instance> = (lists.iter())
            .filter_map(|list| Some(list.begun.last()?.0))
            .collect();
        self.lists = lists;
        let mut order: Vec<Instance> = self.instances.iter().copied().collect();
        order.retain(|of| !set.has_table(of.dag) || innermost.contains(of));
        order.sort_by_key(|&of| {
            let is_bound = (kept.contains_key(&of), set.has_table(of.dag));
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

    /// Begins or passes the next entry of a list; reports whether there was one for that.
    fn goes_on(&self, list: &mut ListReplay, set: &Set, task_set: &TaskSet) -> bool {
        let count = list.list.entries.len();
        let entry = list.list.entries[list.next % count];
        let table = set.table.as_ref().expect("it has lists");
        let jobs = task_set.jobs_in_lap(table, entry.dag).cast_signed();
        let lap = i64::try_from(list.next / count).expect("few laps");
        let innermost = list.begun.last();
        let is_open =
            innermost.is_none_or(|(of, depth)| *depth < entry.depth && !keeps_its_core(set, *of));
        // All are over long before.
        if !is_open || lap > 20 {
            return false;
        }
        let job = u64::try_from(entry.job + lap * jobs).ok();
        let of = job.map(|job| Instance::new(entry.dag, job, entry.subtask));
        let is_void = of.is_none_or(|of| {
            let job = (of.dag, of.job);
            let is_beyond = task_set
                .dag(of.dag)
                .jobs()
                .is_some_and(|jobs| of.job >= jobs);
            let is_closed = self.closed.contains(&of.dag) && !self.released.contains(&job);
            is_beyond || is_closed || self.voids.contains(&job)
        });
        match of {
            _ if is_void => {}
            Some(of) if self.instances.contains(&of) => list.begun.push((of, entry.depth)),
            _ => return false,
        }
        list.next += 1;
        true
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

/// Returns the cores that may execute an instance.
pub(crate) fn cores_of(set: &Set, of: Instance) -> Vec<u32> {
    match (
        set.core_of_entry(of),
        &set.specs[of.dag.index()].affinity[..],
    ) {
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
