//! Reads lists of cores, stated as text, and makes tables of the lists.
//!
//! A list is a line: `core 0: sense.read control.steer ( log.write#1 ) sense.read#1`. The number is
//! a core of the machine, as in answers and pictures; the cluster follows from the core. Each other
//! word is an *entry*: `DAG.SUBTASK`, by names or by numbers. `#N` gives the job, counted from the
//! first release of a lap on (`#-1`: the last job of the lap before). Without `#N`, the entries of
//! a subtask, all on one core, belong to jobs 0, 1, .. in turn. Entries in parentheses are nested
//! in the entry before the parenthesis. `@START+LENGTH` gives the times in nanoseconds. Without
//! times, [timed](TaskSet::timed) finds them.
//!
//! Lists with DAGs in common form one table. A table contains a DAG as a whole or not at all.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;
use core::fmt::Write;
use core::ops::Range;

use super::fault::ListFault;
use super::label::DagLabel;
use super::{CommitOptions, VerifyFindings};
use crate::analysis::greatest_common_divisor;
use crate::ids::{DagId, SubtaskId, to_u32};
use crate::nearest::nearest_of;
use crate::order::sorted_by_key;
use crate::policy::Activation;
use crate::spec::DagSpec;
use crate::table::{CoreList, ENTRY_LIMIT, Table, TableEntry};
use crate::table_times::first_in_lap;
use crate::task_set::TaskSet;

/// The longest lap, 9 years, since some laps are run to find times.
const LONGEST_LAP_NS: u64 = 1 << 58;

/// The maximum number of laps from a job's release to its entry.
const MOST_LAPS_BACK: i64 = 8;

/// A list as stated.
struct StatedList {
    /// The words before the colon.
    title: String,
    core: u32,
    entries: Vec<StatedEntry>,
}

#[derive(Clone, Copy)]
struct StatedEntry {
    dag: usize,
    subtask: usize,
    /// The job in the lap.
    job: Option<i64>,
    depth: u32,
    /// Start and length.
    times_ns: Option<(u64, u64)>,
}

/// The tables of a commit, and the DAGs in them.
pub(super) struct StatedTables {
    pub(super) tables: Vec<Table>,
    /// The number of each DAG's table.
    pub(super) of_dags: Vec<Option<usize>>,
}

/// Reads the lists and makes tables of them, with stated times only.
#[inline(never)]
pub(super) fn check(options: &CommitOptions, findings: &mut VerifyFindings<'_>) -> StatedTables {
    let specs = findings.specs;
    let mut lists: Vec<StatedList> = Vec::new();
    let mut stated = StatedTables {
        tables: Vec::new(),
        of_dags: vec![None; specs.len()],
    };
    for text in &options.lists {
        let title = text.split(':').next().unwrap_or(text);
        let list = read(text, specs).and_then(|list| {
            match lists.iter().any(|other| other.core == list.core) {
                true => Err(ListFault::CoreTwice),
                false => Ok(list),
            }
        });
        match list {
            Ok(list) => lists.push(list),
            Err(why) => findings.core_list(title, why),
        }
    }
    // An unreadable list would make other entries seem missing, so the checks end here.
    if lists.len() < options.lists.len() {
        return stated;
    }
    for (number, list) in lists.iter().enumerate() {
        for entry in &list.entries {
            let before = stated.of_dags[entry.dag].replace(number);
            if before.is_some_and(|before| before != number) {
                let others = stated.of_dags.iter_mut().filter(|of| **of == before);
                others.for_each(|of| *of = Some(number));
            }
        }
    }
    for number in 0..lists.len() {
        let is_in = |dag: usize| stated.of_dags[dag] == Some(number);
        let dags: Vec<usize> = (0..specs.len()).filter(|&dag| is_in(dag)).collect();
        let order = sorted_by_key(lists.len(), |list| lists[list].core);
        let lists = order.into_iter().map(|list| &lists[list]);
        let lists: Vec<_> = lists.filter(|list| is_in(list.entries[0].dag)).collect();
        if let Some(first) = lists.first() {
            match table(options, specs, &dags, &lists) {
                Ok(table) => stated.tables.extend(table),
                Err(why) => findings.core_list(&first.title, why),
            }
        }
    }
    stated
}

