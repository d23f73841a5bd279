//! The times of a table, from a run of its lists by WCETs.
//!
//! Each entry starts as early as the release, the list and the predecessors allow. Passes over the
//! lists delay starts until no start changes. If valid times exist, as many passes as entries find
//! them; otherwise the order alone makes entries wait for each other, or the work exceeds the time.

use alloc::vec;
use alloc::vec::Vec;

use crate::analysis::AnalysisSettings;
use crate::ids::{DagId, SubtaskId, to_u32};
use crate::table::{Table, TableEntry};
use crate::task_set::TaskSet;

/// A time longer than all laps, and the cap for the length of an entry.
const LONG_NS: u64 = 1 << 60;

impl TaskSet {
    /// Returns a table with the times of a run by the given WCETs. All times are 0 if a WCET is
    /// unknown, or if the entries do not keep to their laps.
    pub(crate) fn timed(
        &self,
        table: &Table,
        wcet_ns: &dyn Fn(DagId, SubtaskId) -> Option<u64>,
    ) -> Table {
        let mut run = TableRun::new(self, table, table.lap_ns);
        let (mut are_known, is_alone) = (true, table.is_of_one_dag());
        for list in &mut run.table.lists {
            for entry in &mut list.entries {
                let known = wcet_ns(entry.dag, entry.subtask);
                are_known &= known.is_some();
                entry.length_ns = known.unwrap_or(0);
                // A job released in a lap before may start at once.
                let dag = self.dag(entry.dag);
                let offset_ns = if is_alone { 0 } else { dag.offset_ns() };
                let later_ns = i128::from(entry.job) * i128::from(dag.period_ns());
                let release_ns = i128::from(offset_ns) + later_ns;
                entry.start_ns = u64::try_from(release_ns).unwrap_or(0).min(table.lap_ns);
            }
            let lengths = (0..list.entries.len()).map(|place| length_ns(&list.entries, place));
            let lengths: Vec<u64> = lengths.collect();
            for (entry, length_ns) in list.entries.iter_mut().zip(lengths) {
                entry.length_ns = length_ns;
            }
        }
        let is_timed = are_known && run.late_entry().is_none();
        let mut timed = run.table;
        if !is_timed {
            let entries = timed.lists.iter_mut().flat_map(|list| &mut list.entries);
            entries.for_each(|entry| (entry.start_ns, entry.length_ns) = (0, 0));
        }
        timed
    }

    /// Returns an entry without a start, and its core: entries wait for each other.
    pub(crate) fn blocked_entry(&self, table: &Table) -> Option<(u32, TableEntry)> {
        // Each entry takes one unit of time, and a lap is longer than all entries together.
        let mut run = TableRun::new(self, table, table.entries().count() as u64 + 1);
        let lists = run.table.lists.iter_mut();
        for entry in lists.flat_map(|list| &mut list.entries) {
            (entry.start_ns, entry.length_ns) = (0, 1);
        }
        run.late_entry()
    }

    /// Computes the times of tables anew, by WCETs plus the analysis's charge for each instance,
    /// unless a table's times differ from the times by plain WCETs.
    pub fn charge_tables(&mut self, settings: &AnalysisSettings) {
        let wcet_ns = |dag, subtask| self.dag(dag).subtask(subtask).locking_wcet_ns();
        let charged = |table: &Table| {
            if self.timed(table, &wcet_ns) != *table {
                return table.clone();
            }
            let dags = self.dags().iter();
            let mut dags = dags.filter(|dag| dag.cluster() == table.cluster);
            let overheads = settings.overheads.among(&mut dags, settings.cores);
            let charge_ns = overheads.of_an_instance_ns(settings.preemption);
            self.timed(table, &|dag, subtask| {
                self.dag(dag).subtask(subtask).charged_ns(charge_ns?)
            })
        };
        let tables = self.tables().iter().map(charged).collect();
        self.set_tables(tables);
    }
}

/// Returns the first job to be released in lap 0; the laps of a single DAG begin with its jobs.
pub(crate) fn first_in_lap(offset_ns: u64, period_ns: u64, is_alone: bool) -> i64 {
    match is_alone {
        true => 0,
        // Beyond half of the number range, none of the jobs is ever released.
        false => {
            -i64::try_from(offset_ns / period_ns).map_or(i64::MAX / 2, |of| of.min(i64::MAX / 2))
        }
    }
}

/// Returns the WCETs of a list's entry and of all nested entries: nothing relies on an earlier
/// finish.
fn length_ns(list: &[TableEntry], place: usize) -> u64 {
    let entry = &list[place];
    let after = list[place + 1..].iter().chain(&list[..place]);
    let nested = after.take_while(|other| other.depth > entry.depth);
    nested.fold(entry.length_ns, |sum, other| {
        sum.saturating_add(other.length_ns)
    })
}

