//! Two clusters of one core each, next to one core alone: what they do together.
//!
//! Each cluster runs a graph of its own, as often as it can. A *window* is some rounds of the
//! first cluster; what the second one did within the same time counts, too. So nothing is
//! counted of times at which only one of them had its processor.

use sched_dag::Policy;

use super::graphs::{Graph, Rounds, commit, empty, machine, run};
use super::{Figure, Row};

/// How often one and two clusters take turns, so that a change of the host's speed meets both.
const PASSES: usize = 6;

/// About how many instances a round has: some 50 us, less than a host's time slice.
const INSTANCES_A_ROUND: u64 = 2_000;

/// How many rounds a window has.
const WINDOW: usize = 4;

/// Rounds are counted in millionths.
const PARTS: u64 = 1_000_000;

/// Measures both, with so many windows each at least, adds the figures, and returns for each graph
/// how many times the instances two clusters do.
pub(super) fn measure(
    windows: usize,
    rows: &mut Vec<Row>,
) -> Result<Vec<(&'static str, f64)>, String> {
    let mut all = Vec::new();
    for graph in [Graph::CHAIN, Graph::LAYERED] {
        let mut samples = [Vec::new(), Vec::new()];
        for _ in 0..PASSES {
            for (clusters, samples) in (1..).zip(&mut samples) {
                samples.extend(pass(graph, windows, clusters)?);
            }
        }
        let name = graph.name;
        if samples.iter().any(Vec::is_empty) {
            return Err(format!(
                "{name}: the two clusters never ran at one time; ask for more rounds"
            ));
        }
        let per = WINDOW as u64 * jobs_a_round(graph) * graph.instances() as u64;
        let [alone, both] = samples;
        let alone = Figure::new((1, name, "per instance, one core"), per, alone);
        let both = Figure::new((2, name, "per instance, two clusters"), per, both);
        all.push((name, alone.min as f64 / both.min as f64));
        rows.extend([alone, both].map(|figure| (figure, "closures, static")));
    }
    Ok(all)
}

fn jobs_a_round(graph: Graph) -> u64 {
    INSTANCES_A_ROUND.div_ceil(graph.instances() as u64)
}

/// Runs so many clusters, and returns what the instances of a window took.
fn pass(graph: Graph, windows: usize, clusters: u32) -> Result<Vec<u64>, String> {
    let jobs_a_round = jobs_a_round(graph);
    let rounds = (windows.div_ceil(PASSES) + 2 * WINDOW) as u64;
    let jobs = jobs_a_round * rounds + 1;
    let marks: Vec<Rounds> = (0..clusters).map(|_| Rounds::default()).collect();
    let mut machine = machine(Policy::StaticPriority, clusters)?;
    if clusters > 1 {
        machine = machine.with(|terms| terms.divide(&vec![1; clusters as usize]));
    }
    let functions = marks.iter().map(|marks| empty(graph, marks, jobs_a_round));
    commit(graph, jobs, functions.collect());
    run(&machine, jobs).map_err(|why| format!("{}: {why}", graph.name))?;
    let times_ns: Vec<_> = marks.iter().map(Rounds::times_ns).collect();
    Ok(of_windows(&times_ns))
}

/// Returns in nanoseconds what the instances of [`WINDOW`] rounds took, by all clusters, in each
/// window of the first one that lies within the others' times.
fn of_windows(times_ns: &[Vec<u64>]) -> Vec<u64> {
    let [first, others @ ..] = times_ns else {
        return Vec::new();
    };
    // The first ones warm up.
    let windows = first.windows(WINDOW + 1).skip(WINDOW);
    let of_window = |window: &[u64]| {
        let (from, to) = (window[0], window[WINDOW]);
        let mut rounds = WINDOW as u64 * PARTS;
        for other in others {
            rounds += parts_by(other, to)? - parts_by(other, from)?;
        }
        Some((to - from) * WINDOW as u64 * PARTS / rounds)
    };
    windows.filter_map(of_window).collect()
}

/// Returns how many rounds were over by an instant, in [`PARTS`] of one; `None` before the first
/// one and after the last.
fn parts_by(times_ns: &[u64], at_ns: u64) -> Option<u64> {
    let next = times_ns.partition_point(|&time_ns| time_ns <= at_ns);
    let over = next.checked_sub(1)?;
    let (before_ns, after_ns) = (times_ns[over], *times_ns.get(next)?);
    Some(over as u64 * PARTS + (at_ns - before_ns) * PARTS / (after_ns - before_ns))
}

#[cfg(test)]
mod tests {
    use super::{WINDOW, of_windows};

    #[test]
    fn only_times_at_which_both_run_count() {
        let at = |us: u64| 1_000 * us;
        let first: Vec<u64> = (0..30).map(|round| at(10 * round)).collect();
        // The second one stands still from 100 us to 200 us.
        let standing = (0..=10).chain(20..=30);
        let second: Vec<u64> = standing.map(|round| at(10 * round)).collect();
        let alone = of_windows(std::slice::from_ref(&first));
        assert!(alone.iter().all(|&ns| ns == at(40)), "{alone:?}");
        let both = of_windows(&[first, second]);
        assert_eq!(both.len(), 30 - 2 * WINDOW);
        let (least, most) = (both.iter().min(), both.iter().max());
        assert_eq!(least, Some(&at(20)), "{both:?}");
        assert!(most > Some(&at(36)), "{both:?}");
    }
}
