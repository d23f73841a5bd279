//! The times of a table: those of a run of its lists by WCETs.
//!
//! The lists run lap after lap until all entries start at the same times again. Whether an entry
//! ever starts depends on the order alone, so lists without WCETs are tried as well.

use alloc::vec;
use alloc::vec::Vec;

use crate::analysis::AnalysisSettings;
use crate::ids::{DagId, SubtaskId};
use crate::table::{Table, TableEntry};
use crate::task_set::TaskSet;

/// The run is given up after so many laps.
const MOST_LAPS: u32 = 32;

impl TaskSet {
    /// Returns a table with the times of a run by such WCETs. All are 0 if a WCET is not
    /// known, or if the entries do not keep to their laps.
    pub(crate) fn timed(
        &self,
        table: &Table,
        wcet_ns: &dyn Fn(DagId, SubtaskId) -> Option<u64>,
    ) -> Table {
        let mut run = TableRun::new(self, table);
        let mut are_known = true;
        for entry in &mut run.entries {
            let known = wcet_ns(entry.of.dag, entry.of.subtask);
            are_known &= known.is_some();
            entry.wcet_ns = known.unwrap_or(0);
        }
        run.add_nested();
        let is_timed = are_known && run.settles();
        let mut timed = table.clone();
        let mut first = 0;
        for list in &mut timed.lists {
            let all = &run.entries[first..first + list.entries.len()];
            first += all.len();
            for (place, entry) in list.entries.iter_mut().enumerate() {
                (entry.start_ns, entry.length_ns) = match is_timed {
                    true => (all[place].start_ns, all[place].length_ns),
                    false => (0, 0),
                };
            }
        }
        timed
    }

    /// Returns an entry without a start, and its core: entries wait for each other.
    pub(crate) fn blocked_entry(&self, table: &Table) -> Option<(u32, TableEntry)> {
        let mut run = TableRun::new(self, table);
        if run.settles() {
            return None;
        }
        // Nothing takes time, so only an order makes a core fall behind the others.
        let lags = |core: &&RunCore| core.lap < MOST_LAPS / 2;
        let core = run.cores.iter().find(lags)?;
        let RunEntry { core, of, .. } = &run.entries[core.next];
        Some((*core, **of))
    }

    /// Times tables anew, by WCETs with what the analysis charges each instance, unless their
    /// times are not those of plain WCETs.
    pub fn charge_tables(&mut self, settings: &AnalysisSettings) {
        let wcet_ns = |dag, subtask| self.dag(dag).subtask(subtask).locking_wcet_ns();
        let charged = |table: &Table| {
            if self.timed(table, &wcet_ns) != *table {
                return table.clone();
            }
            let mut dags = self
                .dags()
                .iter()
                .filter(|dag| dag.cluster() == table.cluster);
            let overheads = settings.overheads.among(&mut dags, settings.cores);
            let charge_ns = overheads.of_an_instance_ns(settings.preemption);
            self.timed(table, &|dag, subtask| {
                self.dag(dag).subtask(subtask).charged_ns(charge_ns?)
            })
        };
        let tables = self.tables().iter().map(charged).collect();
        self.set_tables(tables);
    }

    /// Returns the first job of a DAG to be released in lap 0 of its table.
    pub(crate) fn first_in_lap(&self, table: &Table, dag: DagId) -> i64 {
        let dag = self.dag(dag);
        first_in_lap(dag.offset_ns(), dag.period_ns(), table.is_of_one_dag())
    }
}

/// Returns the first job to be released in lap 0; the laps of a DAG alone begin with its jobs.
pub(crate) fn first_in_lap(offset_ns: u64, period_ns: u64, is_alone: bool) -> i64 {
    match is_alone {
        true => 0,
        // Beyond half of the numbers none of these jobs is ever released.
        false => {
            -i64::try_from(offset_ns / period_ns).map_or(i64::MAX / 2, |of| of.min(i64::MAX / 2))
        }
    }
}

