//! The lists of the cores in tables (T1 to T3 of [`table`](crate::table)).
//!
//! Each such core has a list, the *position* of the next entry, and the entries begun there and not
//! finished. The *innermost* of them runs. An instance of a table's DAG never enters a line: for
//! its entry, the phase of the vertex is enough. So the next entry, the phase of its vertex and a
//! depth decide the core's action, however many instances are ready.
//!
//! # When a core is looked at
//!
//! Between two instants no core's next entry may start, and none may be passed, except where an
//! instance keeps its core. Only three events change this, and *touch* a core: its next entry
//! becomes ready; the instance running there ends, or begins a wait; or jobs are skipped or cut,
//! which touches all cores.
//!
//! # Begun for a moment
//!
//! Two consecutive entries may both be able to start at the same instant, the second on top of the
//! first. The first entry has then begun in its place, but its instance is still ready: the
//! instance starts when it gets the core. Until then a cut of its job cancels it.
//!
//! # Laps without work
//!
//! A step passes at most two laps of a list before it leaps to the next lap that may have work. A
//! list without such a lap has come to its end.
//!
//! # Links
//!
//! Most hops lead from an entry to the next entry on the list, where the second is the only
//! successor of the first, and the first the only predecessor of the second. Then neither a counter
//! nor the order decides anything: the core goes on.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::bits::BitSet;
use super::vertices::InstancePhase;
use super::{OWED, Scheduler};
use crate::ids::{ClusterId, CoreId, DagId, Instance, to_u32};
use crate::scheduler::key::DispatchKey;
use crate::table::{CoreList, Table, TableEntry};
use crate::task_set::TaskSet;

/// The mark for a place without a begun entry.
const NONE: u32 = u32::MAX;

/// The lists of a cluster's cores.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct ListTable {
    /// By core; without entries where no table has the core. Empty if no table has any core.
    lists: Box<[ListState]>,
    /// By vertex, the start of its cores in `cores`, and the number of its entries.
    rows: Box<[[u32; 2]]>,
    /// By vertex and job, the core of the entry.
    cores: Box<[CoreId]>,
    touched: BitSet,
}

/// A core's list and its progress, in one cache line.
#[derive(Clone, Debug, Default, Hash)]
#[repr(align(64))]
struct ListState {
    entries: Box<[ListEntry]>,
    /// The place of the next entry, or the place behind the last entry; larger if the list is over.
    position: usize,
    lap: u64,
    /// The depth of the innermost entry plus 1; 0: none has begun.
    open: u32,
    innermost: u32,
    /// By depth, the vertices of the other begun entries.
    below: Box<[u32]>,
}

#[derive(Clone, Copy, Debug, Hash)]
struct ListEntry {
    vertex: u32,
    depth: u32,
    /// The depth plus 1 if the entry is linked to the entry before; otherwise 0.
    link: u32,
    jobs_in_lap: u32,
    /// The number of the job in lap 0.
    job: i64,
}