/// Gives the tables times, unless stated, and has the tables enforced.
pub(super) fn enforce(
    task_set: &mut TaskSet,
    tables: Vec<Table>,
    findings: &mut VerifyFindings<'_>,
) {
    let timed = tables.into_iter().map(|table| {
        if let Some((core, of)) = task_set.blocked_entry(&table) {
            let core = task_set.cores_of(table.cluster, 0).start + core;
            let word = word(findings.specs, of.dag.index(), of.subtask.index());
            findings.core_list(&format!("core {core}"), ListFault::Blocked { word });
        }
        let mut entries = table.lists.iter().flat_map(|list| &list.entries);
        let wcet_ns = |dag, subtask| task_set.dag(dag).subtask(subtask).locking_wcet_ns();
        match entries.any(|entry| entry.length_ns > 0) {
            true => table,
            false => task_set.timed(&table, &wcet_ns),
        }
    });
    let timed = timed.collect();
    task_set.set_tables(timed);
}

fn read(text: &str, specs: &[&DagSpec]) -> Result<StatedList, ListFault> {
    let malformed = |word: &str| ListFault::Malformed { word: word.into() };
    let (title, words) = text.split_once(':').ok_or_else(|| malformed(text))?;
    let core = title
        .strip_prefix("core ")
        .and_then(|core| core.parse().ok());
    let core = core.ok_or_else(|| malformed(title))?;
    let (mut entries, mut depth) = (Vec::new(), 0_u32);
    for word in words.split_whitespace() {
        match word {
            "(" => depth += 1,
            ")" => depth = depth.checked_sub(1).ok_or_else(|| malformed(word))?,
            _ => entries.push(read_entry(word, depth, specs)?),
        }
    }
    if depth > 0 || entries.is_empty() {
        return Err(malformed(words));
    }
    let title = title.into();
    Ok(StatedList {
        title,
        core,
        entries,
    })
}

fn read_entry(word: &str, depth: u32, specs: &[&DagSpec]) -> Result<StatedEntry, ListFault> {
    // Names may contain `@` and `#`, too, so only a valid suffix is cut off.
    let times = word.rsplit_once('@').and_then(|(rest, times)| {
        let (start, length) = times.split_once('+')?;
        Some((rest, (start.parse().ok()?, length.parse().ok()?)))
    });
    let rest = times.map_or(word, |(rest, _)| rest);
    let job = rest.rsplit_once('#');
    let job = job.and_then(|(rest, job)| Some((rest, job.parse().ok()?)));
    let name = job.map_or(rest, |(rest, _)| rest);
    let is_called =
        |called: &str, number: usize, part: &str| called == part || part.parse() == Ok(number);
    let mut found = Vec::new();
    // Two numbers are no names; otherwise a record could not be read if DAGs have numbers as names.
    let numbers = name.split_once('.').and_then(|(dag, subtask)| {
        let (dag, subtask) = (dag.parse().ok()?, subtask.parse().ok()?);
        (subtask < specs.get::<usize>(dag)?.subtasks.len()).then_some((dag, subtask))
    });
    found.extend(numbers);
    for (dot, _) in name.match_indices('.').filter(|_| numbers.is_none()) {
        for (dag, spec) in specs.iter().enumerate() {
            if is_called(&spec.name, dag, &name[..dot]) {
                let subtasks = spec.subtasks.iter().enumerate();
                let its =
                    subtasks.filter(|(number, of)| is_called(&of.name, *number, &name[dot + 1..]));
                found.extend(its.map(|(subtask, _)| (dag, subtask)));
            }
        }
    }
    match found[..] {
        [(dag, subtask)] => Ok(StatedEntry {
            dag,
            subtask,
            job: job.map(|(_, job)| job),
            depth,
            times_ns: times.map(|(_, times)| times),
        }),
        [] => {
            let all = specs.iter().enumerate();
            let all = all.flat_map(|(dag, spec)| {
                (0..spec.subtasks.len()).map(move |subtask| self::word(specs, dag, subtask))
            });
            let all: Vec<String> = all.collect();
            let meant = nearest_of(name, &mut all.iter().map(String::as_str));
            Err(ListFault::UnknownWord {
                word: name.into(),
                meant: meant.map(Into::into),
            })
        }
        _ => Err(ListFault::AmbiguousWord { word: name.into() }),
    }
}

