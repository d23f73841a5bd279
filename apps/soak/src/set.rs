//! Drawing a set of DAGs for a load.
//!
//! The *load* is what the set executes on average, in percent of all cores. The
//! execution time of an instance is uniform between [`LEAST_PERCENT`] percent of
//! the subtask's WCET and the WCET, so WCETs are drawn for a load that is higher
//! by the ratio of WCET and mean.
//!
//! Every DAG by itself could be served forever: no subtask's WCET exceeds
//! [`MOST_OF_PERIOD`] percent of the period (its instances run one after the
//! other), and the relative deadline is at least the period and longer than the
//! longest path. So at a load below 100 percent what is late is due to other
//! DAGs, and above that it is due to the load.

use alloc::vec::Vec;

use crate::graph::{self, Edge};
use crate::shares::share_out;
use common::random::{Random, nth};

/// The shortest execution time of a subtask, in percent of its WCET.
pub const LEAST_PERCENT: u64 = 40;

/// The longest WCET of a subtask, in percent of its DAG's period.
pub const MOST_OF_PERIOD: u64 = 80;

/// The periods to draw from, in milliseconds.
const PERIODS_MS: [u64; 6] = [2, 5, 10, 20, 50, 100];

/// The numbers of DAGs and of each DAG's subtasks.
const MOST_DAGS: u64 = 8;
const MOST_SUBTASKS: u64 = 12;

const MS: u64 = 1_000_000;

/// A millionth of a core's time.
const PARTS: u64 = 1_000_000;

/// What is drawn for a DAG.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DagPlan {
    /// The time between two releases.
    pub period_ns: u64,
    /// The time of the first release.
    pub offset_ns: u64,
    /// The time from a release to the deadline: a multiple of the period.
    pub relative_deadline_ns: u64,
    /// The most jobs in flight.
    pub in_flight: u32,
    /// The priority of all its subtasks: rate monotonic.
    pub priority: u32,
    /// Its subtasks.
    pub subtasks: Vec<SubtaskPlan>,
    /// Its edges, from lower numbers to higher ones.
    pub edges: Vec<Edge>,
}

/// What is drawn for a subtask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SubtaskPlan {
    /// The longest execution time of an instance.
    pub wcet_ns: u64,
    /// Whether a started instance keeps its core.
    pub non_preemptive: bool,
    /// The seed of its execution times.
    pub seed: u64,
}

/// Draws the DAGs of one round: 3 to 8, of 3 to 12 subtasks each, that load
/// `cores` cores with `load_percent` percent of their time.
#[must_use]
pub fn draw_set(seed: u64, round: u64, load_percent: u64, cores: u32) -> Vec<DagPlan> {
    let mut random = Random::new(nth(seed, round));
    let mean_percent = u64::midpoint(LEAST_PERCENT, 100);
    let load = u64::from(cores) * load_percent * PARTS / mean_percent;
    let sizes = draw_sizes(load, &mut random);
    let limits: Vec<u64> = sizes
        .iter()
        .map(|&size| size * most_parts() * 3 / 4)
        .collect();
    let loads = share_out(load, &limits, &mut random);
    let mut dags: Vec<DagPlan> = sizes
        .iter()
        .zip(loads)
        .map(|(&size, load)| draw_dag(size, load, &mut random))
        .collect();
    set_priorities(&mut dags);
    dags
}

/// Returns the largest set there can be, with one short job for each DAG: what
/// runs it has all memory that any round needs.
#[must_use]
pub fn largest_set() -> Vec<DagPlan> {
    let mut random = Random::new(0);
    let dags = 0..MOST_DAGS;
    dags.map(|_| draw_dag(MOST_SUBTASKS, PARTS / 2, &mut random))
        .collect()
}

const fn most_parts() -> u64 {
    PARTS * MOST_OF_PERIOD / 100
}

/// Draws the number of subtasks of each DAG, until they can bear the load.
fn draw_sizes(load: u64, random: &mut Random) -> Vec<u64> {
    loop {
        let dags = random.within(3..=MOST_DAGS);
        let sizes: Vec<u64> = (0..dags)
            .map(|_| random.within(3..=MOST_SUBTASKS))
            .collect();
        let total: u64 = sizes.iter().sum();
        // A load that nothing can bear takes the largest set.
        if total * most_parts() * 2 / 3 >= load {
            return sizes;
        }
        if MOST_DAGS * MOST_SUBTASKS * most_parts() / 2 < load {
            return (0..MOST_DAGS).map(|_| MOST_SUBTASKS).collect();
        }
    }
}

