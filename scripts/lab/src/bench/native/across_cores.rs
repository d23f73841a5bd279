//! Workloads on two cores: a join across cores, and two clusters of one core each.
//!
//! *The join*: from the last predecessor's return to the sink's start. Two branches compute for 2
//! us, each on its own core; the core whose branch returns last starts the sink. The bodies
//! themselves read the times, in their first and last action. The cost of reading the clock is
//! measured, too, and subtracted once: each stamp encloses half a reading.
//!
//! *The clusters*: each runs a graph of its own, as often as possible; one core alone is measured
//! for comparison. A *window* is some rounds of the first cluster, and includes the second
//! cluster's work in the same time. So no time counts in which only one cluster had its processor.

use std::hint::{black_box, spin_loop};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Instant;

use hand_off::{BodyStamps, StampPen, Tick, commit, empty};
use sched_dag::Policy;

use super::{Figure, MeasuredGraph, NativeRow, PERIOD, RoundTimes, machine, nanoseconds, run_jobs};

const WORKLOAD: &str = "join of 2 us";

/// The computing time of a branch.
const WORK_NS: u64 = 2_000;

/// Measures `jobs` jobs, the clock, and the least cost of a message between cores.
pub(super) fn join(jobs: u64) -> Result<Vec<NativeRow>, String> {
    let mut stamps = BodyStamps::default();
    let functions = [0, WORK_NS, WORK_NS, 0].map(|work_ns| body(work_ns, stamps.pen(jobs)));
    let machine = machine(Policy::StaticPriority, 2)?;
    let functions = vec![vec![functions.into()]];
    commit(MeasuredGraph::JOIN.shape, jobs, PERIOD, functions);
    run_jobs(&machine, jobs).map_err(|why| format!("{WORKLOAD}: {why}"))?;
    let clock = clock();
    let reading_ns = clock.median / clock.per;
    let (mut joins, mut starts) = (Vec::new(), Vec::new());
    for job in jobs / 10..jobs {
        let times = |subtask| Some((stamps.first(subtask, job)?, stamps.last(subtask, job)?));
        let [Some(source), Some(one), Some(other), Some(sink)] = [0, 1, 2, 3].map(times) else {
            continue;
        };
        // The branches overlap, so they ran on two cores: the later one was not started by the
        // source's core.
        if one.0 < other.1 && other.0 < one.1 {
            joins.push(sink.0.saturating_sub(one.1.max(other.1) + reading_ns));
            starts.push(one.0.max(other.0).saturating_sub(source.1 + reading_ns));
        }
    }
    if joins.is_empty() {
        let remedy = "give the workers processors of their own";
        return Err(format!("{WORKLOAD}: no join was across cores; {remedy}"));
    }
    let row = |what, samples| {
        (
            Figure::new((2, WORKLOAD, what), 1, samples),
            "closures, static",
        )
    };
    Ok(vec![
        row("last return -> sink start", joins),
        row("source return -> other core's start", starts),
        (transfer(), ""),
        (clock, ""),
    ])
}

/// Returns a body that computes for `work_ns` by reading the clock, and stamps the first and last
/// reading.
fn body(work_ns: u64, mut pen: StampPen) -> Tick {
    Box::new(move |_| {
        let begun_ns = fass::now_ns();
        pen.put(begun_ns);
        let ended_ns = loop {
            let time_ns = fass::now_ns();
            if time_ns - begun_ns >= work_ns {
                break time_ns;
            }
            spin_loop();
        };
        pen.put(ended_ns);
    })
}

