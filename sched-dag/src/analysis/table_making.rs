//! Making a table: simulates one lap of a family of periodic DAGs on cores of their own.
//!
//! The instance with the least latest start goes first. The latest start is the deadline, less the
//! WCETs of the longest path after the instance, less its own WCET, and less a *boost* of its DAG,
//! 0 at first. The instance takes an idle core, preferably a core where a predecessor has just
//! ended. Without an idle core it is *nested*: it preempts a less urgent instance and starts on top
//! of it, on the core with the most slack. An instance that has begun never changes its core. If an
//! instance is late, its DAG is boosted by as much, and the next *try* begins. The *lazy* method
//! preempts only when waiting for a core would take too long.
//!
//! A lap *closes* if it leaves no more to the next lap than was assumed at its own beginning: cores
//! held at first, and subtasks with unfinished instances of the last jobs. If it leaves more, the
//! lap is simulated again with the new assumption.
//!
//! Guaranteed: a finished table is right (`docs/bounds.md`, "Tables"). Not guaranteed: that a table
//! is found whenever one exists.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use super::ratio::{greatest_common_divisor, sort_largest_first};
use super::task::Task;
use crate::ids::{ClusterId, DagId, SubtaskId, to_u32};
use crate::order::{sort_by_key, sorted_by_key};
use crate::policy::LendingAttempt;
use crate::table::{CoreList, Table, TableEntry};

/// The most tries for a number of cores, and the most repeated simulations for a lap to close.
const TRIES: u32 = 8;
const CLOSINGS: u32 = 4;

/// The most work for making the tables of a commit, in entries times cores: 2 s or less.
const WORK_LIMIT: u64 = 1 << 25;

/// The longest period and deadline in a family. Sums of a lap's times then fit into 63 bits.
const LONGEST_NS: u64 = 1 << 46;

/// Periodic DAGs that may share a table.
pub(super) struct TableFamily<'a> {
    tasks: &'a [&'a Task],
    /// The positions of the DAGs, ascending.
    pub(super) dags: Vec<usize>,
    pub(super) lap_ns: u64,
    count: usize,
    /// Ordered by DAG, then by job, then topologically.
    entries: Vec<FamilyEntry>,
    /// By DAG, the position of its first entry, and by subtask the place in the topological order.
    places: Vec<(usize, Vec<usize>)>,
    /// The work left of [`WORK_LIMIT`].
    work_left: u64,
}

struct FamilyEntry {
    /// The place of the DAG in the family.
    dag: usize,
    subtask: usize,
    job: u64,
    release_ns: i64,
    /// The latest finish.
    due_ns: i64,
    wcet_ns: i64,
    keeps_core: bool,
}

/// Why a lap has not made a table.
enum LapFailure {
    /// An entry of this DAG of the family is late by this many nanoseconds.
    Late(usize, i64),
    /// The lap does not close, or the work left does not suffice.
    Open,
}

