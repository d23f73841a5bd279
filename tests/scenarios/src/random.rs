//! Random scenarios: a set of DAGs for a load, and its troubles.
//!
//! A *round* is a number; with a seed it gives a scenario, the same everywhere. The draw decides
//! the policy, the load, the DAGs with their graphs and times, each DAG's overrun policy, and
//! whether clusters divide the cores. Each of these features is in about half of the rounds: tables
//! for some DAGs, waiting subtasks, sinks with their own deadlines, DAGs released by others, and
//! two modes taking turns. Two of three rounds have *trouble*: functions fail, and then their DAG
//! ends or goes on; and DAGs pause others, over and over. In one of eight rounds instances compute.
//! Such rounds have no trouble: where cores take time slices, the report of a fault would make
//! others wait for longer than allowed.
//!
//! Every DAG by itself could be served forever: no subtask takes longer than most of a period, and
//! no path longer than the deadline. So other DAGs cause all lateness.

use alloc::string::String;
use alloc::vec::Vec;
use alloc::{format, vec};
use core::time::Duration;

use fass::{FaultLimit, OverrunPolicy, Policy, Preemption};
use random::{Random, nth};

use crate::Scenario;
use crate::dag::{DagText, Replaced, SubtaskText, Use, WaitText};

/// The periods to draw from, the most urgent first.
const PERIODS_MS: [u64; 6] = [2, 5, 10, 20, 50, 100];

/// The shortest execution of an instance, in percent of its WCET.
const LEAST_PERCENT: u64 = 40;

/// The most times drawn for a subtask; later calls take the last time.
const MOST_TIMES: u64 = 32;

/// The draws valid for all DAGs of a round.
struct Round {
    length: Duration,
    /// The average of a subtask's WCETs, in millionths of a core.
    share: u64,
    dags: u64,
    computes: bool,
    /// The number of cores of each cluster.
    clusters: Vec<u32>,
    has_trouble: bool,
    has_sinks: bool,
    has_waits: bool,
    /// Whether each DAG is released by the DAG before it; never for the first.
    is_released: Vec<bool>,
    modes: Vec<(String, Vec<String>)>,
}

impl Scenario {
    /// Draws a round for a number of cores. Each DAG releases jobs for `length`: 3 to 8 DAGs of 3
    /// to 12 subtasks, and up to one more, failing subtask.
    pub fn random(seed: u64, round: u64, cores: u32, length: Duration) -> Self {
        let random = &mut Random::new(nth(seed, round));
        let policy = random.one_of(&Policy::ALL);
        let name = policy.word();
        let (load, computes) = (random.within(60..=140), random.once_in(8));
        let sizes = random.within(3..=8);
        let sizes: Vec<u64> = (0..sizes).map(|_| random.within(3..=12)).collect();
        // Where instructions are counted, all cores together compute as much as one.
        let together = if computes { 1 } else { u64::from(cores) };
        let mean_percent = u64::midpoint(LEAST_PERCENT, 100);
        let is_divided = cores > 1 && random.once_in(2);
        let has_trouble = !computes && !random.once_in(3);
        let [has_lists, has_sinks, has_waits, releases, has_modes] =
            [(); 5].map(|()| random.once_in(2));
        let drawn = Round {
            length,
            share: load * together * 1_000_000 / mean_percent / sizes.iter().sum::<u64>(),
            dags: sizes.len() as u64,
            computes,
            clusters: match is_divided {
                true => vec![cores / 2, cores - cores / 2],
                false => vec![cores],
            },
            has_trouble,
            has_sinks,
            has_waits,
            is_released: (0..sizes.len())
                .map(|number| number > 0 && releases && random.once_in(3))
                .collect(),
            modes: match has_modes {
                true => modes(sizes.len() as u64, is_divided, random),
                false => vec![],
            },
        };
        let title = format!("round {round}: {name}, {load} % of {cores} cores");
        let dags: Vec<DagText> = ((0..).zip(sizes))
            .map(|(number, size)| drawn.dag(number, size, random))
            .collect();
        Self {
            lists: match has_lists {
                true => lists(&dags, drawn.clusters[0], random),
                false => vec![],
            },
            cores,
            clusters: match is_divided {
                true => drawn.clusters.clone(),
                false => vec![],
            },
            policy,
            preemption: match random.once_in(8) {
                true => Preemption::Disabled,
                false => Preemption::Enabled,
            },
            dags,
            modes: drawn.modes,
            ..Self::new(&title)
        }
    }
}

