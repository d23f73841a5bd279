//! R5: did the right instances run?
//!
//! At every instant, the rule says for each cluster which instances *should* run. With m cores in
//! the cluster, these are
//!
//! - the started instances that keep their cores;
//! - on each other core, the entry of its table that is due (T1, T3);
//! - among all other eligible instances, those with the smallest keys, until m instances are
//!   reached.
//!
//! Where DAGs have affinities, the last point is valid for each group of cores by itself, and for
//! the instances of the group's DAGs.
//!
//! An eligible instance that should run but does not is *owed* a core. In virtual time this state
//! never lasts. On a machine its length is never 0: the scheduler is told, decides, and interrupts
//! a core. So waiting is a breach only beyond a stated *bound*. The blame names the situation when
//! the bound was exceeded: a running instance of lower priority, or an idle core.
//!
//! The sweep also judges each start of an instance that will keep its core. Every instance of
//! higher priority waiting for longer than the bound must have an idle core to go to, and no entry
//! may be due on the core of the start. Without this check, a wrong choice would show only for the
//! time taken by making it. Where times are exact, the check includes instances waiting since an
//! earlier event, even an event at the same instant.
//!
//! A sweep takes changes one after the other and keeps only waiting and running instances, so it
//! judges a run of any length.
//!
//! Not checked: the order of events within one instant. An instance that executes for no time is
//! eligible and gone at one instant, so its order among others is not seen.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;
use core::ops::Range;

use super::tables::{CoreLists, TableProgress};
use super::{JudgeOptions, Violation};
use crate::ids::{CoreId, DagId, Instance};
use crate::journal::Event;
use crate::policies::SchedulerOptions;
use crate::policy::Preemption;
use crate::task_set::TaskSet;

/// The key of R5: the smaller key goes first. No two instances have the same key.
pub(super) type Key = (u64, Instance);

/// The model and the options of a run, and the cores of the current cluster.
pub(super) struct DispatchModel<'a> {
    pub(super) task_set: &'a TaskSet,
    pub(super) options: &'a SchedulerOptions,
    /// The policy's number, by DAG and subtask.
    pub(super) numbers: Vec<Vec<u64>>,
    pub(super) cores: Range<u32>,
    /// The affinities of its DAGs, without duplicates.
    pub(super) groups: Vec<&'a [u32]>,
    pub(super) lists: CoreLists<'a>,
    /// When sporadic jobs were due, in nanoseconds.
    pub(super) due_ns: BTreeMap<(DagId, u64), u64>,
}

/// The cores that may execute an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place<'a> {
    /// The core of its entry in a table.
    Core(CoreId),
    /// The cores of its DAG's affinity.
    Group(&'a [u32]),
}

impl<'a> DispatchModel<'a> {
    /// Returns the key of an instance: (the policy's number, plus the job's release if the policy
    /// adds it, DAG, job, subtask).
    pub(super) fn key(&self, instance: Instance) -> Key {
        let Instance { dag, job, subtask } = instance;
        let model = self.task_set.dag(dag);
        let number = self.numbers[dag.index()][subtask.index()];
        if !self.options.policy.adds_release() {
            return (number, instance);
        }
        let due_ns = self.due_ns.get(&(dag, job)).copied();
        // A sporadic job with a lost signal gets the least urgent key, so it is blamed for nothing.
        let release_ns = model.release_ns(job, due_ns.unwrap_or(u64::MAX));
        (release_ns.saturating_add(number), instance)
    }

    /// Returns the cores that may execute an instance.
    pub(super) fn place(&self, instance: Instance) -> Place<'a> {
        match self.lists.place(instance) {
            Some(((core, _), _)) => Place::Core(core),
            None => Place::Group(self.task_set.dag(instance.dag).affinity()),
        }
    }

    /// Reports whether a core belongs to an affinity.
    pub(super) fn is_of(&self, group: &[u32], core: CoreId) -> bool {
        let number = core.0.checked_sub(self.cores.start);
        group.is_empty() || number.is_some_and(|number| group.contains(&number))
    }

    /// Reports whether a started instance keeps its core until it finishes.
    pub(super) fn keeps_its_core(&self, instance: Instance) -> bool {
        let dag = self.task_set.dag(instance.dag);
        self.options.preemption == Preemption::Disabled
            || dag.subtask(instance.subtask).is_non_preemptive()
    }
}

/// The state of an instance for the dispatch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DispatchState {
    /// No event has made the instance ready yet.
    #[default]
    Absent,
    /// The instance waits for a core and has not started.
    Ready,
    /// The instance runs.
    Running(CoreId),
    /// The instance waits for a core and has started.
    Suspended,
    /// The instance has started, and its wait has not ended.
    Waiting,
    /// The instance has finished, or will never run.
    Over,
}

