//! Random scenarios: a set of DAGs for a load, and what befalls it.
//!
//! A *round* is a number that with a seed gives one scenario, the same everywhere. Drawn are the
//! policy, the load, the DAGs with their graphs and times, how each treats jobs that overrun, and
//! whether cores are divided. Two of three rounds have *trouble*: functions that fail, after which
//! their DAG ends or goes on, and DAGs that pause others, over and over. In one of eight rounds
//! instances compute, and these have none: where cores take turns, the report of a fault is a
//! longer turn than others may have to wait.
//!
//! Every DAG by itself could be served forever: no subtask takes longer than most of a period, and
//! no path longer than the deadline. So what is late is due to other DAGs.

use alloc::string::String;
use alloc::vec::Vec;
use alloc::{format, vec};
use core::time::Duration;

use fass::{FaultLimit, OverrunPolicy, Policy, Preemption};
use random::{Random, nth};

use crate::Scenario;
use crate::dag::{DagText, Replaced, SubtaskText, Use};

/// The periods to draw from, the more urgent first.
const PERIODS_MS: [u64; 6] = [2, 5, 10, 20, 50, 100];

/// How long an instance executes at least, in percent of its WCET.
const LEAST_PERCENT: u64 = 40;

/// The most times that are drawn for a subtask; later calls take the last one.
const MOST_TIMES: u64 = 32;

/// The draw for all DAGs of a round.
struct Round {
    length: Duration,
    /// The average of a subtask's WCETs, in millionths of a core.
    share: u64,
    dags: u64,
    computes: bool,
    is_divided: bool,
    has_trouble: bool,
}

impl Scenario {
    /// Draws a round for so many cores, in which each DAG releases jobs for `length`: 3 to 8 DAGs
    /// of 3 to 12 subtasks, and up to one more that fails.
    #[must_use]
    pub fn random(seed: u64, round: u64, cores: u32, length: Duration) -> Self {
        let random = &mut Random::new(nth(seed, round));
        let (policy, name) = match random.once_in(2) {
            true => (Policy::Edf, "edf"),
            false => (Policy::StaticPriority, "static"),
        };
        let (load, computes) = (random.within(60..=140), random.once_in(8));
        let sizes = random.within(3..=8);
        let sizes: Vec<u64> = (0..sizes).map(|_| random.within(3..=12)).collect();
        // Where instructions are counted, all cores together compute as much as one.
        let together = if computes { 1 } else { u64::from(cores) };
        let mean_percent = u64::midpoint(LEAST_PERCENT, 100);
        let drawn = Round {
            length,
            share: load * together * 1_000_000 / mean_percent / sizes.iter().sum::<u64>(),
            dags: sizes.len() as u64,
            computes,
            is_divided: cores > 1 && random.once_in(2),
            has_trouble: !computes && !random.once_in(3),
        };
        let title = format!("round {round}: {name}, {load} % of {cores} cores");
        Self {
            cores,
            clusters: match drawn.is_divided {
                true => vec![cores / 2, cores - cores / 2],
                false => vec![],
            },
            policy,
            preemption: match random.once_in(8) {
                true => Preemption::Disabled,
                false => Preemption::Enabled,
            },
            dags: ((0..).zip(sizes))
                .map(|(number, size)| drawn.dag(number, size, random))
                .collect(),
            ..Self::new(&title)
        }
    }
}

impl Round {
    #[allow(
        clippy::too_many_lines,
        reason = "draws in an order on which each seed's round depends"
    )]
    fn dag(&self, number: u64, size: u64, random: &mut Random) -> DagText {
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
            let mut before: Vec<usize> = before
                .map(|_| first + random.index(place - first))
                .collect();
            before.sort_unstable();
            before.dedup();
            let start_ns = before.iter().map(|before| ends_ns[*before]).max();
            ends_ns.push(start_ns.unwrap_or(0) + wcet_ns);
            let mut take = |_| wcet_ns / 100 * random.within(LEAST_PERCENT..=100);
            subtasks.push(SubtaskText {
                name: format!("{}-{place}", name_of(number)),
                takes: (0..jobs.min(MOST_TIMES))
                    .map(|job| Duration::from_nanos(take(job)))
                    .collect(),
                after: (before.iter())
                    .map(|before| subtasks[*before].name.clone())
                    .collect(),
                priority: u32::try_from(urgency).ok(),
                wcet: Some(Duration::from_nanos(wcet_ns)),
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
            cluster: self.is_divided.then_some(u32::from(number % 2 == 1)),
            subtasks,
            ..DagText::default()
        };
        if self.has_trouble && random.once_in(2) {
            let other = name_of((number + random.within(1..=self.dags - 1)) % self.dags);
            let calls = |first| (first..jobs).step_by(4).collect();
            dag.subtasks[0].uses = Use::Switches(other, calls(3));
            dag.subtasks[0].when = calls(1);
        }
        if self.has_trouble && random.once_in(2) {
            dag.fail(random);
        }
        dag
    }
}

impl DagText {
    /// Adds a subtask of which a call fails. It has no WCET: the report of a fault takes its time.
    fn fail(&mut self, random: &mut Random) {
        const REPLACED: [Replaced; 3] = [Replaced::Never, Replaced::Anew, Replaced::ByFallback];
        let replaced = REPLACED[random.index(REPLACED.len())];
        self.survives = (replaced != Replaced::Never).then_some(FaultLimit {
            faults: 1,
            window: 1,
            in_all: 1,
        });
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