/// Returns the word for a subtask.
fn word(specs: &[&DagSpec], dag: usize, subtask: usize) -> String {
    let named = |name: &str, number: usize| match name {
        "" => number.to_string(),
        _ => name.into(),
    };
    let spec = specs[dag];
    named(&spec.name, dag) + "." + &named(&spec.subtasks[subtask].name, subtask)
}

/// Makes the table from the lists of some DAGs; none if a period is missing, a fault of its own.
fn table(
    options: &CommitOptions,
    specs: &[&DagSpec],
    dags: &[usize],
    lists: &[&StatedList],
) -> Result<Option<Table>, ListFault> {
    let Some(lap_ns) = lap_ns(specs, dags)? else {
        return Ok(None);
    };
    let cores = cores_of(options, specs[dags[0]]);
    for list in lists {
        for entry in &list.entries {
            let Range { start, end } = cores_of(options, specs[entry.dag]);
            if !(start..end).contains(&list.core) {
                let dag = DagLabel::new(specs, entry.dag);
                return Err(ListFault::OutOfRange {
                    dag,
                    first: start,
                    cores: end - start,
                });
            }
        }
    }
    let mut jobs = LapJobs::new(specs, dags, lap_ns)?;
    let of_list = |list: &&StatedList| {
        let entries = list.entries.iter();
        let entries: Result<_, _> = entries.map(|of| jobs.entry(list.core, of)).collect();
        let (core, entries) = (list.core - cores.start, entries?);
        Ok(CoreList { core, entries })
    };
    let lists = lists.iter().map(of_list).collect::<Result<Box<[_]>, _>>()?;
    jobs.all_are_there()?;
    let entries = || lists.iter().flat_map(|list| &list.entries);
    let has_times = |of: &TableEntry| of.length_ns > 0;
    if entries().any(has_times) && !entries().all(|of| has_times(of) && of.start_ns < lap_ns) {
        return Err(ListFault::PartlyTimed);
    }
    let cluster = specs[dags[0]].cluster.unwrap_or_default();
    Ok(Some(Table {
        cluster,
        lap_ns,
        lists,
    }))
}

/// Returns the length of a lap of DAGs, if all DAGs state a period.
fn lap_ns(specs: &[&DagSpec], dags: &[usize]) -> Result<Option<u64>, ListFault> {
    let mut lap_ns = 1_u64;
    for &number in dags {
        let (spec, dag) = (specs[number], DagLabel::new(specs, number));
        if let Some(subtask) = spec.subtasks.iter().position(|of| !of.waits.is_empty()) {
            let word = word(specs, number, subtask);
            return Err(ListFault::Waits { word, dag });
        }
        if !spec.affinity.is_empty() {
            return Err(ListFault::HasAffinity { dag });
        }
        if spec.activation == Activation::Sporadic && dags.len() > 1 {
            return Err(ListFault::Sporadic { dag });
        }
        let Some(period_ns @ 1..) = spec.period_ns else {
            return Ok(None);
        };
        let (lap, period) = (u128::from(lap_ns), u128::from(period_ns));
        let lap = u64::try_from(lap / greatest_common_divisor(lap, period) * period);
        let lap = lap.ok().filter(|lap_ns| *lap_ns <= LONGEST_LAP_NS);
        lap_ns = lap.ok_or(ListFault::LapTooLong { dag })?;
    }
    Ok(Some(lap_ns))
}

/// Returns the cores of a DAG's cluster.
fn cores_of(options: &CommitOptions, spec: &DagSpec) -> Range<u32> {
    let sizes = options.clusters.sizes();
    let cluster = spec.cluster.unwrap_or_default().index();
    let (before, rest) = sizes.split_at(cluster.min(sizes.len()));
    let first: u32 = before.iter().sum();
    first..rest.first().map_or(options.cores, |size| first + size)
}