/// Draws a DAG of `size` subtasks that takes `load` millionths of a core.
fn draw_dag(size: u64, load: u64, random: &mut Random) -> DagPlan {
    /// The shortest WCET: less than that is mostly the kernel's own time.
    const LEAST_WCET_NS: u64 = 5_000;
    let period_ns = PERIODS_MS[random.index(PERIODS_MS.len())] * MS;
    let limits: Vec<u64> = (0..size).map(|_| most_parts()).collect();
    let shares = share_out(load, &limits, random);
    let subtasks: Vec<SubtaskPlan> = shares
        .into_iter()
        .map(|share| SubtaskPlan {
            wcet_ns: (period_ns / 1000 * share / 1000).max(LEAST_WCET_NS),
            non_preemptive: random.once_in(16),
            seed: random.number(),
        })
        .collect();
    let edges = graph::draw(subtasks.len(), random);
    let wcets_ns: Vec<u64> = subtasks.iter().map(|subtask| subtask.wcet_ns).collect();
    let path_ns = graph::longest_path_ns(&wcets_ns, &edges);
    let periods = (path_ns + path_ns / 4).div_ceil(period_ns).max(1);
    let in_flight = periods + random.within(0..=1);
    let offset_ns = if random.once_in(2) {
        random.within(0..=period_ns)
    } else {
        0
    };
    DagPlan {
        period_ns,
        offset_ns,
        relative_deadline_ns: periods * period_ns,
        in_flight: u32::try_from(in_flight).unwrap_or(u32::MAX),
        priority: 0,
        subtasks,
        edges,
    }
}

/// Gives the DAG with the shorter period the higher priority.
fn set_priorities(dags: &mut [DagPlan]) {
    let mut order: Vec<usize> = (0..dags.len()).collect();
    order.sort_by_key(|&dag| dags[dag].period_ns);
    for (priority, dag) in (0..).zip(order) {
        dags[dag].priority = priority;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the WCETs' load in percent of the cores.
    fn load_percent(dags: &[DagPlan], cores: u64) -> u64 {
        let of_dag = |dag: &DagPlan| {
            let wcet_ns: u64 = dag.subtasks.iter().map(|subtask| subtask.wcet_ns).sum();
            wcet_ns * PARTS / dag.period_ns
        };
        dags.iter().map(of_dag).sum::<u64>() * 100 / cores / PARTS
    }

    #[test]
    fn sets_have_the_load_that_is_asked_for() {
        for (load, cores) in [(90, 4), (130, 4), (50, 1), (90, 8)] {
            for round in 0..100 {
                let dags = draw_set(1, round, load, cores);
                assert!((3..=8).contains(&dags.len()));
                let wanted = load * 100 / 70;
                let drawn = load_percent(&dags, cores.into());
                // Very short WCETs are rounded up.
                assert!(
                    (wanted - 2..=wanted + 15).contains(&drawn),
                    "{drawn}, not {wanted}"
                );
            }
        }
    }

    #[test]
    fn every_dag_alone_could_be_served() {
        for round in 0..200 {
            for dag in draw_set(2, round, 130, 4) {
                assert!((3..=12).contains(&dag.subtasks.len()));
                for subtask in &dag.subtasks {
                    assert!(subtask.wcet_ns * 100 <= dag.period_ns * MOST_OF_PERIOD);
                }
                assert!(dag.relative_deadline_ns >= dag.period_ns);
                let wcets: Vec<_> = dag.subtasks.iter().map(|subtask| subtask.wcet_ns).collect();
                assert!(graph::longest_path_ns(&wcets, &dag.edges) < dag.relative_deadline_ns);
            }
        }
    }

    #[test]
    fn priorities_are_rate_monotonic_and_all_different() {
        let mut dags = draw_set(3, 0, 90, 4);
        dags.sort_by_key(|dag| dag.priority);
        assert!(dags.is_sorted_by_key(|dag| dag.period_ns));
        assert!(
            (0..)
                .zip(&dags)
                .all(|(priority, dag)| dag.priority == priority)
        );
    }

    #[test]
    fn a_seed_and_a_round_are_one_set() {
        assert_eq!(draw_set(1, 7, 90, 4), draw_set(1, 7, 90, 4));
        assert_ne!(draw_set(1, 7, 90, 4), draw_set(1, 8, 90, 4));
        assert_ne!(draw_set(1, 7, 90, 4), draw_set(2, 7, 90, 4));
    }

    #[test]
    fn no_load_is_too_high_to_draw_for() {
        assert_eq!(draw_set(1, 0, 10_000, 64).len(), 8);
    }
}
