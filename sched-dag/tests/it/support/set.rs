//! Random sets of DAGs: all that a run depends on comes from one seed.

use std::sync::Arc;

use random::Random;
use sched_dag::lifecycle::WaitId;
use sched_dag::{
    Activation, ClusterId, CoreList, DagId, DagSpec, FaultLimit, Instance, OnFault, OverrunPolicy,
    Policy, Preemption, Priority, SchedulerOptions, SubtaskId, SubtaskSpec, Table, TableEntry,
    TaskSet, Wait,
};

use super::{commit, shuffled_edges};

/// One set with all that a run depends on.
#[derive(Clone, Debug)]
pub(crate) struct Set {
    pub(crate) options: SchedulerOptions,
    pub(crate) specs: Vec<DagSpec>,
    pub(crate) table: Option<Table>,
    /// The seed of execution times, of faults, and of what a driver is free to choose.
    pub(crate) choices: u64,
}

/// Whether releases may find no room.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Overruns {
    /// As many jobs as there are may be in flight.
    Never,
    /// At most three jobs may be in flight.
    Often,
}

/// The most that a set has of everything.
struct Limits {
    cores: u32,
    dags: u64,
    subtasks: u64,
    jobs: u32,
    period_ns: u64,
    deadline_ns: u64,
    offset_ns: u64,
}

const USUAL: Limits = Limits {
    cores: 4,
    dags: 4,
    subtasks: 7,
    jobs: 6,
    period_ns: 24,
    deadline_ns: 40,
    offset_ns: 20,
};

/// Few enough that each order of events can be gone through.
const TINY: Limits = Limits {
    cores: 2,
    dags: 2,
    subtasks: 3,
    jobs: 2,
    period_ns: 3,
    deadline_ns: 4,
    offset_ns: 1,
};

pub(crate) fn draw(random: &mut Random, overruns: Overruns) -> Set {
    let mut set = draw_within(random, &USUAL, overruns);
    if random.chance(5) {
        set.options.cores = 64;
    }
    set
}

/// Draws a set most of whose DAGs are of one release class.
fn draw_in_phase(random: &mut Random) -> Set {
    let limits = Limits {
        subtasks: 2,
        jobs: 3,
        ..USUAL
    };
    let mut set = draw_within(random, &limits, Overruns::Often);
    let (period_ns, offset_ns) = (set.specs[0].period_ns, set.specs[0].offset_ns);
    let draw = |_| DagSpec {
        period_ns,
        offset_ns,
        ..draw_dag(random, &limits, Overruns::Often)
    };
    set.specs.extend((0..16).map(draw));
    set
}

/// Draws a set with sporadic DAGs, too, and every other one with waits, or a table or groups, or
/// both; some are of many DAGs in phase.
pub(crate) fn draw_disturbed(random: &mut Random) -> Set {
    if random.chance(4) {
        return draw_in_phase(random);
    }
    let overruns = match random.chance(40) {
        true => Overruns::Never,
        false => Overruns::Often,
    };
    let mut set = with_sporadic(draw(random, overruns), random);
    if random.chance(50) {
        set = with_tables(set, random);
    }
    match random.chance(50) {
        true => with_waits(set, random),
        false => set,
    }
}

/// Draws a set of at most three subtasks.
pub(crate) fn draw_tiny(random: &mut Random) -> Set {
    loop {
        let set = draw_within(random, &TINY, Overruns::Often);
        let subtasks = set.specs.iter().map(|spec| spec.subtasks.len());
        if subtasks.sum::<usize>() <= 3 {
            let mut set = with_sporadic(set, random);
            if random.chance(50) {
                set = with_tables(set, random);
            }
            // Of every third one the first subtask waits, once.
            if random.once_in(3) && !set.has_table(DagId(0)) {
                let limit_ns = random.within(0..=1);
                set.specs[0].subtasks[0].waits.push(wait(limit_ns));
            }
            return set;
        }
    }
}

/// A wait whose segments have no WCET.
const fn wait(limit_ns: u64) -> Wait {
    Wait {
        limit_ns,
        segment_ns: None,
    }
}

/// Gives 40 of 100 subtasks up to three waits, every fifth of which has a limit of 0.
fn with_waits(mut set: Set, random: &mut Random) -> Set {
    let tabled = set.table.as_ref().map_or(0, |table| table.dags().len());
    let specs = set.specs.iter_mut().skip(tabled);
    for subtask in specs.flat_map(|spec| &mut spec.subtasks) {
        let waits = random.within(1..=3) * u64::from(random.chance(40));
        let draw = |_| match random.once_in(5) {
            true => wait(0),
            false => wait(random.within(1..=12)),
        };
        subtask.waits = (0..waits).map(draw).collect();
    }
    set
}