/// The jobs in a lap, for the subtasks of a table's DAGs.
struct LapJobs<'s> {
    specs: &'s [&'s DagSpec],
    lap_ns: u64,
    is_alone: bool,
    /// By DAG and subtask: the core of the latest entry, the number of entries, and for each job
    /// whether an entry exists.
    of_dags: Vec<Vec<(u32, i64, Vec<bool>)>>,
}

impl<'s> LapJobs<'s> {
    fn new(specs: &'s [&'s DagSpec], dags: &[usize], lap_ns: u64) -> Result<Self, ListFault> {
        let mut jobs = Self {
            specs,
            lap_ns,
            is_alone: dags.len() == 1,
            of_dags: vec![vec![]; specs.len()],
        };
        let count = dags.iter().fold(0, |sum: u64, &dag| {
            let subtasks = specs[dag].subtasks.len() as u64;
            sum.saturating_add(jobs.count(dag).saturating_mul(subtasks))
        });
        if count > ENTRY_LIMIT as u64 {
            return Err(ListFault::TooManyEntries { count });
        }
        for &dag in dags {
            let none = vec![false; usize::try_from(jobs.count(dag)).unwrap_or(0)];
            jobs.of_dags[dag] = vec![(0, 0, none); specs[dag].subtasks.len()];
        }
        Ok(jobs)
    }

    /// Returns the number of a DAG's jobs in a lap.
    fn count(&self, dag: usize) -> u64 {
        self.lap_ns / self.specs[dag].period_ns.unwrap_or(self.lap_ns)
    }

    /// Makes the next entry of a core.
    fn entry(&mut self, core: u32, of: &StatedEntry) -> Result<TableEntry, ListFault> {
        let (dag, subtask) = (of.dag, of.subtask);
        let word = || word(self.specs, dag, subtask);
        let (latest_core, count, taken) = &mut self.of_dags[dag][subtask];
        let jobs = i64::try_from(taken.len()).unwrap_or(0);
        if of.job.is_none() && *count > 0 && jobs > 1 && *latest_core != core {
            return Err(ListFault::NotNumbered { word: word() });
        }
        let job = of.job.unwrap_or(*count % jobs);
        if !(-MOST_LAPS_BACK * jobs..jobs).contains(&job) {
            return Err(ListFault::UnknownJob {
                word: word(),
                job,
                jobs,
            });
        }
        (*latest_core, *count) = (core, *count + 1);
        let place = usize::try_from(job.rem_euclid(jobs)).unwrap_or(0);
        if core::mem::replace(&mut taken[place], true) {
            return Err(ListFault::EntryTwice { word: word(), job });
        }
        let spec = self.specs[dag];
        let period_ns = spec.period_ns.unwrap_or(self.lap_ns);
        let first = first_in_lap(spec.offset_ns, period_ns, self.is_alone);
        let (start_ns, length_ns) = of.times_ns.unwrap_or_default();
        Ok(TableEntry {
            dag: DagId(to_u32(dag)),
            subtask: SubtaskId(to_u32(subtask)),
            job: job + first,
            depth: of.depth,
            start_ns,
            length_ns,
        })
    }

    fn all_are_there(&self) -> Result<(), ListFault> {
        for (dag, subtasks) in self.of_dags.iter().enumerate() {
            for (subtask, (.., taken)) in subtasks.iter().enumerate() {
                if let Some(job) = taken.iter().position(|is_taken| !is_taken) {
                    let word = word(self.specs, dag, subtask);
                    let dag = DagLabel::new(self.specs, dag);
                    return Err(ListFault::EntryMissing { dag, word, job });
                }
            }
        }
        Ok(())
    }
}

impl TaskSet {
    /// Returns the lists of the tables as text, with numbers for DAGs and subtasks, and with times
    /// if there are any.
    pub fn core_lists(&self) -> Vec<String> {
        let of = |table| move |list| self.list_text(table, list);
        let tables = self.tables().iter();
        tables
            .flat_map(|table| table.lists.iter().map(of(table)))
            .collect()
    }

