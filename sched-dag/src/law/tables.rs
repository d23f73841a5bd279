//! T1 to T4 for a journal: follows each core through its list, as far as the events tell.
//!
//! A *place* is an entry in a lap, counted over all laps of its core's list.
//!
//! A machine follows its scheduler with a delay. So a core may start an inner entry first, because
//! the scheduler let the outer entry begin and give way before the core came to either. Therefore
//! an inner entry may pass an outer entry that is ready; the outer entry starts afterwards.

use alloc::boxed::Box;
use alloc::collections::{BTreeMap, BTreeSet};
use core::ops::Range;

use super::Violation;
use crate::ids::{CoreId, DagId, Instance, SubtaskId};
use crate::journal::{Event, EventKind};
use crate::table::TableEntry;
use crate::task_set::TaskSet;

/// The lists of a cluster.
pub(super) struct CoreLists<'m> {
    /// The entries of each list, each with the number of its DAG's jobs in a lap.
    lists: BTreeMap<CoreId, Box<[(&'m TableEntry, u64)]>>,
    /// The entry's core and index, by DAG, subtask and job in the lap.
    places: BTreeMap<(DagId, SubtaskId, u64), (CoreId, u64)>,
    /// The number of jobs in a lap, by DAG.
    jobs: BTreeMap<DagId, u64>,
}

impl<'m> CoreLists<'m> {
    /// Collects the lists of the cluster with the given cores.
    pub(super) fn new(task_set: &'m TaskSet, cores: &Range<u32>, all_cores: u32) -> Self {
        let mut found = Self {
            lists: BTreeMap::new(),
            places: BTreeMap::new(),
            jobs: BTreeMap::new(),
        };
        let is_own = |cluster| task_set.cores_of(cluster, all_cores) == *cores;
        let tables = task_set.tables().iter();
        for table in tables.filter(|table| is_own(table.cluster)) {
            for list in &table.lists {
                let core = CoreId(cores.start + list.core);
                let with_jobs =
                    |entry: &'m TableEntry| (entry, task_set.jobs_in_lap(table, entry.dag));
                let list: Box<[_]> = list.entries.iter().map(with_jobs).collect();
                for (index, (entry, jobs)) in (0..).zip(&list) {
                    let job = i128::from(entry.job).rem_euclid(i128::from(*jobs));
                    let job = u64::try_from(job).unwrap_or(0);
                    let key = (entry.dag, entry.subtask, job);
                    found.places.insert(key, (core, index));
                    found.jobs.insert(entry.dag, *jobs);
                }
                found.lists.insert(core, list);
            }
        }
        found
    }

    /// Returns the core and place of an instance, and its depth; `None` if no table contains its
    /// DAG.
    pub(super) fn place(&self, of: Instance) -> Option<((CoreId, u64), u32)> {
        let jobs = *self.jobs.get(&of.dag)?;
        let key = (of.dag, of.subtask, of.job % jobs);
        let (core, index) = *self.places.get(&key)?;
        let list = &self.lists[&core];
        let (entry, _) = list[usize::try_from(index).ok()?];
        let ahead = i128::from(of.job) - i128::from(entry.job);
        let lap = u64::try_from(ahead / i128::from(jobs)).ok()?;
        let place = lap.checked_mul(list.len() as u64)?.checked_add(index)?;
        Some(((core, place), entry.depth))
    }

    /// Returns the instance and depth of a place; `None` for a job that does not exist.
    fn entry(&self, core: CoreId, place: u64) -> (Option<Instance>, u32) {
        let list = &self.lists[&core];
        let length = list.len() as u64;
        let (entry, jobs) = list[usize::try_from(place % length).unwrap_or(0)];
        let job = i128::from(entry.job) + i128::from(place / length) * i128::from(jobs);
        let job = u64::try_from(job).ok();
        let instance = job.map(|job| Instance::new(entry.dag, job, entry.subtask));
        (instance, entry.depth)
    }
}

/// The progress of a cluster's cores in their lists.
///
/// An entry that never starts is treated as void: other rules check that all instances of a job
/// run.
pub(super) struct TableProgress<'m> {
    task_set: &'m TaskSet,
    lists: &'m CoreLists<'m>,
    cores: BTreeMap<CoreId, ListPosition>,
    /// Skipped jobs and cancelled instances of the latest laps.
    voids: BTreeSet<(DagId, u64, Option<SubtaskId>)>,
    ended: BTreeSet<DagId>,
}

#[derive(Default)]
struct ListPosition {
    /// The first place neither begun nor passed; `None` if the events that tell it are lost.
    next: Option<u64>,
    /// The depths and places of entries that have begun and not finished.
    begun: BTreeSet<(u32, u64)>,
    /// The subset of `begun` that gave way before starting.
    unstarted: BTreeSet<(u32, u64)>,
}

impl<'m> TableProgress<'m> {
    /// Begins at the start of a journal, which may be whole or not.
    pub(super) fn new(task_set: &'m TaskSet, lists: &'m CoreLists<'m>, is_whole: bool) -> Self {
        let of_core = |core: &CoreId| {
            let list = &lists.lists[core];
            let laps = list
                .iter()
                .map(|(entry, jobs)| task_set.dag(entry.dag).first_job() / jobs);
            let first = laps.min().unwrap_or(0).saturating_mul(list.len() as u64);
            let position = ListPosition {
                next: is_whole.then_some(first),
                ..ListPosition::default()
            };
            (*core, position)
        };
        Self {
            task_set,
            lists,
            cores: lists.lists.keys().map(of_core).collect(),
            voids: BTreeSet::new(),
            ended: BTreeSet::new(),
        }
    }