impl<'a> TableFamily<'a> {
    /// Enters periodic DAGs as long as a lap has at most `limit` entries and no time exceeds
    /// [`LONGEST_NS`]: first those that cannot be members, then the densest.
    pub(super) fn of(tasks: &'a [&'a Task], limit: usize) -> Self {
        let is_periodic = |&dag: &usize| tasks[dag].table_terms().offset_ns.is_some();
        let mut order: Vec<usize> = (0..tasks.len()).filter(is_periodic).collect();
        sort_largest_first(&mut order, |dag| {
            (tasks[dag].volume_ns(), tasks[dag].within_ns())
        });
        sort_by_key(&mut order, |dag| may_be_member(tasks[dag]));
        let mut family = Self {
            tasks,
            dags: Vec::new(),
            lap_ns: 1,
            count: 0,
            entries: Vec::new(),
            places: Vec::new(),
            work_left: WORK_LIMIT,
        };
        for dag in order {
            family.enter(dag, limit);
        }
        family.dags.sort_unstable();
        for place in 0..family.dags.len() {
            family.add_entries(place);
        }
        family
    }

    fn enter(&mut self, dag: usize, limit: usize) {
        let (task, lap) = (self.tasks[dag], u128::from(self.lap_ns));
        let period = u128::from(task.period_ns());
        let lap = lap / greatest_common_divisor(lap, period) * period;
        let count = |dag: usize| {
            let task = self.tasks[dag];
            task.subtask_count() as u128 * (lap / u128::from(task.period_ns()))
        };
        let count = count(dag) + self.dags.iter().map(|&dag| count(dag)).sum::<u128>();
        let longest_ns = (task.volume_ns().max(task.relative_deadline_ns())).into();
        if count <= limit as u128 && lap.max(longest_ns) <= LONGEST_NS.into() {
            // Both are below their limits now.
            self.lap_ns = u64::try_from(lap).unwrap_or(u64::MAX);
            self.count = usize::try_from(count).unwrap_or(usize::MAX);
            self.dags.push(dag);
        }
    }

    fn add_entries(&mut self, place: usize) {
        let task = self.task(place);
        let order = least_first_order(task);
        let due_ns = latest_finishes_ns(task);
        let mut places = vec![0; order.len()];
        for (place, &subtask) in order.iter().enumerate() {
            places[subtask] = place;
        }
        self.places.push((self.entries.len(), places));
        for job in 0..self.jobs(place) {
            let release_ns = (phase_ns(task) + job * task.period_ns()).cast_signed();
            let entry = |&subtask: &usize| FamilyEntry {
                dag: place,
                subtask,
                job,
                release_ns,
                due_ns: release_ns + due_ns[subtask],
                wcet_ns: task.wcets_ns()[subtask].cast_signed(),
                keeps_core: task.table_terms().non_preemptive.contains(&subtask),
            };
            self.entries.extend(order.iter().map(entry));
        }
    }

    fn task(&self, place: usize) -> &'a Task {
        self.tasks[self.dags[place]]
    }

    /// Returns the jobs of a DAG in a lap.
    fn jobs(&self, place: usize) -> u64 {
        self.lap_ns / self.task(place).period_ns()
    }

    /// Returns the least number of cores with enough time for all entries.
    pub(super) fn least_cores(&self) -> usize {
        let entries = self.entries.iter();
        let work_ns: u64 = entries.map(|of| of.wcet_ns.cast_unsigned()).sum();
        usize::try_from(work_ns.div_ceil(self.lap_ns)).unwrap_or(usize::MAX)
    }

    /// Makes a table, and tells the number of the successful try. The error is the DAG that was
    /// late in the first try, if a DAG was late.
    pub(super) fn make(
        &mut self,
        cores: usize,
        method: LendingAttempt,
    ) -> Result<(Table, u32), Option<usize>> {
        let mut boosts_ns = vec![0; self.dags.len()];
        let mut first_late = None;
        for tried in 1..=TRIES {
            let key_ns = |entry: usize| {
                let of = &self.entries[entry];
                of.due_ns - of.wcet_ns - boosts_ns[of.dag]
            };
            let order = sorted_by_key(self.count, key_ns);
            let keys_ns = (0..self.count).map(key_ns).collect();
            let mut ranks = vec![0; self.count];
            for (rank, &entry) in order.iter().enumerate() {
                ranks[entry] = rank;
            }
            let by = LapOrder {
                order,
                ranks,
                keys_ns,
                method,
            };
            match self.close(&by, cores) {
                Ok(lap) => return Ok((self.table(&lap), tried)),
                // More tries would not help: the boosts change only after a late entry.
                Err(LapFailure::Open) => break,
                Err(LapFailure::Late(place, by_ns)) => {
                    first_late.get_or_insert(self.dags[place]);
                    boosts_ns[place] += by_ns;
                }
            }
        }
        Err(first_late)
    }

    /// Simulates a lap until it closes.
    fn close(&mut self, by: &LapOrder, cores: usize) -> Result<Lap, LapFailure> {
        let mut held_ns = vec![0; cores];
        let mut after_ns = vec![0; self.count];
        for _ in 0..=CLOSINGS {
            let work = (self.count * (cores + 8)) as u64;
            self.work_left = self.work_left.checked_sub(work).ok_or(LapFailure::Open)?;
            let lap = self.simulate(by, &held_ns, &after_ns)?;
            let lap_ns = self.lap_ns.cast_signed();
            let mut is_closed = true;
            let mut assume = |assumed_ns: &mut i64, found_ns: i64| {
                is_closed &= found_ns <= *assumed_ns;
                *assumed_ns = found_ns.max(*assumed_ns);
            };
            for (held_ns, core) in held_ns.iter_mut().zip(&lap.cores) {
                let finishes_ns = core.begun.iter().map(|&entry| lap.finishes_ns[entry]);
                assume(held_ns, finishes_ns.max().unwrap_or(0) - lap_ns);
            }
            for (place, (first, places)) in self.places.iter().enumerate() {
                let end = self.places.get(place + 1).map_or(self.count, |next| next.0);
                let last = end - places.len();
                // A subtask that ends after the lap holds up its first instance in the next lap.
                for subtask in 0..places.len() {
                    let found_ns = lap.finishes_ns[last + subtask] - lap_ns;
                    assume(&mut after_ns[first + subtask], found_ns);
                }
            }
            if is_closed {
                return Ok(lap);
            }
        }
        Err(LapFailure::Open)
    }

    /// Simulates one lap with WCETs. Cores are held, and entries wait, until the given times.
    fn simulate(
        &self,
        by: &LapOrder,
        held_ns: &[i64],
        after_ns: &[i64],
    ) -> Result<Lap, LapFailure> {
        let mut lap = Lap::of(&self.entries, held_ns);
        let mut missing = vec![0; self.count];
        // The times each entry waits for; without an entry, a core is held until then.
        let mut times: Vec<(i64, usize)> = held_ns.iter().map(|&ns| (ns, self.count)).collect();
        for (entry, of) in self.entries.iter().enumerate() {
            let before = self.predecessors(of).len();
            missing[entry] = before + usize::from(of.job > 0);
            let release = (before == 0).then_some(of.release_ns);
            let after = Some(after_ns[entry]).filter(|&ns| ns > 0);
            for ns in release.into_iter().chain(after) {
                missing[entry] += 1;
                times.push((ns, entry));
            }
        }
        let due = sorted_by_key(times.len(), |place| times[place].0);
        let mut due = due.into_iter().map(|place| times[place]).peekable();
        let mut ready = BinaryHeap::new();
        let mut now_ns = 0;
        loop {
            let mut arrive = |entry: usize| {
                missing[entry] -= 1;
                if missing[entry] == 0 {
                    ready.push((0, Reverse(by.ranks[entry])));
                }
            };
            for core in 0..lap.cores.len() {
                if let Some(entry) = lap.complete(core, now_ns) {
                    let of = &self.entries[entry];
                    if now_ns > of.due_ns {
                        return Err(LapFailure::Late(of.dag, now_ns - of.due_ns));
                    }
                    self.after(entry).for_each(&mut arrive);
                }
            }
            while let Some((_, entry)) = due.next_if(|&(ns, _)| ns <= now_ns) {
                if entry < self.count {
                    arrive(entry);
                }
            }
            while let Some(&(_, Reverse(rank))) = ready.peek() {
                let entry = by.order[rank];
                let idle = self.idle_core(&lap, entry, now_ns);
                let Some(core) = idle.or_else(|| self.preempted_core(&lap, by, entry, now_ns))
                else {
                    break;
                };
                ready.pop();
                lap.start(entry, core, now_ns);
            }
            let completions = lap.running().map(|(_, entry)| now_ns + lap.left_ns[entry]);
            let Some(next_ns) = completions.chain(due.peek().map(|&(ns, _)| ns)).min() else {
                return Ok(lap);
            };
            lap.execute(next_ns - now_ns);
            now_ns = next_ns;
        }
    }

    fn predecessors(&self, of: &FamilyEntry) -> &'a [SubtaskId] {
        let graph = &self.task(of.dag).graph;
        graph.predecessors.neighbours(SubtaskId(to_u32(of.subtask)))
    }

    /// Returns the entries waiting for the end of an entry: its successors, and the same subtask in
    /// the next job.
    fn after(&self, entry: usize) -> impl Iterator<Item = usize> {
        let of = &self.entries[entry];
        let (first, places) = &self.places[of.dag];
        // The entries of a job follow one another.
        let job = entry - (entry - first) % places.len();
        let successors = self.task(of.dag).successors(of.subtask);
        let next_job = of.job + 1 < self.jobs(of.dag);
        let next = next_job.then_some(entry + places.len());
        (successors.map(move |subtask| job + places[subtask])).chain(next)
    }

    /// Returns the idle core for an entry: among the cores with a predecessor as the last entry,
    /// the core with the latest end; otherwise the first idle core.
    fn idle_core(&self, lap: &Lap, entry: usize, now_ns: i64) -> Option<usize> {
        let of = &self.entries[entry];
        let mut best: Option<(usize, i64)> = None;
        for (core, at) in lap.cores.iter().enumerate() {
            if !at.stack.is_empty() || at.held_until_ns > now_ns {
                continue;
            }
            let before = self.predecessors(of);
            let last = at.last.filter(|&last| {
                let last = &self.entries[last];
                let is_before = before.contains(&SubtaskId(to_u32(last.subtask)));
                is_before && (last.dag, last.job) == (of.dag, of.job)
            });
            // A core without a predecessor counts as ended before all others.
            let ended_ns = last.map_or(-1, |last| lap.finishes_ns[last]);
            if best.is_none_or(|(_, best_ns)| ended_ns > best_ns) {
                best = Some((core, ended_ns));
            }
        }
        best.map(|(core, _)| core)
    }

    /// Returns the core with the most slack among those where an entry may preempt.
    fn preempted_core(&self, lap: &Lap, by: &LapOrder, entry: usize, now_ns: i64) -> Option<usize> {
        let soonest_ns = lap.running().map(|(_, top)| lap.left_ns[top]).min()?;
        // Some core becomes free by the latest start, so no preemption is needed.
        if by.method == LendingAttempt::Lazy && now_ns + soonest_ns <= by.keys_ns[entry] {
            return None;
        }
        let mut best: Option<(usize, i64)> = None;
        for (core, top) in lap.running() {
            if by.ranks[top] < by.ranks[entry] || self.entries[top].keeps_core {
                continue;
            }
            let (mut left_ns, mut slack_ns) = (0, i64::MAX);
            for &begun in lap.cores[core].stack.iter().rev() {
                left_ns += lap.left_ns[begun];
                slack_ns = slack_ns.min(self.entries[begun].due_ns - now_ns - left_ns);
            }
            if best.is_none_or(|(_, best_ns)| slack_ns > best_ns) {
                best = Some((core, slack_ns));
            }
        }
        best.map(|(core, _)| core)
    }

    fn table(&self, lap: &Lap) -> Table {
        let lap_ns = self.lap_ns.cast_signed();
        let is_alone = self.dags.len() == 1;
        let mut lists = Vec::new();
        for (core, at) in (0..).zip(&lap.cores) {
            let mut entries = Vec::new();
            for &entry in &at.begun {
                let of = &self.entries[entry];
                let task = self.task(of.dag);
                let first = task.table_terms().offset_ns.unwrap_or(0) / task.period_ns();
                // In the table of a single DAG, times count from the DAG's release.
                let (origin_ns, first) = if is_alone {
                    (phase_ns(task), 0)
                } else {
                    (0, first)
                };
                let start_ns = lap.starts_ns[entry] - origin_ns.cast_signed();
                let later = start_ns.div_euclid(lap_ns);
                let jobs = self.jobs(of.dag).cast_signed();
                let made = TableEntry {
                    dag: DagId(to_u32(self.dags[of.dag])),
                    subtask: SubtaskId(to_u32(of.subtask)),
                    job: of.job.cast_signed() - later * jobs - first.cast_signed(),
                    depth: lap.depths[entry],
                    start_ns: start_ns.rem_euclid(lap_ns).cast_unsigned(),
                    length_ns: (lap.finishes_ns[entry] - lap.starts_ns[entry]).cast_unsigned(),
                };
                entries.push((later, made));
            }
            // Of entries with the same start, those of earlier laps come first.
            let order = sorted_by_key(entries.len(), |place| {
                (entries[place].1.start_ns, -entries[place].0)
            });
            if !order.is_empty() {
                lists.push(CoreList {
                    core,
                    entries: order.into_iter().map(|place| entries[place].1).collect(),
                });
            }
        }
        Table {
            cluster: ClusterId(0),
            lap_ns: self.lap_ns,
            lists: lists.into(),
        }
    }
}