/// Measures the cost of a message to another core: two threads write to each other's cache line in
/// turn.
fn transfer() -> Figure {
    const EXCHANGES: u64 = 200;
    const ROUNDS: u64 = 200;
    /// A number in cache lines of its own.
    #[repr(align(128))]
    struct PaddedNumber(AtomicU64);
    impl PaddedNumber {
        fn tell(&self, exchange: u64) {
            // Release and Acquire, as a scheduler would publish a value with its message.
            self.0.store(exchange, Ordering::Release);
        }

        fn wait_for(&self, exchange: u64) {
            while self.0.load(Ordering::Acquire) < exchange {
                spin_loop();
            }
        }
    }
    let [there, back] = [0, 0].map(|none| PaddedNumber(AtomicU64::new(none)));
    let answer = || {
        for exchange in 1..=ROUNDS * EXCHANGES {
            there.wait_for(exchange);
            back.tell(exchange);
        }
    };
    let round_ns = |round| {
        let start = Instant::now();
        for exchange in 1 + round * EXCHANGES..=(round + 1) * EXCHANGES {
            there.tell(exchange);
            back.wait_for(exchange);
        }
        nanoseconds(start.elapsed())
    };
    let rounds_ns: Vec<u64> = thread::scope(|scope| {
        scope.spawn(answer);
        (0..ROUNDS).map(round_ns).collect()
    });
    Figure::new((2, "", "one cache line, one way"), 2 * EXCHANGES, rounds_ns)
}

/// Measures the cost of reading the clock.
fn clock() -> Figure {
    const READINGS: u64 = 50;
    let readings_ns = (0..2_000).map(|_| {
        let start = Instant::now();
        for _ in 0..READINGS {
            black_box(fass::now_ns());
        }
        nanoseconds(start.elapsed())
    });
    Figure::new((1, "", "reading the clock"), READINGS, readings_ns)
}

/// The number of turns of one and two clusters: a change of the host's speed then affects both.
const PASSES: usize = 6;

/// The approximate number of instances of a round: some 50 us, less than a host's time slice.
const INSTANCES_A_ROUND: u64 = 2_000;

/// The number of rounds of a window.
const WINDOW: usize = 4;

/// Rounds are counted in millionths.
const PARTS: u64 = 1_000_000;

/// Measures one core and two clusters, with at least `windows` windows each. Adds the figures to
/// `rows`, and returns for each graph the throughput of two clusters relative to one core.
pub(super) fn clusters(
    windows: usize,
    rows: &mut Vec<NativeRow>,
) -> Result<Vec<(&'static str, f64)>, String> {
    let mut all = Vec::new();
    for graph in [MeasuredGraph::CHAIN, MeasuredGraph::LAYERED] {
        let mut samples = [Vec::new(), Vec::new()];
        for _ in 0..PASSES {
            for (clusters, samples) in (1..).zip(&mut samples) {
                samples.extend(pass(graph, windows, clusters)?);
            }
        }
        let name = graph.name;
        if samples.iter().any(Vec::is_empty) {
            let remedy = "ask for more rounds";
            return Err(format!(
                "{name}: the two clusters never ran at one time; {remedy}"
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

fn jobs_a_round(graph: MeasuredGraph) -> u64 {
    INSTANCES_A_ROUND.div_ceil(graph.instances() as u64)
}

/// Runs `clusters` clusters, and returns the time of the instances of each window.
fn pass(graph: MeasuredGraph, windows: usize, clusters: u32) -> Result<Vec<u64>, String> {
    let jobs_a_round = jobs_a_round(graph);
    let rounds = (windows.div_ceil(PASSES) + 2 * WINDOW) as u64;
    let jobs = jobs_a_round * rounds + 1;
    let marks: Vec<RoundTimes> = (0..clusters).map(|_| RoundTimes::default()).collect();
    let mut machine = machine(Policy::StaticPriority, clusters)?;
    if clusters > 1 {
        machine = machine.with(|terms| terms.divide(&vec![1; clusters as usize]));
    }
    let sources = marks.iter().map(|marks| marks.source(jobs_a_round));
    let functions = sources.map(|source| empty(graph.shape, graph.dags, source));
    commit(graph.shape, jobs, PERIOD, functions.collect());
    run_jobs(&machine, jobs).map_err(|why| format!("{}: {why}", graph.name))?;
    let times_ns: Vec<_> = marks.iter().map(RoundTimes::times_ns).collect();
    Ok(of_windows(&times_ns))
}

/// Returns, for each window of the first cluster within the others' times, the time in nanoseconds
/// in which all clusters together did the instances of [`WINDOW`] rounds.
fn of_windows(times_ns: &[Vec<u64>]) -> Vec<u64> {
    let [first, others @ ..] = times_ns else {
        return Vec::new();
    };
    // The first windows warm up.
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

/// Returns how many rounds were over at a time, in [`PARTS`] of a round; `None` before the first
/// round and after the last.
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