/// Returns the WCETs of an entry of a list, and of all nested entries.
fn length_ns(list: &[RunEntry<'_>], place: usize) -> u64 {
    let entry = &list[place];
    let after = list[place + 1..].iter().chain(&list[..place]);
    let nested = after.take_while(|other| other.of.depth > entry.of.depth);
    nested.fold(entry.wcet_ns, |sum, other| {
        sum.saturating_add(other.wcet_ns)
    })
}

/// The run of a table, from the beginning of lap 0.
struct TableRun<'t> {
    task_set: &'t TaskSet,
    lap_ns: u64,
    now_ns: u64,
    dags: Vec<RunDag>,
    /// The entries of all lists, list after list.
    entries: Vec<RunEntry<'t>>,
    cores: Vec<RunCore>,
    /// By lap, how many entries have started as in the lap before.
    repeated: Vec<usize>,
}

struct RunDag {
    id: DagId,
    phase_ns: u64,
    period_ns: u64,
    /// The number of jobs in a lap.
    jobs: i64,
    /// Its entries, by subtask and job.
    entries: Vec<usize>,
}

struct RunEntry<'t> {
    core: u32,
    of: &'t TableEntry,
    /// The DAG's place in the run.
    dag: usize,
    /// The number of the job's release in lap 0.
    job: i64,
    wcet_ns: u64,
    /// From the start to the finish: the WCETs of the entry, and of all nested entries.
    length_ns: u64,
    /// The number of laps with the entry finished, or passed.
    done: i64,
    /// The start in the latest lap.
    start_ns: u64,
}

struct RunCore {
    /// The first entry, the end of the entries, and the next entry to start, with its lap.
    first: usize,
    end: usize,
    next: usize,
    lap: u32,
    /// The begun and unfinished entries, with the end of each.
    begun: Vec<(usize, u64)>,
}

impl<'t> TableRun<'t> {
    fn new(task_set: &'t TaskSet, table: &'t Table) -> Self {
        let ids = table.dags();
        let dag = |&id: &DagId| {
            let dag = task_set.dag(id);
            let jobs = task_set.jobs_in_lap(table, id);
            RunDag {
                id,
                phase_ns: match ids.len() {
                    1 => 0,
                    _ => dag.offset_ns() % dag.period_ns(),
                },
                period_ns: dag.period_ns(),
                jobs: i64::try_from(jobs).unwrap_or(i64::MAX),
                entries: vec![0; dag.subtasks().len() * usize::try_from(jobs).unwrap_or(0)],
            }
        };
        let mut run = Self {
            task_set,
            lap_ns: table.lap_ns,
            now_ns: 0,
            dags: ids.iter().map(dag).collect(),
            entries: Vec::new(),
            cores: Vec::new(),
            repeated: vec![0; MOST_LAPS as usize],
        };
        for list in &table.lists {
            let first = run.entries.len();
            for of in &list.entries {
                let dag = ids.iter().position(|id| *id == of.dag).unwrap_or(0);
                let job = of.job - task_set.first_in_lap(table, of.dag);
                let place = run.dags[dag].place(of.subtask, job);
                run.dags[dag].entries[place] = run.entries.len();
                run.entries.push(RunEntry {
                    core: list.core,
                    of,
                    dag,
                    job,
                    wcet_ns: 0,
                    length_ns: 0,
                    done: 0,
                    start_ns: u64::MAX,
                });
            }
            run.cores.push(RunCore {
                first,
                end: run.entries.len(),
                next: first,
                lap: 0,
                begun: Vec::new(),
            });
        }
        run
    }

    /// Adds the WCETs of nested entries to those that they are in: nothing relies on an earlier
    /// finish.
    fn add_nested(&mut self) {
        for core in &self.cores {
            let list = &self.entries[core.first..core.end];
            let lengths_ns = (0..list.len()).map(|place| length_ns(list, place));
            let lengths_ns: Vec<u64> = lengths_ns.collect();
            for (entry, length_ns) in self.entries[core.first..].iter_mut().zip(lengths_ns) {
                entry.length_ns = length_ns;
            }
        }
    }