/// Has a table run the first DAGs of a set, in most sets; every other set has affinities, too.
pub(crate) fn with_tables(mut set: Set, random: &mut Random) -> Set {
    if random.chance(50) {
        with_affinities(&mut set.specs, set.options.cores, random);
    }
    if random.chance(80) {
        let cores = set.options.cores.min(4);
        let dags = 1 + random.index(set.specs.len());
        set.table = Some(draw_table(&mut set.specs[..dags], cores, random));
    }
    set
}

/// Draws a table of DAGs, which get periods and offsets for it.
///
/// Entries are in an order in which each comes after what it waits for, so no core waits for ever,
/// however deep they are; the lap begins anywhere in that.
pub(crate) fn draw_table(specs: &mut [DagSpec], cores: u32, random: &mut Random) -> Table {
    let period_ns = specs[0].period_ns.unwrap_or(1);
    let is_family = specs.len() > 1;
    let mut jobs = Vec::new();
    for spec in &mut *specs {
        jobs.push(if is_family {
            random.within(1..=2_u32)
        } else {
            1
        });
        if is_family {
            spec.activation = Activation::Periodic;
            spec.period_ns = Some(period_ns * 2 / u64::from(jobs[jobs.len() - 1]));
        }
    }
    let mut left = Vec::new();
    for (dag, spec) in specs.iter().enumerate() {
        for job in 0..jobs[dag] {
            left.extend((0..spec.subtasks.len()).map(|subtask| (dag, job, subtask)));
        }
    }
    let mut order = Vec::new();
    while !left.is_empty() {
        let waits = |of: &(usize, u32, usize), other: &(usize, u32, usize)| {
            let is_edge = specs[of.0].edges.contains(&(other.2, of.2)) && other.1 == of.1;
            // A job is not released before those end that are in flight.
            let is_before = other.1 + specs[of.0].in_flight.unwrap_or(1) <= of.1;
            other.0 == of.0 && (is_edge || is_before || other.2 == of.2 && other.1 < of.1)
        };
        let ready = |of: &usize| !left.iter().any(|other| waits(&left[*of], other));
        let ready: Vec<usize> = (0..left.len()).filter(ready).collect();
        order.push(left.swap_remove(ready[random.index(ready.len())]));
    }
    let first = random.index(order.len());
    let mut lists = vec![Vec::<TableEntry>::new(); cores as usize];
    let most = random.within(0..=3);
    for (place, &(dag, job, subtask)) in (0..).zip(&order).cycle().skip(first).take(order.len()) {
        let list = &mut lists[random.index(cores as usize)];
        let deepest = list.last().map_or(0, |last| last.depth + 1).min(most);
        let of_lap_before = if place < first {
            0
        } else {
            i64::from(jobs[dag])
        };
        list.push(TableEntry {
            dag: DagId(u32::try_from(dag).expect("few DAGs")),
            subtask: SubtaskId(u32::try_from(subtask).expect("few subtasks")),
            job: i64::from(job) - of_lap_before,
            depth: random.within(0..=deepest),
            start_ns: 0,
            length_ns: 0,
        });
    }
    let lists = (0..).zip(lists).filter(|(_, entries)| !entries.is_empty());
    Table {
        cluster: ClusterId(0),
        lap_ns: if is_family { 2 * period_ns } else { period_ns },
        lists: (lists.map(|(core, entries)| (core, entries.into())))
            .map(|(core, entries)| CoreList { core, entries })
            .collect(),
    }
}

/// Gives each DAG the cores of one of up to three groups, in any order, some of them twice.
pub(crate) fn with_affinities(specs: &mut [DagSpec], cores: u32, random: &mut Random) {
    let mut groups = vec![Vec::new(); 4];
    for core in 0..cores {
        let group = random.index(4);
        groups[group].insert(0, core);
        groups[group].extend(random.once_in(4).then_some(core));
    }
    // The cores of the last one are left to a table.
    groups.swap_remove(3);
    groups.retain(|group| !group.is_empty());
    if !groups.is_empty() {
        for spec in specs {
            spec.affinity = groups[random.index(groups.len())].clone();
        }
    }
}

fn with_sporadic(mut set: Set, random: &mut Random) -> Set {
    for spec in &mut set.specs {
        if random.chance(40) {
            spec.activation = Activation::Sporadic;
        }
    }
    set
}

fn draw_within(random: &mut Random, limits: &Limits, overruns: Overruns) -> Set {
    let options = SchedulerOptions {
        policy: random.one_of(&Policy::ALL),
        preemption: match random.chance(75) {
            true => Preemption::Enabled,
            false => Preemption::Disabled,
        },
        cores: random.within(1..=limits.cores),
    };
    let dags = 0..random.within(1..=limits.dags);
    let specs = dags.map(|_| draw_dag(random, limits, overruns));
    Set {
        options,
        specs: specs.collect(),
        table: None,
        choices: random.number(),
    }
}