/// Draws a table for some DAGs of the first cluster: their subtasks in the order of releases, each
/// on any core, some nested in the entry before.
fn lists(dags: &[DagText], cores: u32, random: &mut Random) -> Vec<String> {
    let may_be_listed = |dag: &&DagText| {
        let waits = dag.subtasks.iter().any(|of| !of.waits.is_empty());
        !waits && !dag.is_sporadic && dag.cluster.unwrap_or(0) == 0
    };
    let mut listed: Vec<&DagText> = dags.iter().filter(may_be_listed).collect();
    listed.retain(|_| random.once_in(2));
    listed.truncate(4);
    let periods_ns: Vec<u128> = listed.iter().map(|dag| dag.period.as_nanos()).collect();
    let longest_ns = periods_ns.iter().max().copied().unwrap_or(1);
    let divides_all = |lap_ns: &u128| {
        periods_ns
            .iter()
            .all(|period_ns| lap_ns.is_multiple_of(*period_ns))
    };
    let lap_ns = (1..).map(|n| n * longest_ns).find(divides_all).unwrap_or(0);
    let mut entries = vec![];
    for (dag, period_ns) in listed.iter().zip(&periods_ns) {
        let phase_ns = dag.offset.as_nanos() % period_ns;
        for job in 0..lap_ns / period_ns {
            let words = dag
                .subtasks
                .iter()
                .map(|of| format!("{}.{}#{job}", dag.name, of.name));
            let of_job = (phase_ns + job * period_ns, words.collect::<Vec<_>>());
            entries.push(of_job);
        }
    }
    entries.sort();
    let mut lists = vec![String::new(); usize::try_from(cores).unwrap_or(0)];
    for word in entries.into_iter().flat_map(|(_, words)| words) {
        let list = random.index(lists.len());
        let is_nested = !lists[list].is_empty() && random.once_in(8);
        lists[list] += &match is_nested {
            true => format!(" ( {word} )"),
            false => format!(" {word}"),
        };
    }
    let lists = (0..)
        .zip(lists)
        .filter(|(_, list): &(u32, String)| !list.is_empty());
    lists
        .map(|(core, list)| format!("core {core}:{list}"))
        .collect()
}

/// Draws two modes: the first has all DAGs of a cluster except the first two DAGs, the second has
/// some of them.
fn modes(dags: u64, is_divided: bool, random: &mut Random) -> Vec<(String, Vec<String>)> {
    let all = (2..dags).filter(|number| !is_divided || number % 2 == 0);
    let some = all.clone();
    let some = some.filter(|number| *number == 2 || random.once_in(2));
    let some = some.map(name_of).collect();
    vec![
        ("all".into(), all.map(name_of).collect()),
        ("some".into(), some),
    ]
}