/// The urgency of a lap's entries.
struct LapOrder {
    /// The entries, the most urgent first.
    order: Vec<usize>,
    /// By entry, its place in the order.
    ranks: Vec<usize>,
    keys_ns: Vec<i64>,
    method: LendingAttempt,
}

/// A lap, as far as it is simulated.
struct Lap {
    cores: Vec<LapCore>,
    /// By entry, like the following fields.
    left_ns: Vec<i64>,
    starts_ns: Vec<i64>,
    finishes_ns: Vec<i64>,
    depths: Vec<u32>,
}

struct LapCore {
    held_until_ns: i64,
    /// The entries that have begun and not finished.
    stack: Vec<usize>,
    /// All entries that have begun, in the order of their starts.
    begun: Vec<usize>,
    /// The entry that ended last.
    last: Option<usize>,
}

impl Lap {
    fn of(entries: &[FamilyEntry], held_ns: &[i64]) -> Self {
        let core = |&held_until_ns: &i64| LapCore {
            held_until_ns,
            stack: Vec::new(),
            begun: Vec::new(),
            last: None,
        };
        Self {
            cores: held_ns.iter().map(core).collect(),
            left_ns: entries.iter().map(|of| of.wcet_ns).collect(),
            starts_ns: vec![0; entries.len()],
            finishes_ns: vec![0; entries.len()],
            depths: vec![0; entries.len()],
        }
    }