impl ListTable {
    #[inline(never)]
    pub(super) fn new(task_set: &TaskSet, cluster: ClusterId, cores: u32) -> Self {
        let tables = task_set.tables().iter();
        let own: Vec<&Table> = tables.filter(|table| table.cluster == cluster).collect();
        if own.is_empty() {
            return Self::default();
        }
        let mut all = Self {
            lists: vec![ListState::default(); cores as usize].into(),
            rows: vec![[0; 2]; task_set.vertices()].into(),
            cores: Box::default(),
            touched: BitSet::new(cores as usize),
        };
        let mut count = 0;
        for table in &own {
            for dag in table.dags() {
                let jobs = u32::try_from(task_set.jobs_in_lap(table, dag));
                let jobs = jobs.expect("an entry each");
                let first = task_set.first_vertex(dag) as usize;
                for row in &mut all.rows[first..][..task_set.dag(dag).subtasks().len()] {
                    *row = [count, jobs];
                    count += jobs;
                }
            }
        }
        all.cores = vec![CoreId(0); count as usize].into();
        for list in own.iter().flat_map(|table| &table.lists) {
            let state = ListState::new(task_set, list, &all.rows);
            for entry in &state.entries {
                let place = all.place(entry.vertex, entry.job);
                all.cores[place] = CoreId(list.core);
            }
            all.lists[list.core as usize] = state;
        }
        // Nobody has looked at the lists yet, and their first entries may be void (T2).
        all.touch_all();
        all
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.lists.is_empty()
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "below a u32"
    )]
    fn place(&self, vertex: u32, job: i64) -> usize {
        let [first, count] = self.rows[vertex as usize];
        // Euclidean, since jobs before the first one have negative numbers.
        first as usize + job.rem_euclid(count.into()) as usize
    }

    /// Reports whether a table has the core.
    #[inline]
    pub(super) fn has(&self, core: CoreId) -> bool {
        let list = self.lists.get(core.index());
        list.is_some_and(|list| !list.entries.is_empty())
    }

    /// Returns the vertex of the innermost begun entry on a core.
    #[inline]
    pub(super) fn innermost(&self, core: CoreId) -> Option<u32> {
        let list = self.lists.get(core.index())?;
        (list.open > 0).then_some(list.innermost)
    }

    pub(super) fn touch_all(&mut self) {
        for core in 0..self.lists.len() {
            if !self.lists[core].entries.is_empty() {
                self.touched.insert(core);
            }
        }
    }

    /// Touches the core of an instance that has become ready, if its entry is the next there.
    #[inline]
    pub(super) fn make_ready(&mut self, vertex: u32, job: u64) {
        let job = job.cast_signed();
        let core = self.cores[self.place(vertex, job)].index();
        let list = &mut self.lists[core];
        // If a begun entry is in the way, the end of that entry touches the core.
        let is_next = list.next().is_some_and(|(entry, next)| {
            (entry.vertex, next) == (vertex, job) && list.open <= entry.depth
        });
        if is_next {
            self.touched.insert(core);
        }
    }

    /// Reports whether any core is touched other than this core, the next to be looked at.
    #[inline]
    pub(super) fn touches_others(&mut self, core: CoreId) -> bool {
        self.touched.remove(core.index());
        !self.touched.is_empty()
    }

    /// Takes note that an instance of a vertex has ended on a core.
    #[inline]
    pub(super) fn end(&mut self, core: CoreId, vertex: u32) {
        if self.has(core) {
            self.lists[core.index()].remove(vertex);
            self.touched.insert(core.index());
        }
    }

    /// Likewise, for an instance without a core, if its entry has begun.
    pub(super) fn end_of(&mut self, vertex: u32, job: u64) {
        let core = self.cores[self.place(vertex, job.cast_signed())];
        self.end(core, vertex);
    }

    /// Returns the list of a core, and the vertex of the next entry, if that entry is linked to the
    /// innermost, which is ending.
    ///
    /// The depths prove that the innermost entry is the entry before: any other would have been in
    /// the way of the entry before.
    #[inline(always)]
    fn linked(&mut self, core: CoreId) -> Option<(&mut ListState, u32)> {
        let list = self.lists.get_mut(core.index())?;
        let entry = list.entries.get(list.position)?;
        let vertex = entry.vertex;
        (entry.link == list.open).then_some((list, vertex))
    }
}

impl ListState {
    fn new(task_set: &TaskSet, list: &CoreList, rows: &[[u32; 2]]) -> Self {
        let stated = &list.entries;
        let is_linked = |place: usize| {
            let (before, entry) = (&stated[place.checked_sub(1)?], &stated[place]);
            let after = &stated[(place + 1) % stated.len()];
            let of = |entry: &TableEntry| (entry.dag, entry.job, entry.depth);
            let (dag, [from, to]) = (task_set.dag(entry.dag), [before.subtask, entry.subtask]);
            // The same DAG is checked first, before the neighbours are looked up in it.
            let is_link = of(before) == of(entry)
                && after.depth <= entry.depth
                && dag.successors(from) == [to]
                && dag.predecessors(to) == [from];
            is_link.then_some(())
        };
        let entries = (0..).zip(stated).map(|(place, entry)| {
            let vertex = task_set.first_vertex(entry.dag) + entry.subtask.0;
            ListEntry {
                vertex,
                depth: entry.depth,
                link: is_linked(place).map_or(0, |()| entry.depth + 1),
                jobs_in_lap: rows[vertex as usize][1],
                job: entry.job,
            }
        });
        let deepest = stated.iter().map(|entry| entry.depth).max().unwrap_or(0);
        Self {
            entries: entries.collect(),
            innermost: NONE,
            below: vec![NONE; deepest as usize].into(),
            ..Self::default()
        }
    }

    /// Returns the next entry, and its job in the present lap.
    #[inline]
    fn next(&mut self) -> Option<(ListEntry, i64)> {
        if self.position == self.entries.len() {
            (self.position, self.lap) = (0, self.lap + 1);
        }
        let entry = self.entries.get(self.position)?;
        Some((*entry, entry.job_in(self.lap)))
    }

    /// Begins the next entry, on top of the innermost entry.
    fn begin(&mut self, entry: ListEntry) {
        if self.open > 0 {
            self.below[self.open as usize - 1] = self.innermost;
        }
        (self.innermost, self.open) = (entry.vertex, entry.depth + 1);
        self.position += 1;
    }

    /// Takes a vertex out of the begun entries, if it is there.
    fn remove(&mut self, vertex: u32) {
        // An entry below the innermost may end first: it may finish before the machine takes its
        // core away, or be cancelled. Its place is passed over when those above have ended.
        if self.innermost != vertex {
            let place = self.below.iter_mut().find(|below| **below == vertex);
            place.into_iter().for_each(|place| *place = NONE);
            return;
        }
        self.innermost = NONE;
        while self.open > 0 && self.innermost == NONE {
            self.open -= 1;
            if let Some(depth) = (self.open as usize).checked_sub(1) {
                self.innermost = core::mem::replace(&mut self.below[depth], NONE);
            }
        }
    }
}

