//! A join across cores: from the last predecessor's return to the sink's start.
//!
//! Two branches compute for 2 us, each on its own core; then whichever returns last
//! has the sink to start. The times are read by the bodies themselves, as their last
//! and as their first act. What reading the clock costs is measured, too, and
//! subtracted once: a stamp encloses half of it at either end.

use std::hint::spin_loop;
use std::sync::atomic::{
    AtomicU64,
    Ordering::{Acquire, Relaxed, Release},
};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use sched_dag::Policy;

use super::figure::Figure;
use super::workload::{self, Graph, Tick, commit, machine};

/// How long a branch computes.
const WORK: Duration = Duration::from_micros(2);

const WORKLOAD: &str = "join of 2 us";

/// One body's times of all jobs, in nanoseconds, and the worker of each.
#[derive(Debug)]
struct Stamps {
    times: Box<[AtomicU64]>,
    workers: Box<[AtomicU64]>,
}

impl Stamps {
    fn new(jobs: usize) -> Arc<Self> {
        let zeros = || (0..jobs).map(|_| AtomicU64::new(0)).collect();
        Arc::new(Self {
            times: zeros(),
            workers: zeros(),
        })
    }

    fn put(&self, job: u64, time_ns: u64) {
        let place = usize::try_from(job).unwrap_or(usize::MAX);
        self.times[place].store(time_ns, Relaxed);
        self.workers[place].store(linux::own_core().map_or(0, u64::from), Relaxed);
    }

    fn get(&self, job: usize) -> (f64, u64) {
        // Differences of them are what is wanted, of a run of seconds.
        let time_ns = self.times[job].load(Relaxed) as f64;
        (time_ns, self.workers[job].load(Relaxed))
    }
}

/// Measures `jobs` jobs, and reading the clock.
pub(super) fn measure(jobs: u64) -> Result<Vec<Figure>, String> {
    let count = usize::try_from(jobs).map_err(|_| "too many jobs".to_owned())?;
    let epoch = Instant::now();
    let clock = Figure::new("", "reading the clock", "", 1, clock(epoch));
    let [
        source_end,
        one_start,
        one_end,
        other_start,
        other_end,
        sink_start,
    ] = [(); 6].map(|()| Stamps::new(count));
    let functions: Vec<Tick> = vec![
        end(epoch, &source_end),
        branch(epoch, &one_start, &one_end),
        branch(epoch, &other_start, &other_end),
        end(epoch, &sink_start),
    ];
    run(jobs, functions)?;
    let reading = clock.median();
    let (mut joins, mut starts) = (Vec::new(), Vec::new());
    for job in count / 10..count {
        let ends = [one_end.get(job), other_end.get(job)];
        if ends[0].1 == ends[1].1 {
            continue;
        }
        joins.push(sink_start.get(job).0 - ends[0].0.max(ends[1].0) - reading);
        let source = source_end.get(job);
        for start in [one_start.get(job), other_start.get(job)] {
            if start.1 != source.1 {
                starts.push(start.0 - source.0 - reading);
            }
        }
    }
    if joins.is_empty() || starts.is_empty() {
        return Err(format!(
            "{WORKLOAD}: no join was across cores; give the workers processors of their own"
        ));
    }
    let figure = |what, samples| Figure::new(WORKLOAD, what, "closures, static", 2, samples);
    Ok(vec![
        figure("last return -> sink start", joins),
        figure("source return -> other core's start", starts),
        Figure::new("", "one cache line, one way", "", 2, transfer()?),
        clock,
    ])
}

/// Runs a fork-join of two branches on two cores.
fn run(jobs: u64, functions: Vec<Tick>) -> Result<(), String> {
    let machine = machine(Policy::StaticPriority, 2)?;
    commit(Graph::JOIN, jobs, vec![vec![functions]]);
    workload::run(&machine, jobs).map_err(|why| format!("{WORKLOAD}: {why}"))
}

fn now_ns(epoch: Instant) -> u64 {
    u64::try_from(epoch.elapsed().as_nanos()).unwrap_or(u64::MAX)
}

fn end(epoch: Instant, stamps: &Arc<Stamps>) -> Tick {
    let stamps = Arc::clone(stamps);
    Box::new(move |job| stamps.put(job, now_ns(epoch)))
}

fn branch(epoch: Instant, start: &Arc<Stamps>, end: &Arc<Stamps>) -> Tick {
    let (start, end) = (Arc::clone(start), Arc::clone(end));
    let work_ns = u64::try_from(WORK.as_nanos()).unwrap_or(u64::MAX);
    Box::new(move |job| {
        let begun_ns = now_ns(epoch);
        start.put(job, begun_ns);
        end.put(job, 0);
        let ended_ns = loop {
            let time_ns = now_ns(epoch);
            if time_ns - begun_ns >= work_ns {
                break time_ns;
            }
            spin_loop();
        };
        end.put(job, ended_ns);
    })
}

/// Returns what it takes to tell another core something: two branches of one job write
/// to one another's cache line in turn.
fn transfer() -> Result<Vec<f64>, String> {
    const EXCHANGES: u64 = 200;
    const EXCHANGES_F64: f64 = 200.0;
    const ROUNDS: u64 = 200;
    let lines = Arc::new([Line(AtomicU64::new(0)), Line(AtomicU64::new(0))]);
    let samples = Arc::new(Mutex::new(Vec::new()));
    let side = |own: usize| -> Tick {
        let (lines, samples) = (Arc::clone(&lines), Arc::clone(&samples));
        Box::new(move |_| {
            let (own_line, other_line) = (&lines[own].0, &lines[1 - own].0);
            for round in 0..ROUNDS {
                let start = Instant::now();
                for exchange in 1 + round * EXCHANGES..=(round + 1) * EXCHANGES {
                    // Side 0 begins; side 1 answers.
                    if own == 0 {
                        own_line.store(exchange, Release);
                    }
                    while other_line.load(Acquire) < exchange {
                        spin_loop();
                    }
                    if own == 1 {
                        own_line.store(exchange, Release);
                    }
                }
                if own == 0 {
                    let one_way = start.elapsed().as_secs_f64() * 1e9 / 2.0 / EXCHANGES_F64;
                    let mut samples = samples.lock().unwrap_or_else(PoisonError::into_inner);
                    samples.push(one_way);
                }
            }
        })
    };
    let nothing = || -> Tick { Box::new(|_| ()) };
    run(1, vec![nothing(), side(0), side(1), nothing()])?;
    let samples = samples.lock().unwrap_or_else(PoisonError::into_inner);
    if samples.is_empty() {
        return Err(format!("{WORKLOAD}: no cache line was exchanged"));
    }
    Ok(samples.clone())
}

/// A number in cache lines of its own.
#[repr(align(128))]
struct Line(AtomicU64);

/// Returns what reading the clock takes.
fn clock(epoch: Instant) -> Vec<f64> {
    const READINGS: u32 = 50;
    (0..2_000)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..READINGS {
                std::hint::black_box(now_ns(epoch));
            }
            start.elapsed().as_secs_f64() * 1e9 / f64::from(READINGS)
        })
        .collect()
}