/// The reason for a breach: a running instance, or an idle core, while another instance should run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DispatchFault {
    /// An instance, on this core.
    Runs(Instance, CoreId),
    /// A core is idle: the first idle core, or `None` if unknown.
    Idle(Option<CoreId>),
}

/// A breach of R5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DispatchBreach {
    /// The instance was owed a core for too long.
    Waits {
        /// The instance.
        waiting: Instance,
        /// Since when.
        since_ns: u64,
        /// For how long.
        length_ns: u64,
        /// The instance that ran meanwhile, or the core that idled.
        blame: DispatchFault,
    },
    /// An instance started and keeps its core, although another instance goes first.
    OutOfTurn {
        /// The instance.
        started: Instance,
        /// Its core.
        core: CoreId,
        /// When it started.
        at_ns: u64,
        /// The instance that goes first.
        first: Instance,
        /// Since when the first instance has been waiting.
        since_ns: u64,
    },
}

/// Waiting times measured during the judgement of R5, besides breaches.
#[derive(Clone, Debug, Default)]
pub struct WaitCounts {
    /// The longest time for which an instance was owed a core.
    pub longest_owed_ns: u64,
    /// From readiness to start, for instances that found an idle core and were not overtaken.
    pub ready_to_start_ns: Vec<u64>,
}

#[derive(Clone, Copy, Debug)]
struct OwedDispatch {
    since_ns: u64,
    /// Whether the instance has just become ready and found an idle core.
    finds_idle_core: bool,
    blame: Option<DispatchFault>,
}

/// The state of the dispatch at an instant.
pub(super) struct DispatchSweep<'m> {
    model: &'m DispatchModel<'m>,
    bound_ns: u64,
    now_ns: u64,
    /// The cores known to be busy or idle.
    pub(super) known_cores: BTreeSet<CoreId>,
    /// The number of events so far.
    events: u64,
    /// For each waiting instance: since when it waits, and since which event.
    waiting: BTreeMap<Key, (u64, u64)>,
    running: BTreeMap<Key, CoreId>,
    ended_dags: BTreeSet<DagId>,
    owed: BTreeMap<Key, OwedDispatch>,
    /// The instances that became ready at this instant; below, those that started.
    fresh: Vec<Key>,
    started: Vec<(Key, CoreId, u64)>,
    /// Keys of instances that have not started yet.
    unstarted: BTreeSet<Key>,
    wrong: Vec<DispatchBreach>,
    waits: &'m mut WaitCounts,
    tables: TableProgress<'m>,
}

impl<'m> DispatchSweep<'m> {
    /// Begins at an instant; measured waits are added to `waits`.
    pub(super) fn new(
        model: &'m DispatchModel<'m>,
        terms: JudgeOptions,
        now_ns: u64,
        waits: &'m mut WaitCounts,
    ) -> Self {
        Self {
            model,
            bound_ns: terms.tolerance_ns,
            now_ns,
            known_cores: BTreeSet::new(),
            events: 0,
            waiting: BTreeMap::new(),
            running: BTreeMap::new(),
            ended_dags: BTreeSet::new(),
            owed: BTreeMap::new(),
            fresh: Vec::new(),
            started: Vec::new(),
            unstarted: BTreeSet::new(),
            wrong: Vec::new(),
            waits,
            tables: TableProgress::new(model.task_set, &model.lists, terms.is_whole),
        }
    }

    /// Judges the time from now until an instant; a past instant counts as now.
    pub(super) fn go_on_to(&mut self, until_ns: u64) {
        // Only a stretch of time is settled: within an instant, the order of events says nothing
        // about the dispatch.
        if until_ns > self.now_ns {
            self.settle(until_ns);
            self.now_ns = until_ns;
        }
    }

    /// Judges the rest, up to the run's end.
    pub(super) fn finish(mut self, end_ns: u64) -> Vec<DispatchBreach> {
        self.settle(end_ns);
        self.now_ns = end_ns;
        for (key, owed) in core::mem::take(&mut self.owed) {
            self.close(key, &owed);
        }
        self.wrong
    }

    /// Ends a DAG: its waiting instances are owed nothing any more.
    pub(super) fn end_dag(&mut self, dag: DagId) {
        // E3: unstarted instances never start; started instances may go on.
        self.waiting.retain(|(_, instance), _| instance.dag != dag);
        self.ended_dags.insert(dag);
        self.tables.end_dag(dag);
    }

