//! Random sets of DAGs, one after the other, for minutes: every rule is checked in each, and in
//! the end the program has the memory and the threads that it had in the beginning.
//!
//! A set has preemption, overload, panics, exceeded budgets, pauses and stops (`sets`). R5 is
//! judged with the bound of the tests; how often it took longer than a millisecond is told, for
//! that says more of the computer than of the program.
//!
//! ```console
//! # cargo run --profile linux -p linux --example soak -- --minutes 10
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

use linux::{Linux, Mechanism, Run};
use sched_dag::DagId;
use support::sets::{self, Random};

#[path = "../tests/support/mod.rs"]
mod support;

struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code, reason = "an allocator that counts")]
// SAFETY: all is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        IN_USE.fetch_add(layout.size(), Relaxed);
        // SAFETY: the caller keeps the contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller keeps the contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What the program has when nothing runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Held {
    heap_bytes: usize,
    threads: usize,
    files: usize,
}

impl Held {
    /// Looks, after those threads have ended whose budgets were exceeded.
    fn now() -> Self {
        std::thread::sleep(Duration::from_millis(100));
        let heap_bytes = IN_USE.load(Relaxed);
        let count = |folder| std::fs::read_dir(folder).map_or(0, Iterator::count);
        Self {
            heap_bytes,
            threads: count("/proc/self/task"),
            files: count("/proc/self/fd"),
        }
    }
}

/// What was seen so far.
#[derive(Debug, Default)]
struct Seen {
    sets: u64,
    jobs: u64,
    preemptions: u64,
    misses: u64,
    skips: u64,
    aborts: u64,
    panics: usize,
    overruns: usize,
    stops: u64,
    slow_dispatches: usize,
    breaches: usize,
}

impl Seen {
    fn add(&mut self, run: &Run, stops: u64, seed: u64) {
        self.sets += 1;
        self.stops += stops;
        self.preemptions += run.counts().preemptions;
        for dag in (0..).map(DagId).take(run.task_set().dags().len()) {
            let counts = run.statistics(dag);
            self.jobs += counts.completed;
            self.misses += counts.misses;
            self.skips += counts.skips;
            self.aborts += counts.aborts;
        }
        let overruns = run.faults().iter().filter(|fault| fault.is_overrun).count();
        self.overruns += overruns;
        self.panics += run.faults().len() - overruns;
        let slow = run.dispatch_violations(1_000_000);
        self.slow_dispatches += slow.map_or(0, |found| found.len());
        let found = support::breaches(run);
        if !found.is_empty() {
            self.breaches += found.len();
            println!("seed {seed}: {found:?}");
        }
    }
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let minutes = match &words[..] {
        [] => Some(10.0),
        [name, minutes] if name == "--minutes" => minutes.parse::<f64>().ok(),
        _ => None,
    };
    let Some(minutes) = minutes.filter(|minutes| (0.0..=10_000.0).contains(minutes)) else {
        eprintln!("soak: give `--minutes N`, such as `--minutes 10`, or nothing");
        return ExitCode::from(2);
    };
    // Panics are what it is about.
    std::panic::set_hook(Box::new(|_| ()));
    let begin = Instant::now();
    let (mut seen, mut baseline) = (Seen::default(), None);
    for seed in 1.. {
        let mut random = Random(seed);
        let (policy, cores) = sets::terms(&mut random);
        let machine = Linux::new(cores.min(linux::processors()), Mechanism::Fifo);
        let machine = machine.expect("so many are there").policy(policy);
        let limited = machine.limit_real_time(Duration::from_secs(5));
        limited.expect("a limit may be set");
        if seed == 1 {
            println!("preemptive: {}", machine.is_preemptive());
        }
        if seed % 500 == 0 {
            println!("set {seed}, after {:.0} s", begin.elapsed().as_secs_f64());
        }
        let (run, stops) = sets::run(&machine, &mut random);
        seen.add(&run, stops, seed);
        drop((run, machine));
        if seed == 10 {
            baseline = Some(Held::now());
        }
        if seed >= 10 && begin.elapsed().as_secs_f64() > minutes * 60.0 {
            break;
        }
    }
    let end = Held::now();
    println!("{:.0} s: {seen:#?}", begin.elapsed().as_secs_f64());
    println!("after 10 sets {baseline:?}, in the end {end:?}");
    match seen.breaches == 0 && baseline == Some(end) {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}