    fn start(&mut self, entry: usize, core: usize, now_ns: i64) {
        let at = &mut self.cores[core];
        self.starts_ns[entry] = now_ns;
        self.depths[entry] = to_u32(at.stack.len());
        at.stack.push(entry);
        at.begun.push(entry);
    }

    /// Ends the entry on top of a core if it has executed to its end.
    fn complete(&mut self, core: usize, now_ns: i64) -> Option<usize> {
        let at = &mut self.cores[core];
        let entry = at.stack.pop_if(|&mut top| self.left_ns[top] == 0)?;
        at.last = Some(entry);
        self.finishes_ns[entry] = now_ns;
        Some(entry)
    }

    /// Returns each executing core with its entry.
    fn running(&self) -> impl Iterator<Item = (usize, usize)> {
        let cores = self.cores.iter().enumerate();
        cores.filter_map(|(core, at)| Some((core, *at.stack.last()?)))
    }

    fn execute(&mut self, time_ns: i64) {
        for core in &self.cores {
            if let Some(&top) = core.stack.last() {
                self.left_ns[top] -= time_ns;
            }
        }
    }
}

/// Reports whether a DAG can execute in the time left by tables.
pub(super) fn may_be_member(task: &Task) -> bool {
    let terms = task.table_terms();
    terms.non_preemptive.is_empty() && terms.sink_deadlines_ns.is_empty()
}

