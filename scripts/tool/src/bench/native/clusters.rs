//! Two clusters of one core each, next to one core alone: what they do together.
//!
//! Each cluster runs a graph of its own, as often as it can. A *window* is some rounds of the
//! first cluster; what the second one did within the same time counts, too. So nothing is
//! counted of times at which only one of them had its processor.

use std::time::Instant;

use sched_dag::Policy;

use super::figure::Figure;
use super::workload::{Graph, Rounds, commit, empty, machine, run};

/// How often one and two clusters take turns, so that a change of the host's speed meets both.
const PASSES: usize = 6;

/// About how many instances a round has: some 50 us, less than a host's time slice.
const INSTANCES_A_ROUND: u64 = 2_000;

/// How many rounds a window has.
const WINDOW: usize = 4;

/// Measures both, with so many windows each at least, adds the figures, and returns for each graph
/// how many times the instances two clusters do.
pub(super) fn measure(
    windows: usize,
    figures: &mut Vec<Figure>,
) -> Result<Vec<(Graph, f64)>, String> {
    let mut all = Vec::new();
    for graph in [Graph::CHAIN, Graph::LAYERED] {
        let mut samples = [Vec::new(), Vec::new()];
        for _ in 0..PASSES {
            for (clusters, samples) in (1..).zip(&mut samples) {
                samples.extend(pass(graph, windows, clusters)?);
            }
        }
        if samples.iter().any(Vec::is_empty) {
            return Err(format!(
                "{graph}: the two clusters never ran at one time; ask for more rounds"
            ));
        }
        let [alone, both] = samples;
        let figure =
            |what, workers, samples| Figure::new(graph, what, "closures, static", workers, samples);
        let alone = figure("per instance, one core", 1, alone);
        let both = figure("per instance, two clusters", 2, both);
        all.push((graph, alone.min() / both.min()));
        figures.extend([alone, both]);
    }
    Ok(all)
}

/// Runs so many clusters, and returns what an instance took in each window.
fn pass(graph: Graph, windows: usize, clusters: u32) -> Result<Vec<f64>, String> {
    let jobs_a_round = INSTANCES_A_ROUND.div_ceil(graph.instances() as u64);
    let a_round = jobs_a_round as f64 * graph.instances() as f64;
    let rounds = windows.div_ceil(PASSES) + 2 * WINDOW;
    let jobs = jobs_a_round * rounds as u64 + 1;
    let marks: Vec<Rounds> = (0..clusters).map(|_| Rounds::default()).collect();
    let mut machine = machine(Policy::StaticPriority, clusters)?;
    if clusters > 1 {
        machine = machine.with(|terms| terms.divide(&vec![1; clusters as usize]));
    }
    let functions = marks.iter().map(|marks| empty(graph, marks, jobs_a_round));
    commit(graph, jobs, functions.collect());
    run(&machine, jobs).map_err(|why| format!("{graph}: {why}"))?;
    let times: Vec<_> = marks.iter().map(Rounds::times).collect();
    Ok(per_instance(&times, a_round))
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

    use super::{WINDOW, per_instance};

    #[test]
    fn only_times_at_which_both_run_count() {
        let zero = Instant::now();
        let at = |us: u64| zero + Duration::from_micros(us);
        let first: Vec<Instant> = (0..30).map(|round| at(10 * round)).collect();
        // The second one stands still from 100 us to 200 us.
        let standing = (0..=10).chain(20..=30);
        let second: Vec<Instant> = standing.map(|round| at(10 * round)).collect();
        let alone = per_instance(std::slice::from_ref(&first), 1_000.0);
        let is_10 = |ns: &f64| (ns - 10.0).abs() < 0.001;
        assert!(alone.iter().all(is_10), "{alone:?}");
        let both = per_instance(&[first, second], 1_000.0);
        assert_eq!(both.len(), 30 - 2 * WINDOW);
        let least = both.iter().copied().fold(f64::MAX, f64::min);
        let most = both.iter().copied().fold(0.0, f64::max);
        assert!((least - 5.0).abs() < 0.001 && most > 9.0, "{both:?}");
    }
}
