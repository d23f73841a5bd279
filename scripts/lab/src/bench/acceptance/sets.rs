//! Random sets of DAGs of a given utilization.
//!
//! A graph is a fork-join of 2 to 8 branches, or has 3 to 5 layers of 1 to 5 subtasks with an edge
//! to and from each, or has 6 to 18 subtasks with 15 % of all possible edges. WCETs are multiples
//! of 10 up to 1,000. [`melani`] draws another author's graphs. The DAGs of a set share its
//! utilization, and each division is as likely as any other, as in UUniFast (E. Bini, G. Buttazzo,
//! Real-Time Systems 30, 2005). Sets in which a DAG would need more than its volume over its
//! longest path are thrown away.

use std::collections::BTreeSet;
use std::ops::Range;

use random::Random;
use sched_dag::analysis::Task;

use super::melani;

/// The kind of random sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::bench) enum Generator {
    /// Graphs of ours, with periods that follow from shares of the utilization.
    Ours,
    /// The same, with periods on a grid, and WCETs in proportion.
    Grid,
    /// Eight of Melani's graphs, of up to 8 branches, three deep.
    Melani,
    /// Four of Melani's graphs, of up to 4 branches, two deep: sets as large as other
    /// implementations take.
    Small,
}

impl Generator {
    /// The words of the kinds.
    pub(in crate::bench) const WORDS: &[&str] = &["ours", "grid", "melani", "small"];
    const ALL: [Self; 4] = [Self::Ours, Self::Grid, Self::Melani, Self::Small];

    /// Returns the kind of a word; ours, if the word is unknown.
    pub(in crate::bench) fn of_word(word: &str) -> Self {
        let place = Self::WORDS.iter().position(|known| *known == word);
        Self::ALL[place.unwrap_or(0)]
    }

    /// Returns the number of DAGs of a set.
    fn dags(self, cores: u32) -> u32 {
        match self {
            Self::Ours | Self::Grid => cores.max(8),
            Self::Melani => 8,
            Self::Small => 4,
        }
    }

    fn graph(self, random: &mut Random) -> Task {
        match self {
            Self::Ours | Self::Grid => graph(random),
            Self::Melani => melani::graph(random, 8, 3),
            Self::Small => melani::graph(random, 4, 2),
        }
    }
}

/// The grid of periods, in microseconds, from a robot's rates.
const GRID: [u64; 6] = [5_000, 10_000, 20_000, 40_000, 50_000, 100_000];

/// The relation of deadlines to periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Deadlines {
    /// `D = T`.
    Implicit,
    /// `D` is uniform from the longest path to `T`.
    Constrained,
}

impl Deadlines {
    pub(super) const ALL: [Self; 2] = [Self::Implicit, Self::Constrained];

    /// Returns the names in a file and in a picture.
    pub(super) const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Implicit => ("implicit", "D = T"),
            Self::Constrained => ("constrained", "D ≤ T"),
        }
    }
}

/// The parts of a core, in which shares are counted.
const PARTS: u64 = 1 << 32;

/// The number of divisions of the utilization tried before other graphs are drawn.
const TRIES: u32 = 300;

/// Draws a set for some cores, with a utilization of `percent` of the cores, below 100.
pub(super) fn draw(
    random: &mut Random,
    generator: Generator,
    cores: u32,
    percent: u64,
    deadlines: Deadlines,
) -> Vec<Task> {
    let whole = PARTS * u64::from(cores) * percent / 100;
    loop {
        let graphs: Vec<Task> = (0..generator.dags(cores))
            .map(|_| generator.graph(random))
            .collect();
        for _ in 0..TRIES {
            // The gaps between sorted random points are uniform among all divisions of the whole.
            let points = (1..graphs.len()).map(|_| random.within(0..=whole));
            let mut points: Vec<u64> = points.collect();
            points.extend([0, whole]);
            points.sort_unstable();
            let shares = points.windows(2).map(|pair| pair[1] - pair[0]);
            let dags = graphs.iter().zip(shares);
            let timed = dags.map(|(graph, share)| match generator {
                Generator::Grid => on_grid(random, graph, share, deadlines),
                _ => timed(random, graph, share, deadlines),
            });
            if let Some(set) = timed.collect() {
                return set;
            }
        }
    }
}

/// Gives a graph a deadline, and the period at which its work takes a share of a core, in parts;
/// `None` if the longest path does not fit.
fn timed(random: &mut Random, graph: &Task, share: u64, deadlines: Deadlines) -> Option<Task> {
    let (volume, length) = (graph.volume_ns(), graph.length_ns());
    let work = u128::from(volume) * u128::from(PARTS);
    if share == 0 || u128::from(share) * u128::from(length) > work {
        return None;
    }
    let period = u64::try_from(work.div_ceil(share.into())).ok()?;
    due(random, graph, period, deadlines)
}