/// Returns the DAG's first release from the origin of the grid on.
fn phase_ns(task: &Task) -> u64 {
    task.table_terms().offset_ns.unwrap_or(0) % task.period_ns()
}

/// Returns the latest finish of each subtask, after the release, for all successors to be in time.
fn latest_finishes_ns(task: &Task) -> Vec<i64> {
    let deadline_ns = task.relative_deadline_ns().cast_signed();
    let mut latest_ns = vec![deadline_ns; task.subtask_count()];
    for &(sink, own_ns) in &task.table_terms().sink_deadlines_ns {
        latest_ns[sink] = own_ns.cast_signed();
    }
    for subtask in task.topological_order().rev() {
        let starts = task.successors(subtask);
        let starts_ns = starts.map(|next| latest_ns[next] - task.wcets_ns()[next].cast_signed());
        latest_ns[subtask] = starts_ns.min().unwrap_or(latest_ns[subtask]);
    }
    latest_ns
}

/// Returns the topological order that always takes the ready subtask of the least position first.
fn least_first_order(task: &Task) -> Vec<usize> {
    let mut missing = task.graph.predecessor_counts();
    let mut ready: BinaryHeap<(u64, Reverse<usize>)> = BinaryHeap::new();
    ready.extend(task.sources().map(|subtask| (0, Reverse(subtask))));
    let mut order = Vec::new();
    while let Some((_, Reverse(subtask))) = ready.pop() {
        order.push(subtask);
        for next in task.successors(subtask) {
            missing[next] -= 1;
            if missing[next] == 0 {
                ready.push((0, Reverse(next)));
            }
        }
    }
    order
}
