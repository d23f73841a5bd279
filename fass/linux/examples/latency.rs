//! How soon a join and a release begin: DAGs on Linux, and a thread for each subtask.
//!
//! One source, two branches of 300 us, one sink, every 5 ms on two cores: once by
//! `linux::Linux`, once by a plain program: four threads at the same level of SCHED_FIFO,
//! pinned, with a mutex and a condition variable at each edge. Both are measured by their
//! functions: from the last branch's last act to the sink's first, and from the nominal release
//! to the source's first act. The two take turns of half a second, so that both have what else the
//! computer does, first with the computer as it is, then with one busy loop (of no level) for each
//! processor. The threads of the plain program change processors from turn to turn, since
//! interrupts mostly come to one; a DAG's source may begin on any.
//!
//! ```console
//! # cargo run --release -p linux --example latency
//! ```

use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use linux::{Linux, Mechanism};

const JOBS: usize = 100;
const TURNS: usize = 24;
const PERIOD: Duration = Duration::from_millis(5);
const WORK: Duration = Duration::from_micros(300);
/// The level at which the machine's workers are.
const LEVEL: &str = "47";

/// When each job's functions began or ended, in nanoseconds from a common instant.
struct Stamps {
    origin: Instant,
    release: Vec<AtomicU64>,
    source: Vec<AtomicU64>,
    branches: [Vec<AtomicU64>; 2],
    sink: Vec<AtomicU64>,
}

impl Stamps {
    fn new() -> Arc<Self> {
        let zeros = || (0..JOBS).map(|_| AtomicU64::new(0)).collect();
        Arc::new(Self {
            origin: Instant::now(),
            release: zeros(),
            source: zeros(),
            branches: [zeros(), zeros()],
            sink: zeros(),
        })
    }

