//! A join across cores: from the last predecessor's return to the sink's start.
//!
//! Two branches compute for 2 us, each on its own core; then whichever returns last
//! has the sink to start. The times are read by the bodies themselves, as their last
//! and as their first act. What reading the clock costs is measured, too, and
//! subtracted once: a stamp encloses half of it at either end.

use std::hint::{black_box, spin_loop};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Instant;

use hand_off::{Pen, Stamps};
use sched_dag::Policy;

use super::graphs::{Graph, Tick, commit, machine, nanoseconds, run};
use super::{Figure, Row};

const WORKLOAD: &str = "join of 2 us";

/// How long a branch computes.
const WORK_NS: u64 = 2_000;

/// Measures `jobs` jobs, reading the clock, and what a message costs at least.
pub(super) fn measure(jobs: u64) -> Result<Vec<Row>, String> {
    let mut stamps = Stamps::default();
    let functions = [0, WORK_NS, WORK_NS, 0].map(|work_ns| body(work_ns, stamps.pen(jobs)));
    let machine = machine(Policy::StaticPriority, 2)?;
    commit(Graph::JOIN, jobs, vec![vec![functions.into()]]);
    run(&machine, jobs).map_err(|why| format!("{WORKLOAD}: {why}"))?;
    let clock = clock();
    let reading_ns = clock.median / clock.per;
    let (mut joins, mut starts) = (Vec::new(), Vec::new());
    for job in jobs / 10..jobs {
        let times = |subtask| Some((stamps.first(subtask, job)?, stamps.last(subtask, job)?));
        let [Some(source), Some(one), Some(other), Some(sink)] = [0, 1, 2, 3].map(times) else {
            continue;
        };
        // Side by side, so on two cores: the one that began later is not the source's.
        if one.0 < other.1 && other.0 < one.1 {
            joins.push(sink.0.saturating_sub(one.1.max(other.1) + reading_ns));
            starts.push(one.0.max(other.0).saturating_sub(source.1 + reading_ns));
        }
    }
    if joins.is_empty() {
        return Err(format!(
            "{WORKLOAD}: no join was across cores; give the workers processors of their own"
        ));
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

/// Returns a body that reads the clock until so much time has passed, and stamps its first and its
/// last reading.
fn body(work_ns: u64, mut pen: Pen) -> Tick {
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

/// Measures what it takes to tell another core something: two threads write to one another's
/// cache line in turn.
fn transfer() -> Figure {
    const EXCHANGES: u64 = 200;
    const ROUNDS: u64 = 200;
    /// A number in cache lines of its own.
    #[repr(align(128))]
    struct Line(AtomicU64);
    impl Line {
        fn tell(&self, exchange: u64) {
            self.0.store(exchange, Ordering::Release);
        }

        fn wait_for(&self, exchange: u64) {
            while self.0.load(Ordering::Acquire) < exchange {
                spin_loop();
            }
        }
    }
    let [there, back] = [0, 0].map(|none| Line(AtomicU64::new(none)));
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

/// Measures what reading the clock takes.
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