    fn list_text(&self, table: &Table, list: &CoreList) -> String {
        let core = self.cores_of(table.cluster, 0).start + list.core;
        let mut text = format!("core {core}:");
        let (mut depth, is_alone) = (0, table.dags().len() == 1);
        for entry in &list.entries {
            let dag = self.dag(entry.dag);
            let job = entry.job - first_in_lap(dag.offset_ns(), dag.period_ns(), is_alone);
            let parenthesis = if entry.depth > depth { " (" } else { " )" };
            text += &parenthesis.repeat(depth.abs_diff(entry.depth) as usize);
            depth = entry.depth;
            // Writing to a `String` cannot fail.
            let _ = write!(text, " {}.{}#{job}", entry.dag.0, entry.subtask.0);
            if entry.length_ns > 0 {
                let _ = write!(text, "@{}+{}", entry.start_ns, entry.length_ns);
            }
        }
        text + &" )".repeat(depth as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{SubtaskSpec, Wait};
    use crate::{ConstructionPolicy, Policy, verify};

    /// `sense` reads and steers every 10 ns, `log` writes every 20 ns.
    fn dags() -> [DagSpec; 2] {
        let dag = |name: &str, period_ns, subtasks: &[(&str, u64)]| DagSpec {
            name: name.into(),
            period_ns: Some(period_ns),
            relative_deadline_ns: Some(period_ns),
            subtasks: (subtasks.iter())
                .map(|&(name, wcet_ns)| SubtaskSpec {
                    name: name.into(),
                    wcet_ns: Some(wcet_ns),
                    ..SubtaskSpec::default()
                })
                .collect(),
            edges: (1..subtasks.len())
                .map(|later| (later - 1, later))
                .collect(),
            ..DagSpec::default()
        };
        let sense = dag("sense", 10, &[("read", 2), ("steer", 3)]);
        [sense, dag("log", 20, &[("write", 6)])]
    }

    fn lists(dags: &[DagSpec], lists: &[&str]) -> Result<Vec<String>, String> {
        let options = CommitOptions::new(Policy::StaticPriority, 2)
            .with_construction(ConstructionPolicy::any_graph())
            .with_lists(lists);
        let verified = verify(dags, &options).map_err(|rejected| rejected.to_string())?;
        Ok(verified.task_set.core_lists())
    }

    #[test]
    fn a_list_has_the_times_of_its_run_and_is_read_as_it_is_written() {
        let stated = "core 1: sense.read sense.steer log.write ( sense.read ) sense.steer";
        let timed = "core 1: 0.0#0@0+2 0.1#0@2+3 1.0#0@5+8 ( 0.0#1@10+2 ) 0.1#1@13+3";
        assert_eq!(lists(&dags(), &[stated]).unwrap(), [timed]);
        assert_eq!(lists(&dags(), &[timed]).unwrap(), [timed]);
        let mut named_by_numbers = dags();
        (named_by_numbers[0].name, named_by_numbers[1].name) = ("1".into(), "0".into());
        named_by_numbers[0].subtasks[1].name = "0".into();
        assert_eq!(lists(&named_by_numbers, &[timed]).unwrap(), [timed]);
        // A time without an end is none.
        let mut endless = dags();
        (endless[0].relative_deadline_ns, endless[0].in_flight) = (Some(1 << 63), Some(9));
        endless[0].subtasks[0].wcet_ns = Some(1 << 62);
        let untimed = lists(&endless, &["core 0: sense.read sense.steer"]).unwrap();
        assert_eq!(untimed, ["core 0: 0.0#0 0.1#0"]);
        // From its second job on, `log` is released 5 ns after `sense`, whose jobs come first.
        let mut late = dags();
        late[1].offset_ns = 25;
        late[0].subtasks[1].wcet_ns = None;
        let plain = "core 1: 0.0#0 0.1#0 1.0#0 ( 0.0#1 ) 0.1#1";
        assert_eq!(lists(&late, &[stated]).unwrap(), [plain]);
        // The end of a job may come in the next lap, and what is nested around the end of a lap.
        late[0].subtasks[1].wcet_ns = Some(3);
        late[1].offset_ns = 17;
        let around = [
            "core 0: ( sense.read ) sense.steer sense.read sense.steer log.write",
            "core 0: 0.1#-1@0+3 0.0#0@3+2 0.1#0@5+3 0.0#1@10+2 1.0#0@17+6",
        ];
        let found = lists(&late, &around[..1]).unwrap();
        assert_eq!(
            found,
            ["core 0: ( 0.0#0@0+2 ) 0.1#0@5+3 0.0#1@10+2 0.1#1@12+3 1.0#0@17+8"]
        );
    }

    /// Lists, separated by `|`, and how their fault ends or begins.
    const FAULTS: &str = "
        core one: sense.read = the list of core one: `core one` has no place there; write `core 2:
        core 0: sense.read ) = the list of core 0: `)` has no place there;
        core 0: sense.raed = the list of core 0: `sense.raed` is no subtask; did you mean `sense.read`? If not,
        core 0: sense.read sense.steer | core 0: log.write = the list of core 0: another one is of
        core 2: log.write = the list of core 2: dag `log` has 2 cores, from core 0 on; state one of these
        core 0: sense.read = the list of core 0: `sense.steer#0` is in none; add it, or leave all of dag `sense` out
        core 0: sense.read sense.steer#1 = the list of core 0: `sense.steer#1` is of no job, as a lap has 1,
        core 0: sense.read sense.read sense.steer = the list of core 0: `sense.read#0` stands twice
        core 0: log.write sense.read sense.steer sense.read#0 = the list of core 0: `sense.read#0` stands twice
        core 0: log.write sense.read sense.steer | core 1: sense.read sense.steer = the list of core 0: `sense.read` stands on several cores; number
        core 0: sense.steer sense.read = the list of core 0: `sense.steer` would wait for ever
        core 0: sense.read@0+2 sense.steer = the list of core 0: some of its entries have times";

    #[test]
    fn each_fault_is_told_with_its_list_and_the_remedy() {
        for row in FAULTS.lines().skip(1) {
            let (texts, told) = row.trim().split_once(" = ").unwrap();
            let texts: Vec<&str> = texts.split(" | ").collect();
            let found = lists(&dags(), &texts).unwrap_err();
            assert!(found.starts_with(told), "{found}\n{told}");
        }
        let both = ["core 0: log.write sense.read sense.steer sense.read sense.steer"];
        let refused = |change: fn(&mut [DagSpec; 2])| {
            let mut dags = dags();
            change(&mut dags);
            let found = lists(&dags, &both).unwrap_err();
            found.split_once(": ").unwrap().1.to_string()
        };
        let mut crowded = dags();
        let list = ["core 0: sense.read sense.read sense.steer sense.steer log.write"];
        assert!(lists(&crowded, &list).is_ok());
        crowded[0].in_flight = Some(1);
        let found = lists(&crowded, &list).unwrap_err();
        assert!(
            found.contains("`sense.read` would wait for ever"),
            "{found}"
        );
        let found = refused(|dags| dags[0].activation = Activation::Sporadic);
        assert!(
            found.starts_with("dag `sense` is sporadic, and other DAGs"),
            "{found}"
        );
        let found = refused(|dags| dags[1].affinity = vec![1]);
        assert!(
            found.starts_with("dag `log` has an affinity, and its lists"),
            "{found}"
        );
        let found = refused(|dags| dags[0].subtasks[0].waits = vec![Wait::default()]);
        assert!(
            found.starts_with("`sense.read` waits, and a list does not"),
            "{found}"
        );
        let found = refused(|dags| dags[1].period_ns = Some((1 << 57) - 1));
        assert!(
            found.starts_with("a lap is the least common multiple"),
            "{found}"
        );
        let found = refused(|dags| dags[1].period_ns = Some(1_000_000));
        assert!(
            found.starts_with("a lap of its DAGs has 200001 entries, more than"),
            "{found}"
        );
    }
}