    fn now_ns(&self) -> u64 {
        u64::try_from(self.origin.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    fn put(&self, place: &[AtomicU64], job: usize) {
        place[job].store(self.now_ns(), Relaxed);
    }

    /// Returns the joins' latencies and the releases'.
    fn latencies(&self) -> [Vec<u64>; 2] {
        let at = |place: &[AtomicU64], job: usize| place[job].load(Relaxed);
        let join = |job| {
            let last = at(&self.branches[0], job).max(at(&self.branches[1], job));
            at(&self.sink, job) - last
        };
        let release = |job| at(&self.source, job).saturating_sub(at(&self.release, job));
        [
            (0..JOBS).map(join).collect(),
            (0..JOBS).map(release).collect(),
        ]
    }
}

fn work() {
    let begin = Instant::now();
    while begin.elapsed() < WORK {
        std::hint::spin_loop();
    }
}

/// The DAG on the machine. Returns the latencies and the breaches of R1 to R4.
fn by_dag() -> ([Vec<u64>; 2], usize) {
    let machine = Linux::new(2, Mechanism::Fifo).expect("two processors are there");
    let limit = machine.limit_real_time(Duration::from_secs(5));
    limit.expect("a limit may be set");
    assert!(machine.is_preemptive(), "{}", machine.warnings().join("\n"));
    let stamps = Stamps::new();
    let before_ns = stamps.now_ns();
    let clock_ns = fass::now_ns();
    let dag = create_dag();
    dag.name("join").jobs(JOBS as u64).in_flight(1);
    let (of_source, mut next) = (Arc::clone(&stamps), 0);
    let source = move || {
        let job = next;
        of_source.put(&of_source.source, job);
        next += 1;
        (job,)
    };
    let named = SubtaskAttributes::named;
    dag.register_periodic_subtask(source, vec!["job"], PERIOD, named("source"));
    for (number, name) in [(0, "left"), (1, "right")] {
        let stamps = Arc::clone(&stamps);
        let branch = move |(job,): (usize,)| {
            work();
            stamps.put(&stamps.branches[number], job);
            (job,)
        };
        dag.register_subtask(branch, vec!["job"], vec![name], named(name));
    }
    let of_sink = Arc::clone(&stamps);
    let sink = move |(job, _): (usize, usize)| of_sink.put(&of_sink.sink, job);
    dag.register_sink_subtask(sink, vec!["left", "right"], PERIOD, named("sink"));
    finish_create_dags(&[dag]).expect("the DAG is right");
    let run = machine.run().expect("it is committed");
    let mut release_ns = run.epoch_ns() - clock_ns + before_ns;
    for place in &stamps.release {
        place.store(release_ns, Relaxed);
        release_ns += u64::try_from(PERIOD.as_nanos()).unwrap_or(0);
    }
    (stamps.latencies(), run.violations().count())
}

/// An edge: how many jobs have arrived.
#[derive(Default)]
struct Edge(Mutex<usize>, Condvar);

impl Edge {
    fn send(&self) {
        *self.0.lock().expect("nobody panics") += 1;
        self.1.notify_one();
    }

    fn wait_for(&self, job: usize) {
        let arrived = self.0.lock().expect("nobody panics");
        let wait = self.1.wait_while(arrived, |arrived| *arrived <= job);
        drop(wait.expect("nobody panics"));
    }
}

/// Puts the calling thread at the level, on a processor.
fn settle(processor: usize) {
    let link = std::fs::read_link("/proc/thread-self").expect("Linux has it");
    let thread = link.file_name().expect("it names a thread").to_owned();
    let processor = processor.to_string();
    for words in [
        &["chrt", "-f", "-p", LEVEL][..],
        &["taskset", "-pc", &processor],
    ] {
        let mut command = Command::new(words[0]);
        command.args(&words[1..]).arg(&thread).stdout(Stdio::null());
        let status = command.status().expect("util-linux is installed");
        assert!(status.success(), "{words:?}: are you root?");
    }
}

/// The same by four threads, of which source and sink are on a processor.
fn by_threads(first: usize) -> [Vec<u64>; 2] {
    let stamps = Stamps::new();
    let edges: Arc<[Edge; 4]> = Arc::default();
    let begin = stamps.origin + Duration::from_millis(200);
    let mut threads = Vec::new();
    for (number, processor) in [(0, first), (1, 1 - first)] {
        let (stamps, edges) = (Arc::clone(&stamps), Arc::clone(&edges));
        threads.push(thread::spawn(move || {
            settle(processor);
            for job in 0..JOBS {
                edges[number].wait_for(job);
                work();
                stamps.put(&stamps.branches[number], job);
                edges[2 + number].send();
            }
        }));
    }
    let (of_sink, ends) = (Arc::clone(&stamps), Arc::clone(&edges));
    threads.push(thread::spawn(move || {
        settle(first);
        for job in 0..JOBS {
            ends[2].wait_for(job);
            ends[3].wait_for(job);
            of_sink.put(&of_sink.sink, job);
        }
    }));
    let of_source = Arc::clone(&stamps);
    threads.push(thread::spawn(move || {
        settle(first);
        let mut release = begin;
        for job in 0..JOBS {
            thread::sleep(release.saturating_duration_since(Instant::now()));
            of_source.put(&of_source.source, job);
            let ns = (release - of_source.origin).as_nanos();
            of_source.release[job].store(u64::try_from(ns).unwrap_or(0), Relaxed);
            edges[0].send();
            edges[1].send();
            release += PERIOD;
        }
    }));
    for thread in threads {
        thread.join().expect("nobody panics");
    }
    stamps.latencies()
}

fn print(name: &str, mut samples: Vec<u64>) {
    samples.sort_unstable();
    let of = |permille: usize| {
        let us = samples[(samples.len() - 1) * permille / 1000];
        format!("{}.{:02}", us / 1000, us % 1000 / 10)
    };
    let [median, p99, most] = [500, 990, 1000].map(of);
    println!("{name:<34}{median:>12}{p99:>12}{most:>12}");
}

fn main() {
    println!("{:<34}{:>12}{:>12}{:>12}", "in us", "median", "p99", "max");
    for with_loops in [false, true] {
        let count = if with_loops { 2 } else { 0 };
        let mut loops: Vec<Child> = (0..count)
            .map(|_| {
                let mut shell = Command::new("sh");
                shell.args(["-c", "while :; do :; done"]);
                shell.spawn().expect("a shell is there")
            })
            .collect();
        let mut found = [const { Vec::new() }; 4];
        let mut violations = 0;
        for turn in 0..TURNS {
            let (ours, wrong) = by_dag();
            violations += wrong;
            for (all, new) in found
                .iter_mut()
                .zip(ours.into_iter().chain(by_threads(turn % 2)))
            {
                all.extend(new);
            }
        }
        for child in &mut loops {
            child.kill().expect("it is ours");
            child.wait().expect("it is ours");
        }
        println!("{count} busy loops; {violations} violations");
        let names = [
            "join, DAG",
            "release, DAG",
            "join, threads",
            "release, threads",
        ];
        for (name, samples) in names.into_iter().zip(found) {
            print(&format!("  {name}"), samples);
        }
    }
}