    /// Moves an instance to a stage.
    pub(super) fn enter(&mut self, instance: Instance, stage: DispatchState) {
        let key = self.model.key(instance);
        self.events += 1;
        let since = (self.now_ns, self.events);
        self.waiting.remove(&key);
        self.running.remove(&key);
        // A driver may take a started instance of an ended DAG away for good (E4).
        let is_owed_nothing = self.ended_dags.contains(&key.1.dag);
        let is_first = self.unstarted.remove(&key);
        match stage {
            DispatchState::Ready | DispatchState::Suspended if is_owed_nothing => {}
            DispatchState::Ready => {
                self.waiting.insert(key, since);
                // Remembered, since a non-preemptive instance is judged at its start only.
                self.unstarted.insert(key);
                self.fresh.push(key);
            }
            DispatchState::Suspended => {
                self.waiting.insert(key, since);
                // Its next segment keeps the core, so its resume is judged like a start.
                if self.model.keeps_its_core(instance) {
                    self.unstarted.insert(key);
                }
            }
            DispatchState::Running(core) => {
                self.running.insert(key, core);
                if is_first {
                    self.started.push((key, core, self.events));
                }
            }
            DispatchState::Absent | DispatchState::Waiting | DispatchState::Over => {}
        }
    }

    /// Judges the time from now until `until_ns`, during which nothing changes.
    fn settle(&mut self, until_ns: u64) {
        // An unseen core may not exist: only cores seen so far count.
        let claims = self.claims();
        for place in 0..self.started.len() {
            let wrong = self.out_of_turn(self.started[place], &claims);
            self.wrong.extend(wrong);
        }
        let should_run = self.should_run(&claims);
        let past = |key: &Key| should_run.iter().all(|(owed, _)| owed != key);
        let over: Vec<Key> = self.owed.keys().copied().filter(past).collect();
        for key in over {
            if let Some(owed) = self.owed.remove(&key) {
                self.close(key, &owed);
            }
        }
        for &(ref key, has_idle_core) in &should_run {
            let since_ns = self.owed.get(key).map_or(self.now_ns, |owed| owed.since_ns);
            // The first look beyond the bound decides; finding a culprit costs a walk over all
            // cores.
            let has_blame = self.owed.get(key).is_some_and(|owed| owed.blame.is_some());
            let exceeds = since_ns.saturating_add(self.bound_ns) < until_ns;
            let blame = (exceeds && !has_blame).then(|| self.blame(*key, has_idle_core, &claims));
            let finds_idle_core = has_idle_core && self.fresh.contains(key);
            let owed = self.owed.entry(*key).or_insert(OwedDispatch {
                since_ns,
                finds_idle_core,
                blame: None,
            });
            owed.blame = owed.blame.or(blame);
        }
        self.fresh.clear();
        self.started.clear();
    }

    fn is_idle(&self, core: &CoreId) -> bool {
        self.running.values().all(|busy| busy != core)
    }