impl Round {
    #[allow(clippy::too_many_lines, reason = "each seed depends on the order")]
    fn dag(&self, number: u64, size: u64, random: &mut Random) -> DagText {
        let at = usize::try_from(number).unwrap_or(0);
        let urgency = random.index(PERIODS_MS.len());
        let period_ns = PERIODS_MS[urgency] * 1_000_000;
        let length_ns = u64::try_from(self.length.as_nanos()).unwrap_or(u64::MAX);
        let jobs = (length_ns / period_ns).max(1);
        // Of which subtasks before it one may be after: of a chain, of a few layers, of all.
        let reach = [1, 3, 12][random.index(3)];
        let has_sources = random.once_in(4);
        let mut subtasks: Vec<SubtaskText> = vec![];
        // When each ends if nothing delays it.
        let mut ends_ns: Vec<u64> = vec![];
        for place in 0..usize::try_from(size).unwrap_or(0) {
            let wcet_ns = period_ns / 1_000_000 * random.within(0..=2 * self.share);
            let wcet_ns = wcet_ns.clamp(5_000, period_ns / 5 * 4);
            let inputs = match has_sources && random.once_in(4) {
                true => 0,
                false => random.within(1..=3),
            };
            let first = place.saturating_sub(reach);
            let before = (0..inputs).filter(|_| place > 0);
            let before = before.map(|_| first + random.index(place - first));
            let mut before: Vec<usize> = before.collect();
            before.sort_unstable();
            before.dedup();
            let start_ns = before.iter().map(|before| ends_ns[*before]).max();
            // The first ones may have other uses.
            let waits = self.has_waits && place > 2 && random.once_in(3);
            let limit_ns = random.within(0..=period_ns / 8) * u64::from(waits);
            let segment_ns = wcet_ns / (1 + u64::from(waits));
            ends_ns.push(start_ns.unwrap_or(0) + wcet_ns + limit_ns);
            let mut take = |_| segment_ns / 100 * random.within(LEAST_PERCENT..=100);
            let mut takes = || {
                let times = (0..jobs.min(MOST_TIMES)).map(&mut take);
                times.map(Duration::from_nanos).collect()
            };
            subtasks.push(SubtaskText {
                name: format!("{}-{place}", name_of(number)),
                takes: takes(),
                waits: match waits {
                    true => vec![WaitText {
                        limit: Duration::from_nanos(limit_ns),
                        answered: match place % 2 {
                            0 => vec![Duration::from_nanos(limit_ns / 2)],
                            _ => vec![],
                        },
                        takes: takes(),
                        wcet: Some(Duration::from_nanos(segment_ns)),
                    }],
                    false => vec![],
                },
                after: (before.iter())
                    .map(|before| subtasks[*before].name.clone())
                    .collect(),
                priority: u32::try_from(urgency).ok(),
                wcet: Some(Duration::from_nanos(segment_ns)),
                is_non_preemptive: random.once_in(16),
                computes: self.computes,
                ..SubtaskText::default()
            });
        }
        let longest_ns = ends_ns.iter().copied().max().unwrap_or(0);
        let periods = (longest_ns / 4 * 5).div_ceil(period_ns).max(1);
        let offset_ns = random.within(0..=1) * random.within(0..=period_ns);
        let mut dag = DagText {
            name: name_of(number),
            period: Duration::from_nanos(period_ns),
            deadline: Some(Duration::from_nanos(periods * period_ns)),
            offset: Duration::from_nanos(offset_ns),
            jobs,
            in_flight: u32::try_from(periods + random.within(0..=1)).ok(),
            overrun: [
                OverrunPolicy::Queue,
                OverrunPolicy::Skip,
                OverrunPolicy::Abort,
            ][random.index(3)],
            cluster: (self.clusters.len() > 1).then_some(u32::from(number % 2 == 1)),
            is_sporadic: self.is_released[at],
            subtasks,
            ..DagText::default()
        };
        if self.has_trouble && random.once_in(2) {
            let other = name_of((number + random.within(1..=self.dags - 1)) % self.dags);
            let calls = |first| (first..jobs).step_by(4).collect();
            dag.subtasks[0].uses = Use::Switches(other, calls(3));
            dag.subtasks[0].when = calls(1);
        }
        if self.is_released.get(at + 1) == Some(&true) {
            dag.subtasks[1].uses = Use::Raises(name_of(number + 1));
            dag.subtasks[1].when = (0..jobs).filter(|_| random.chance(80)).collect();
        }
        if let Some((name, _)) = self.modes.get(at) {
            let entered = [Use::Enters, Use::EntersIdle][random.index(2)](name.clone());
            dag.subtasks[2].uses = entered;
            dag.subtasks[2].when = (number..jobs).step_by(5).collect();
        }
        if self.has_trouble && random.once_in(2) {
            dag.fail(random);
        }
        if self.has_sinks {
            dag.give_sinks_deadlines(&ends_ns, periods * period_ns, random);
        }
        if dag.is_sporadic {
            // A run would wait for the last one of a number.
            dag.jobs = 0;
        }
        dag
    }
}

impl DagText {
    /// Gives some sinks without other uses their own deadlines, none before the sink's earliest
    /// end.
    fn give_sinks_deadlines(&mut self, ends_ns: &[u64], deadline_ns: u64, random: &mut Random) {
        for (place, end_ns) in ends_ns.iter().enumerate() {
            let (_, is_read) = self.shape(&self.subtasks[place]);
            let subtask = &mut self.subtasks[place];
            if !is_read && subtask.uses == Use::Nothing && random.once_in(2) {
                let due_ns = random.within(*end_ns..=deadline_ns);
                subtask.due = Some(Duration::from_nanos(due_ns));
            }
        }
    }

    /// Adds a subtask with a failing call. The subtask has no WCET: the report of a fault takes its
    /// time.
    fn fail(&mut self, random: &mut Random) {
        const REPLACED: [Replaced; 3] = [Replaced::Never, Replaced::Anew, Replaced::ByFallback];
        let replaced = REPLACED[random.index(REPLACED.len())];
        self.survives = (replaced != Replaced::Never).then_some(FaultLimit::new(1, 1, 1));
        let before = random.index(self.subtasks.len());
        self.subtasks.push(SubtaskText {
            name: format!("{}-frail", self.name),
            takes: vec![Duration::from_micros(20)],
            after: vec![self.subtasks[before].name.clone()],
            priority: self.subtasks[0].priority,
            fails: vec![random.within(0..=self.jobs.div_ceil(2) - 1)],
            replaced,
            ..SubtaskText::default()
        });
    }
}

fn name_of(dag: u64) -> String {
    format!("dag-{dag}")
}