fn draw_dag(random: &mut Random, limits: &Limits, overruns: Overruns) -> DagSpec {
    let jobs = random.within(1..=limits.jobs);
    let priorities = random.within(0..=6);
    let often_non_preemptive = if random.chance(30) { 40 } else { 0 };
    let subtasks = 0..random.within(1..=limits.subtasks);
    let subtasks = subtasks.map(|_| SubtaskSpec {
        priority: Some(Priority(random.within(0..=priorities))),
        non_preemptive: random.chance(often_non_preemptive),
        ..SubtaskSpec::default()
    });
    let mut subtasks: Vec<SubtaskSpec> = subtasks.collect();
    let period_ns = random.within(1..=limits.period_ns);
    let deadline_ns = match random.chance(40) {
        true => period_ns,
        false => random.within(1..=limits.deadline_ns),
    };
    let percent = random.within(5..=70);
    let edges = shuffled_edges(random, subtasks.len(), percent);
    let has_own_deadlines = random.chance(50);
    for (number, subtask) in subtasks.iter_mut().enumerate() {
        let is_sink = edges.iter().all(|&(from, _)| from != number);
        let is_own = is_sink && has_own_deadlines && random.chance(70);
        subtask.relative_deadline_ns = is_own.then(|| random.within(1..=deadline_ns));
    }
    use OverrunPolicy::{Abort, Queue, Skip};
    let (in_flight, overrun) = match overruns {
        Overruns::Never => (jobs, Queue),
        Overruns::Often => (
            random.within(1..=jobs.min(3)),
            random.one_of(&[Queue, Skip, Abort]),
        ),
    };
    let limit = FaultLimit {
        faults: random.within(1..=3),
        window: random.within(1..=4),
        in_all: random.within(1..=5),
    };
    DagSpec {
        period_ns: Some(period_ns),
        relative_deadline_ns: Some(deadline_ns),
        offset_ns: random.within(0..=limits.offset_ns) * random.within(0..=1),
        jobs: Some(jobs.into()),
        in_flight: Some(in_flight),
        overrun,
        on_fault: random.one_of(&[OnFault::DropJob(limit), OnFault::EndDag]),
        subtasks,
        edges,
        ..DagSpec::default()
    }
}

impl Set {
    /// Commits it.
    pub(crate) fn commit(&self) -> Arc<TaskSet> {
        let mut task_set = commit(&self.specs, self.options);
        Arc::make_mut(&mut task_set).set_tables(self.table.iter().cloned().collect());
        task_set
    }

    /// Reports whether a table has a DAG.
    pub(crate) fn has_table(&self, dag: DagId) -> bool {
        let table = self.table.as_ref();
        table.is_some_and(|table| table.dags().contains(&dag))
    }

    /// Returns the core of an instance's entry, if it has one.
    pub(crate) fn core_of_entry(&self, of: Instance) -> Option<u32> {
        let table = self.table.as_ref()?;
        let jobs = table.lap_ns / self.specs[of.dag.index()].period_ns?;
        let is_it = |entry: &TableEntry| {
            let is_in = (entry.job - of.job.cast_signed())
                .unsigned_abs()
                .is_multiple_of(jobs);
            (entry.dag, entry.subtask) == (of.dag, of.subtask) && is_in
        };
        let list = table
            .lists
            .iter()
            .find(|list| list.entries.iter().any(is_it))?;
        Some(list.core)
    }

    /// Reports whether a DAG takes signals.
    pub(crate) fn is_sporadic(&self, dag: DagId) -> bool {
        self.specs[dag.index()].activation == Activation::Sporadic
    }

    /// Returns how long an instance executes: at most 8, or less where its DAG is a short one.
    pub(crate) fn execution_ns(&self, instance: Instance) -> u64 {
        let of_dag = self.choices ^ u64::from(instance.dag.0);
        let longest_ns = Random::new(of_dag).within(1..=8);
        self.of(instance).within(1..=longest_ns)
    }

    /// Returns how long an instance waits at most, if it has that wait: the limit that its subtask
    /// states, or less in one of four.
    pub(crate) fn limit_ns(&self, wait: WaitId) -> Option<u64> {
        let Instance { dag, subtask, .. } = wait.instance;
        let waits = &self.specs[dag.index()].subtasks[subtask.index()].waits;
        let stated_ns = waits.get(wait.number as usize)?.limit_ns;
        let mut random = self.of_wait(wait);
        Some(match random.once_in(4) {
            true => random.within(0..=stated_ns),
            false => stated_ns,
        })
    }

    /// Returns what is drawn for one wait.
    fn of_wait(&self, wait: WaitId) -> Random {
        Random::new(self.of(wait.instance).number() ^ u64::from(wait.number))
    }

    /// Reports whether an instance fails, which one of 50 does.
    pub(crate) fn fails(&self, instance: Instance) -> bool {
        let mut random = self.of(instance);
        random.number();
        random.chance(2)
    }

    /// Returns what is drawn for one instance.
    fn of(&self, instance: Instance) -> Random {
        let Instance { dag, job, subtask } = instance;
        let number = (u64::from(dag.0) << 40) + (job << 20) + u64::from(subtask.0);
        Random::new(self.choices.wrapping_add(number.wrapping_mul(0x9e37)))
    }
}