/// Gives a graph a period of the grid, a deadline, and WCETs scaled to take at most a share of a
/// core.
fn on_grid(random: &mut Random, graph: &Task, share: u64, deadlines: Deadlines) -> Option<Task> {
    let period = random.one_of(&GRID);
    let work = u128::from(share) * u128::from(period) / u128::from(PARTS);
    let scaled = |&wcet: &u64| u128::from(wcet) * work / u128::from(graph.volume_ns());
    let wcets = graph.wcets_ns().iter().map(scaled);
    let wcets = wcets.map(|wcet| u64::try_from(wcet).ok().map(|ns| ns.max(1)));
    let scaled = Task::new(period, period, wcets.collect::<Option<_>>()?, &edges(graph)).ok()?;
    due(random, &scaled, period, deadlines)
}

/// Gives a graph a period and a deadline; `None` if its longest path is beyond the period.
fn due(random: &mut Random, graph: &Task, period: u64, deadlines: Deadlines) -> Option<Task> {
    let length = graph.length_ns();
    let deadline = match deadlines {
        _ if length > period => return None,
        Deadlines::Implicit => period,
        Deadlines::Constrained => random.within(length..=period),
    };
    Task::new(period, deadline, graph.wcets_ns().to_vec(), &edges(graph)).ok()
}

/// Returns the edges of a graph.
pub(super) fn edges(graph: &Task) -> Vec<(usize, usize)> {
    let of = |from| graph.successors(from).map(move |to| (from, to));
    (0..graph.subtask_count()).flat_map(of).collect()
}

/// Draws a graph with WCETs.
fn graph(random: &mut Random) -> Task {
    let (subtasks, edges) = match random.index(3) {
        0 => {
            let branches = 1..=random.within(2..=8_usize);
            let end = branches.end() + 1;
            let edges = branches.flat_map(|branch| [(0, branch), (branch, end)]);
            (end + 1, edges.collect())
        }
        1 => layers(random),
        _ => {
            let subtasks = random.within(6..=18);
            (subtasks, random.edges(subtasks, 15).collect())
        }
    };
    let wcets = (0..subtasks).map(|_| 10 * random.within(1..=100));
    let task = Task::new(1, 1, wcets.collect(), &edges);
    task.expect("its WCETs are above 0 and its edges lead to larger numbers")
}

/// Draws the number of subtasks and the edges of a graph in layers.
fn layers(random: &mut Random) -> (usize, Vec<(usize, usize)>) {
    let mut layers: Vec<Range<usize>> = Vec::new();
    let mut subtasks = 0;
    for _ in 0..random.within(3..=5) {
        let end = subtasks + random.within(1..=5_usize);
        layers.push(subtasks..end);
        subtasks = end;
    }
    let mut edges = BTreeSet::new();
    for pair in layers.windows(2) {
        let (above, below) = (&pair[0], &pair[1]);
        let mut one_of = |layer: &Range<usize>| layer.start + random.index(layer.len());
        edges.extend(below.clone().map(|to| (one_of(above), to)));
        edges.extend(above.clone().map(|from| (from, one_of(below))));
    }
    (subtasks, edges.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_have_the_utilization_that_is_asked_for() {
        let mut random = Random::new(36);
        for (cores, percent) in [(1, 50), (4, 95), (16, 70)] {
            for deadlines in Deadlines::ALL {
                // Four small DAGs cannot use many cores.
                let can = |kind: &Generator| *kind != Generator::Small || cores <= 4;
                for kind in Generator::ALL.into_iter().filter(can) {
                    let set = draw(&mut random, kind, cores, percent, deadlines);
                    assert_eq!(set.len(), kind.dags(cores) as usize);
                    let utilization =
                        |task: &Task| task.volume_ns() as f64 / task.period_ns() as f64;
                    let sum: f64 = set.iter().map(utilization).sum();
                    let expected = f64::from(cores) * percent as f64 / 100.0;
                    // Periods are rounded up; on a grid WCETs are rounded down, but not to 0.
                    let is_near = (0.97 * expected..=1.001 * expected).contains(&sum);
                    assert!(is_near, "{kind:?} {sum} {expected}");
                    for task in set {
                        let (period, deadline) = (task.period_ns(), task.relative_deadline_ns());
                        assert!(task.length_ns() <= deadline && deadline <= period);
                        assert!(deadlines == Deadlines::Constrained || deadline == period);
                    }
                }
            }
        }
    }

    #[test]
    fn each_layer_is_joined_to_the_next() {
        let mut random = Random::new(36);
        for _ in 0..100 {
            let (subtasks, edges) = layers(&mut random);
            assert!((3..=25).contains(&subtasks));
            let goes = |end: fn(&(usize, usize)) -> usize, subtask| {
                edges.iter().any(|edge| end(edge) == subtask)
            };
            // Only the first layer has none before it, only the last none after it.
            let sources = (0..subtasks).filter(|&of| !goes(|edge| edge.1, of));
            let sinks = (0..subtasks).filter(|&of| !goes(|edge| edge.0, of));
            let (sources, sinks): (Vec<_>, Vec<_>) = (sources.collect(), sinks.collect());
            assert!(sources.iter().copied().eq(0..sources.len()));
            assert!(sinks.iter().copied().eq(subtasks - sinks.len()..subtasks));
            assert!((1..=5).contains(&sources.len()) && (1..=5).contains(&sinks.len()));
        }
    }
}