impl ListEntry {
    #[inline]
    fn job_in(&self, lap: u64) -> i64 {
        let later = lap.wrapping_mul(self.jobs_in_lap.into());
        self.job.wrapping_add_unsigned(later)
    }

    /// Returns the number of laps, from this lap on, before the first lap in which the entry's job
    /// may start. `next` finds the next job that may.
    fn laps_until(&self, lap: u64, next: impl Fn(i64) -> Option<u64>) -> Option<u64> {
        let job = self.job_in(lap);
        let left = next(job)?.cast_signed().saturating_sub(job);
        Some(left.unsigned_abs().div_ceil(self.jobs_in_lap.into()))
    }
}

impl Scheduler {
    /// Ends an instance of a DAG with one slot on a core, and begins the next entry there, if both
    /// are linked. Returns the entry's vertex and its instance.
    #[inline(always)]
    pub(super) fn hop_in_list(&mut self, core: CoreId, vertex: u32) -> Option<(u32, Instance)> {
        let (list, next) = self.ready.lists.linked(core)?;
        // All data is found before anything is written, so that nothing has to be looked up again.
        let instance = self.vertices.hand_over(vertex, next, core)?;
        list.position += 1;
        list.innermost = next;
        Some((next, instance))
    }

    /// Touches all cores with lists, because jobs have been skipped or cut.
    #[inline]
    pub(super) fn touch_lists(&mut self) {
        if !self.ready.lists.is_empty() {
            self.ready.lists.touch_all();
            // The short way must not be taken before the touched cores have been looked at.
            self.fresh |= OWED;
        }
    }

    /// Gives the touched cores to their innermost begun entries (T1 to T3).
    pub(super) fn decide_lists(&mut self) {
        while !self.ready.lists.touched.is_empty() {
            let core = CoreId(to_u32(self.ready.lists.touched.first()));
            let running = self.runs(core);
            let Some(entry) = self.follow(core) else {
                continue;
            };
            match (running, self.cores.running(core)) {
                (Some(running), _) if running == entry => continue,
                (Some(running), Some(key)) => {
                    // An entry enters no line, so only the vertex of its key counts.
                    let key = match key == DispatchKey::ENTRY {
                        true => DispatchKey::of_rank(0, running),
                        false => key,
                    };
                    self.preempt(core, key);
                    // A member back in line may be for another core (T4).
                    self.fresh += 1;
                }
                // The core was idle: it leaves the idle stack, so that no line gets it.
                _ => _ = self.cores.take_idle_of(&[core]),
            }
            let decision = self.give_to_entry(core, entry);
            self.decisions.push(decision);
        }
    }

    /// Returns the vertex of the instance that a core executes.
    #[inline]
    pub(super) fn runs(&self, core: CoreId) -> Option<u32> {
        let key = self.cores.running(core)?;
        match key == DispatchKey::ENTRY {
            true => self.ready.lists.innermost(core),
            false => Some(key.vertex()),
        }
    }

    /// Begins and passes the next entries of a core as far as they may start (T1, T2). Returns the
    /// vertex of the innermost entry.
    pub(super) fn follow(&mut self, core: CoreId) -> Option<u32> {
        let Self {
            vertices,
            dags,
            task_set,
            ready,
            cores,
            ..
        } = self;
        let lists = &mut ready.lists;
        let list = lists.lists.get_mut(core.index())?;
        lists.touched.remove(core.index());
        let is_here = |vertex: &u32| vertices.get(*vertex).phase == InstancePhase::Running(core);
        let member = cores.running(core).filter(|key| *key != DispatchKey::ENTRY);
        let member = member.map(DispatchKey::vertex).filter(is_here);
        // A member that keeps its core keeps the core from entries, too (T4).
        let mut top = (list.open > 0).then_some(list.innermost).or(member);
        let mut passed = 0;
        while top.is_none_or(|top| vertices.get(top).is_preemptible)
            && let Some((entry, job)) = list.next()
            && list.open <= entry.depth
        {
            let vertex = vertices.get(entry.vertex);
            let jobs = |of: DagId| (&dags[of.index()].jobs, task_set.dag(of));
            let (own, model) = jobs(vertex.dag);
            if vertex.phase == InstancePhase::Ready && vertex.job.cast_signed() == job {
                list.begin(entry);
                vertices.begin_entry(entry.vertex);
                top = Some(entry.vertex);
            } else if own.may_start(model, job, vertex.progress) {
                // The entry's job may start later: the list waits here, because entries start in
                // order (T1).
                break;
            } else {
                list.position += 1;
                passed += 1;
                // A whole lap without work: leap, because passing lap by lap would have no bound.
                if list.position == list.entries.len() && passed >= list.position {
                    let lap = list.lap + 1;
                    let laps = list.entries.iter().filter_map(|entry| {
                        let (own, model) = jobs(vertices.get(entry.vertex).dag);
                        entry.laps_until(lap, |job| own.next_open(model, job))
                    });
                    match laps.min() {
                        Some(laps) => list.lap += laps,
                        None => list.position = usize::MAX,
                    }
                }
            }
        }
        (list.open > 0).then_some(list.innermost)
    }
}