    /// Runs until all entries start as in the lap before, and reports whether they do, each in its
    /// lap.
    fn settles(&mut self) -> bool {
        loop {
            let mut has_gone_on = false;
            for core in 0..self.cores.len() {
                while self.finish(core) || self.start(core) {
                    has_gone_on = true;
                }
            }
            if self.repeated.contains(&self.entries.len()) {
                return self.entries.iter().all(|of| of.start_ns < self.lap_ns);
            }
            if self.cores.iter().any(|core| core.lap >= MOST_LAPS) {
                return false;
            }
            if !has_gone_on && !self.elapse() {
                return false;
            }
        }
    }

    /// Ends the innermost entry of a core, if the time has come.
    fn finish(&mut self, core: usize) -> bool {
        let finished = self.cores[core]
            .begun
            .pop_if(|begun| begun.1 <= self.now_ns);
        if let Some((entry, _)) = finished {
            self.entries[entry].done += 1;
        }
        finished.is_some()
    }

    /// Starts or passes the next entry of a core, if there is nothing to wait for.
    fn start(&mut self, number: usize) -> bool {
        let RunCore { next, lap, .. } = self.cores[number];
        let depth = self.entries[next].of.depth;
        let innermost = self.cores[number].begun.last();
        if innermost.is_some_and(|&(begun, _)| self.entries[begun].of.depth >= depth) {
            return false;
        }
        match self.release_ns(next, lap) {
            None => self.entries[next].done += 1,
            Some(ns) if ns > self.now_ns || !self.is_ready(next, lap) => return false,
            Some(_) => {
                let begin_ns = self.lap_ns * u64::from(lap);
                let entry = &mut self.entries[next];
                let start_ns = self.now_ns - begin_ns;
                self.repeated[lap as usize] += usize::from(entry.start_ns == start_ns);
                entry.start_ns = start_ns;
                let end_ns = self.now_ns.saturating_add(entry.length_ns);
                self.cores[number].begun.push((next, end_ns));
            }
        }
        let core = &mut self.cores[number];
        core.next += 1;
        if core.next == core.end {
            (core.next, core.lap) = (core.first, lap + 1);
        }
        true
    }

    /// Returns when an entry may start in a lap; `None` if its job does not exist.
    fn release_ns(&self, entry: usize, lap: u32) -> Option<u64> {
        let RunEntry { dag, job, .. } = self.entries[entry];
        let dag = &self.dags[dag];
        let job = u64::try_from(job + i64::from(lap) * dag.jobs).ok()?;
        let begin_ns = self.lap_ns * u64::from(lap);
        Some(begin_ns.max(dag.phase_ns + job * dag.period_ns))
    }

    /// Reports whether the predecessors of an entry have finished, and the subtask's job before.
    fn is_ready(&self, entry: usize, lap: u32) -> bool {
        let RunEntry { dag, job, of, .. } = &self.entries[entry];
        let dag = &self.dags[*dag];
        let is_done = |subtask, job: i64| {
            let other = &self.entries[dag.entries[dag.place(subtask, job)]];
            other.done > i64::from(lap) + (job - other.job) / dag.jobs
        };
        let model = self.task_set.dag(dag.id);
        let before = model.predecessors(of.subtask);
        // A job is not released before the one that leaves it room.
        let left = job - i64::from(model.in_flight());
        let has_room = || model.sinks().iter().all(|&sink| is_done(sink, left));
        before.iter().all(|&subtask| is_done(subtask, *job))
            && is_done(of.subtask, job - 1)
            && (!before.is_empty() || has_room())
    }

    /// Lets time go on to the next finish or release, if any.
    fn elapse(&mut self) -> bool {
        let events_ns = self.cores.iter().flat_map(|core| {
            let end_ns = core.begun.last().map(|&(_, end_ns)| end_ns);
            let release_ns = self.release_ns(core.next, core.lap);
            [end_ns, release_ns.filter(|&ns| ns > self.now_ns)]
        });
        let next_ns = events_ns.flatten().min();
        self.now_ns = next_ns.unwrap_or(self.now_ns);
        next_ns.is_some()
    }
}

impl RunDag {
    /// Returns the place of an entry, whatever the lap of its job.
    fn place(&self, subtask: SubtaskId, job: i64) -> usize {
        let [all, of_job] = [self.jobs, job.rem_euclid(self.jobs)].map(usize::try_from);
        subtask.index() * all.unwrap_or(0) + of_job.unwrap_or(0)
    }
}