    /// Returns the instance of its table that a core should run, if the instance is ready or has
    /// begun.
    pub(super) fn due(
        &self,
        core: CoreId,
        is_ready: impl Fn(Instance) -> bool,
    ) -> Option<Instance> {
        let position = self.cores.get(&core)?;
        let innermost = position.begun.last();
        let ahead = (position.next?..).take(self.lists.lists[&core].len());
        let ahead = ahead.map(|place| self.lists.entry(core, place));
        // A void entry is passed at the point where it might start.
        let mut open = ahead.take_while(|(_, depth)| innermost.is_none_or(|(it, _)| it < depth));
        let starts = open.find_map(|(of, _)| of.filter(|of| !self.is_void(*of)));
        match (starts.filter(|of| is_ready(*of)), innermost) {
            (Some(instance), _) => Some(instance),
            (None, inner) => self.lists.entry(core, inner?.1).0,
        }
    }

    fn is_void(&self, of: Instance) -> bool {
        let dag = self.task_set.dag(of.dag);
        let has = |subtask| self.voids.contains(&(of.dag, of.job, subtask));
        let is_beyond = of.job < dag.first_job() || dag.jobs().is_some_and(|jobs| of.job >= jobs);
        is_beyond || self.ended.contains(&of.dag) || has(None) || has(Some(of.subtask))
    }

    /// Judges an event; `is_ready` refers to the time before the event.
    pub(super) fn take(
        &mut self,
        event: &Event,
        is_ready: impl Fn(Instance) -> bool,
    ) -> Option<Violation> {
        let (core, jobs) = (event.core, self.lists.jobs.get(&event.dag));
        if let (EventKind::Skipped | EventKind::Cancelled, Some(jobs)) = (event.what, jobs) {
            let oldest = event.job.saturating_sub(jobs.saturating_mul(4));
            (self.voids).retain(|of| of.0 != event.dag || of.1 >= oldest);
            (self.voids).insert((event.dag, event.job, event.subtask));
        }
        let Some((of, depth)) = self.lists.place(event.instance()?) else {
            let is_on = matches!(event.what, EventKind::Start | EventKind::Resume);
            return is_on.then(|| self.innermost_but(event, (0, u64::MAX)))?;
        };
        let place = (depth, of.1);
        let position = self.cores.get_mut(&of.0)?;
        match event.what {
            EventKind::Start if of.0 == core => self.start(event, place, is_ready),
            EventKind::Resume if of.0 == core => {
                position.begun.insert(place);
                self.innermost_but(event, place)
            }
            EventKind::Finish | EventKind::Ended | EventKind::Cancelled => {
                position.begun.remove(&place);
                position.unstarted.remove(&place);
                None
            }
            _ => None,
        }
    }

    /// Ends a DAG: nothing of the DAG starts any more.
    pub(super) fn end_dag(&mut self, dag: DagId) {
        self.ended.insert(dag);
    }

    /// Judges the start of an entry on its core.
    fn start(
        &mut self,
        event: &Event,
        of: (u32, u64),
        is_ready: impl Fn(Instance) -> bool,
    ) -> Option<Violation> {
        let (core, (depth, place)) = (event.core, of);
        let list = &self.lists.lists[&core];
        let position = self.cores.get_mut(&core)?;
        let next = position.next.unwrap_or(place);
        position.next = Some(next.max(place.saturating_add(1)));
        let is_late = place < next && !position.unstarted.remove(&of);
        // One lap back is enough: a lap has entries of all depths.
        let passed = next.max(place.saturating_sub(list.len() as u64))..place;
        let mut first = is_late.then_some(next.saturating_sub(1));
        for before in passed {
            let (instance, outer) = self.lists.entry(core, before);
            // A void entry is passed at the point where it might start (T2).
            let open = position.begun.last().filter(|(inner, _)| *inner >= outer);
            first = first.or(open.map(|of| of.1));
            if outer < depth && instance.is_some_and(&is_ready) {
                position.begun.insert((outer, before));
                position.unstarted.insert((outer, before));
            }
        }
        position.begun.insert(of);
        match first {
            Some(first) => self.out_of_place(event, first),
            None => self.innermost_but(event, of),
        }
    }

    /// Returns the breach if an instance runs on a core where another entry has begun that goes
    /// first: any other entry at least as deep.
    fn innermost_but(&self, event: &Event, of: (u32, u64)) -> Option<Violation> {
        let position = self.cores.get(&event.core)?;
        let goes_first = |other: &&(u32, u64)| {
            **other != of && other.0 >= of.0 && !position.unstarted.contains(*other)
        };
        let first = position.begun.iter().rev().find(goes_first)?;
        self.out_of_place(event, first.1)
    }

    fn out_of_place(&self, event: &Event, first: u64) -> Option<Violation> {
        Some(Violation::OutOfPlace {
            event: *event,
            first: self.lists.entry(event.core, first).0?,
        })
    }
}