/// The run of a table, with the starts found so far.
struct TableRun<'t> {
    task_set: &'t TaskSet,
    table: Table,
    lap_ns: i64,
    /// By vertex and job in the lap, the list of the entry and the place there.
    places: Vec<Vec<(usize, usize)>>,
}

impl<'t> TableRun<'t> {
    fn new(task_set: &'t TaskSet, table: &Table, lap_ns: u64) -> Self {
        let mut places = vec![Vec::new(); task_set.vertices()];
        for (number, list) in table.lists.iter().enumerate() {
            for (place, entry) in list.entries.iter().enumerate() {
                let first = task_set.first_vertex(entry.dag) as usize;
                let jobs = task_set.jobs_in_lap(table, entry.dag).cast_signed();
                let of_jobs: &mut Vec<_> = &mut places[first + entry.subtask.index()];
                of_jobs.resize(in_lap(-1, jobs) + 1, (0, 0));
                of_jobs[in_lap(entry.job, jobs)] = (number, place);
            }
        }
        Self {
            task_set,
            table: table.clone(),
            lap_ns: lap_ns.cast_signed(),
            places,
        }
    }

    /// Delays starts until they settle. Returns an entry that does not start in its lap, if there
    /// is one: rather one waiting for others than one behind it on the list.
    fn late_entry(&mut self) -> Option<(u32, TableEntry)> {
        let mut begun = vec![Vec::new(); self.table.lists.len()];
        let mut passes = 0..=self.table.entries().count();
        let is_settled = passes.any(|_| !self.delay(&mut begun));
        let lists = self.table.lists.iter();
        let all = lists.flat_map(|list| list.entries.iter().map(|of| (list.core, *of)));
        let waits = |of: &TableEntry| self.ready_ns(of) >= of.start_ns.cast_signed();
        // The first entry with the latest start.
        let late = all.rev().max_by_key(|(_, of)| (of.start_ns, waits(of)));
        late.filter(|(_, of)| !is_settled || of.start_ns.cast_signed() >= self.lap_ns)
    }

    /// Delays starts as far as the previous starts demand, and reports whether any was delayed. A
    /// start is capped at the end of the lap, where the exact time does not matter. `begun` holds
    /// for each list the depths and ends of the entries begun before the lap and not finished.
    fn delay(&mut self, begun: &mut [Vec<(u32, i64)>]) -> bool {
        let mut has_delayed = false;
        for (number, begun) in begun.iter_mut().enumerate() {
            let count = self.table.lists[number].entries.len();
            let last = &self.table.lists[number].entries[count - 1];
            let mut before_ns = last.start_ns.cast_signed() - self.lap_ns;
            for (_, end_ns) in &mut *begun {
                *end_ns -= self.lap_ns;
            }
            for place in 0..count {
                let mut entry = self.table.lists[number].entries[place];
                while let Some((_, end_ns)) = begun.pop_if(|(depth, _)| *depth >= entry.depth) {
                    before_ns = before_ns.max(end_ns);
                }
                let start_ns = self.ready_ns(&entry).max(before_ns).min(self.lap_ns);
                if start_ns > entry.start_ns.cast_signed() {
                    entry.start_ns = start_ns.cast_unsigned();
                    self.table.lists[number].entries[place] = entry;
                    has_delayed = true;
                }
                before_ns = entry.start_ns.cast_signed();
                begun.push((entry.depth, end_ns(&entry)));
            }
        }
        has_delayed
    }

    /// Returns the end of everything an entry waits for: the predecessors, the same subtask in the
    /// job before, and the job whose end makes room for the entry's job.
    fn ready_ns(&self, entry: &TableEntry) -> i64 {
        let dag = self.task_set.dag(entry.dag);
        let first = self.task_set.first_vertex(entry.dag) as usize;
        let over_ns = |subtask: SubtaskId, job: i64| {
            let of_jobs = &self.places[first + subtask.index()];
            let jobs = i64::from(to_u32(of_jobs.len()));
            let (list, place) = of_jobs[in_lap(job, jobs)];
            let other = &self.table.lists[list].entries[place];
            let laps = (job - other.job) / jobs;
            end_ns(other) + laps * self.lap_ns
        };
        let before = dag.predecessors(entry.subtask);
        let makes_room = if before.is_empty() { dag.sinks() } else { &[] };
        let left = entry.job - i64::from(dag.in_flight());
        let before = before.iter().map(|&subtask| over_ns(subtask, entry.job));
        let room = makes_room.iter().map(|&sink| over_ns(sink, left));
        before
            .chain(room)
            .fold(over_ns(entry.subtask, entry.job - 1), i64::max)
    }
}

/// Returns the place of a job among the jobs of a lap.
fn in_lap(job: i64, jobs: i64) -> usize {
    usize::try_from(job.rem_euclid(jobs)).unwrap_or(0)
}

fn end_ns(entry: &TableEntry) -> i64 {
    (entry.start_ns + entry.length_ns.min(LONG_NS)).cast_signed()
}
