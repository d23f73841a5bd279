//! Two clusters of one core each, next to one core alone: what they do together.
//!
//! Each cluster runs a graph of its own, as often as it can. A *window* is some rounds of the
//! first cluster; what the second one did within the same time counts, too. So nothing is
//! counted of times at which only one of them had its processor.

use std::time::Instant;

use sched_dag::Policy;

use super::figure::Figure;
use super::workload::{Graph, Rounds, commit, empty, machine};

/// The graphs that are measured.
const GRAPHS: [Graph; 2] = [Graph::Chain, Graph::Layered];

/// How often one and two clusters take turns, so that a change of the host's speed meets both.
const PASSES: usize = 6;

/// About how many instances a round has: some 50 us, less than a host's time slice.
const INSTANCES_A_ROUND: u64 = 2_000;

/// How many rounds a window has.
const WINDOW: usize = 4;

/// What two clusters do, compared with one core.
pub(super) struct Together {
    pub(super) figures: Vec<Figure>,
    /// For each graph, how many times the instances.
    times: Vec<(Graph, f64)>,
}

impl Together {
    /// Returns a line for people for each graph.
    pub(super) fn lines(&self) -> String {
        let line = |(graph, times): &(Graph, f64)| {
            format!(
                "{graph}: two clusters of one core each do {times:.2} times what one core does\n"
            )
        };
        self.times.iter().map(line).collect()
    }

    /// Returns a line for programs for each.
    pub(super) fn json(&self) -> String {
        let line = |(graph, times): &(Graph, f64)| {
            format!(
                "{{\"kind\":\"bench\",\"name\":\"native-clusters\",\"workload\":\"{graph}\",\
                 \"clusters\":2,\"times\":{times:.3}}}\n"
            )
        };
        self.times.iter().map(line).collect()
    }
}

/// Measures both, with so many windows each at least.
pub(super) fn measure(windows: usize) -> Result<Together, String> {
    let mut together = Together {
        figures: Vec::new(),
        times: Vec::new(),
    };
    for graph in GRAPHS {
        let (mut alone, mut both) = (Vec::new(), Vec::new());
        let jobs_a_round = INSTANCES_A_ROUND.div_ceil(graph.instances() as u64);
        let a_round = jobs_a_round as f64 * graph.instances() as f64;
        let rounds = windows.div_ceil(PASSES) + 2 * WINDOW;
        let jobs = jobs_a_round * rounds as u64 + 1;
        let run = |workers: u32| {
            let marks: Vec<Rounds> = (0..workers).map(|_| Rounds::default()).collect();
            let machine = machine(Policy::StaticPriority, workers)?.divided();
            let functions = marks.iter().map(|marks| empty(graph, marks, jobs_a_round));
            commit(graph, jobs, functions.collect());
            let ran = machine.run(jobs);
            ran.map_err(|why| format!("{graph}: {why}"))?;
            Ok::<_, String>(marks.iter().map(Rounds::times).collect::<Vec<_>>())
        };
        for _ in 0..PASSES {
            alone.extend(per_instance(&run(1)?, a_round));
            both.extend(per_instance(&run(2)?, a_round));
        }
        if alone.is_empty() || both.is_empty() {
            return Err(format!(
                "{graph}: the two clusters never ran at one time; ask for more rounds"
            ));
        }
        let alone = Figure::new(
            graph,
            "per instance, one core",
            "closures, static",
            1,
            alone,
        );
        let both = Figure::new(
            graph,
            "per instance, two clusters",
            "closures, static",
            2,
            both,
        );
        together.times.push((graph, alone.min() / both.min()));
        together.figures.extend([alone, both]);
    }
    Ok(together)
}

/// Returns what an instance took, of all clusters, in each window of the first one that lies
/// within the others' times.
fn per_instance(times: &[Vec<Instant>], a_round: f64) -> Vec<f64> {
    let [first, others @ ..] = times else {
        return Vec::new();
    };
    // The first ones warm up.
    let windows = first.windows(WINDOW + 1).skip(WINDOW);
    let of_window = |window: &[Instant]| {
        let (from, to) = (window[0], window[WINDOW]);
        let mut rounds = WINDOW as f64;
        for other in others {
            rounds += rounds_by(other, to)? - rounds_by(other, from)?;
        }
        Some((to - from).as_secs_f64() * 1e9 / (rounds * a_round))
    };
    windows.filter_map(of_window).collect()
}

/// Returns how many rounds were over by an instant, in parts of one; `None` before the first one
/// and after the last.
fn rounds_by(times: &[Instant], at: Instant) -> Option<f64> {
    let next = times.partition_point(|&time| time <= at);
    let (before, after) = (*times.get(next.checked_sub(1)?)?, *times.get(next)?);
    let part = (at - before).as_secs_f64() / (after - before).as_secs_f64();
    Some((next - 1) as f64 + part)
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{WINDOW, measure, per_instance};

    #[test]
    fn only_times_at_which_both_run_count() {
        let zero = Instant::now();
        let at = |us: u64| zero + Duration::from_micros(us);
        let first: Vec<Instant> = (0..30).map(|round| at(10 * round)).collect();
        // The second one stands still from 100 us to 200 us.
        let standing = (0..=10).chain(20..=30);
        let second: Vec<Instant> = standing.map(|round| at(10 * round)).collect();
        let alone = per_instance(std::slice::from_ref(&first), 1_000.0);
        assert!(
            alone.iter().all(|ns| (ns - 10.0).abs() < 0.001),
            "{alone:?}"
        );
        let both = per_instance(&[first, second], 1_000.0);
        assert_eq!(both.len(), 30 - 2 * WINDOW);
        let least = both.iter().copied().fold(f64::MAX, f64::min);
        let most = both.iter().copied().fold(0.0, f64::max);
        assert!((least - 5.0).abs() < 0.001 && most > 9.0, "{both:?}");
    }

    #[test]
    fn a_short_run_has_a_figure_for_each_graph() {
        if linux::processors() < 2 {
            return;
        }
        let Ok(together) = measure(600) else {
            // On a host that never gives us both processors there is nothing to see.
            return;
        };
        assert_eq!(together.figures.len(), 4);
        assert_eq!(together.lines().lines().count(), 2);
        assert!(
            together
                .json()
                .lines()
                .all(|line| line.contains("\"clusters\":2"))
        );
    }
}