    /// Returns how many of the given cores belong to a group.
    fn count<'c>(&self, group: &[u32], cores: impl Iterator<Item = &'c CoreId>) -> usize {
        cores.filter(|core| self.model.is_of(group, **core)).count()
    }

    /// Returns how many cores of a group are idle and not claimed.
    fn idle(&self, group: &[u32], claims: &BTreeMap<CoreId, Key>) -> usize {
        let claimed = claims.keys().filter(|core| self.is_idle(core));
        let taken = self.count(group, self.running.values().chain(claimed));
        (self.count(group, self.known_cores.iter())).saturating_sub(taken)
    }

    /// Checks an event against the tables, before its instance enters a stage.
    pub(super) fn take_entry(&mut self, event: &Event) -> Option<Violation> {
        let Self {
            tables,
            waiting,
            model,
            ..
        } = self;
        tables.take(event, |of| waiting.contains_key(&model.key(of)))
    }

    /// Returns, by core, the entry that is due and ready there. Cores kept by an instance are left
    /// out.
    fn claims(&self) -> BTreeMap<CoreId, Key> {
        let mut claims = self.due();
        let kept = (self.running.iter()).filter(|(key, _)| self.model.keeps_its_core(key.1));
        for (_, core) in kept {
            claims.remove(core);
        }
        claims
    }

    fn due(&self) -> BTreeMap<CoreId, Key> {
        let is_ready = |of| self.waiting.contains_key(&self.model.key(of));
        let due = self.known_cores.iter().filter_map(|core| {
            let key = self.model.key(self.tables.due(*core, is_ready)?);
            let is_there = self.waiting.contains_key(&key) || self.running.contains_key(&key);
            is_there.then_some((*core, key))
        });
        due.collect()
    }

    /// Returns the waiting instances that should run, and whether a core is idle for each: first
    /// the entries, then the others, group by group in the order of keys.
    fn should_run(&self, claims: &BTreeMap<CoreId, Key>) -> Vec<(Key, bool)> {
        let claimed = claims.iter();
        let claimed = claimed.filter(|(_, key)| self.waiting.contains_key(key));
        let mut owed: Vec<_> = claimed
            .map(|(core, key)| (*key, self.is_idle(core)))
            .collect();
        for group in &self.model.groups {
            self.add_owed(group, claims, &mut owed);
        }
        owed
    }

    /// Adds the waiting instances of a group that should run.
    fn add_owed(&self, group: &[u32], claims: &BTreeMap<CoreId, Key>, owed: &mut Vec<(Key, bool)>) {
        let is_of_it = |key: &Key| self.model.place(key.1) == Place::Group(group);
        let kept = (self.running.iter()).filter(|(key, _)| self.model.keeps_its_core(key.1));
        // An instance that keeps its core has it whatever waits; the others share the rest.
        let taken = self.count(group, claims.keys().chain(kept.map(|(_, core)| core)));
        let free = self.count(group, self.known_cores.iter());
        let movable = self.running.keys().filter(|key| is_of_it(key));
        let mut movable = movable
            .filter(|key| !self.model.keeps_its_core(key.1))
            .peekable();
        let mut waiting = self.waiting.keys().filter(|key| is_of_it(key)).peekable();
        let mut idle = self.idle(group, claims);
        for _ in taken..free {
            match (waiting.peek(), movable.peek()) {
                // A running instance that goes first has its core by right.
                (Some(waits), Some(runs)) if runs < waits => {
                    movable.next();
                }
                (Some(waits), _) => {
                    owed.push((**waits, idle > 0));
                    idle = idle.saturating_sub(1);
                    waiting.next();
                }
                (None, _) => break,
            }
        }
    }

    /// Finds the cause of a wait: the instance running instead of an owed instance, or an idle
    /// core.
    fn blame(&self, owed: Key, is_idle: bool, claims: &BTreeMap<CoreId, Key>) -> DispatchFault {
        let place = self.model.place(owed.1);
        let mut running = self.running.iter().rev();
        let movable = running.find(|(key, core)| match place {
            Place::Core(own) => **core == own,
            Place::Group(_) => {
                !self.model.keeps_its_core(key.1) && self.model.place(key.1) == place
            }
        });
        match movable {
            // The least urgent instance is to blame: a dispatch would have preempted it.
            Some((key, core)) if !is_idle => DispatchFault::Runs(key.1, *core),
            _ => {
                let is_left = |core: &CoreId| self.is_idle(core) && !claims.contains_key(core);
                let cores = self.model.cores.start..;
                let mut cores = cores.take(self.known_cores.len()).map(CoreId);
                DispatchFault::Idle(match place {
                    Place::Core(own) => Some(own),
                    Place::Group(group) => {
                        cores.find(|core| self.model.is_of(group, *core) && is_left(core))
                    }
                })
            }
        }
    }

    /// Closes the record of an instance that is owed nothing any more.
    fn close(&mut self, key: Key, owed: &OwedDispatch) {
        let length_ns = self.now_ns.saturating_sub(owed.since_ns);
        self.waits.longest_owed_ns = self.waits.longest_owed_ns.max(length_ns);
        let mut started = self.started.iter();
        // Started, and not overtaken: only then is the time due to the wake-up alone.
        if owed.finds_idle_core && started.any(|(started, ..)| *started == key) {
            self.waits.ready_to_start_ns.push(length_ns);
        }
        if length_ns > self.bound_ns {
            self.wrong.push(DispatchBreach::Waits {
                waiting: key.1,
                since_ns: owed.since_ns,
                length_ns,
                blame: owed.blame.unwrap_or(DispatchFault::Idle(None)),
            });
        }
    }

    /// Judges the start of an instance that keeps its core from now on.
    fn out_of_turn(
        &self,
        (key, core, start): (Key, CoreId, u64),
        claims: &BTreeMap<CoreId, Key>,
    ) -> Option<DispatchBreach> {
        if !self.model.keeps_its_core(key.1) {
            return None;
        }
        // On a machine, an instance may have become ready after the other was already chosen.
        let is_before = |(since_ns, event): &(u64, u64)| {
            let longest_ns = self.now_ns.saturating_sub(*since_ns);
            longest_ns > self.bound_ns || self.bound_ns == 0 && *event < start
        };
        let of_place = |place: Place<'m>| {
            let before = self
                .waiting
                .iter()
                .filter(move |(_, since)| is_before(since));
            before.filter(move |(other, _)| self.model.place(other.1) == place)
        };
        // An entry that is due goes first; the order of entries is judged by their places.
        let due = || {
            let due = *self.due().get(&core)?;
            of_place(Place::Core(core)).find(|(other, _)| **other == due)
        };
        let found = match self.model.place(key.1) {
            Place::Core(_) => None,
            place @ Place::Group(group) => due().or_else(|| {
                let mut others = of_place(place).take_while(|(other, _)| **other < key);
                others.nth(self.idle(group, claims))
            }),
        };
        let (first, (since_ns, _)) = found?;
        Some(DispatchBreach::OutOfTurn {
            started: key.1,
            core,
            at_ns: self.now_ns,
            first: first.1,
            since_ns: *since_ns,
        })
    }
}
