//! The cost of large typed chains in virtual time: of their commit, and of an instance.
//!
//! Chains of 100 to 100,000 subtasks have a `u64` on each edge. The commit is measured as a whole,
//! from the registered functions to bodies that can run: verification, answer, slots. For
//! instances, a job is measured from the source's function to the sink's: scheduler, journal,
//! values and the surroundings of a function. The first job is also the first to touch the memory
//! made by the commit.
//!
//! A busy host takes its processor away from each of the large chains, and from hardly any of the
//! small ones; so on such a host large chains seem to cost more.
//! `cargo run --release -p virtual-time --example large 1000` measures a single size.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use virtual_time::VirtualTime;

const SUBTASKS: [u32; 4] = [100, 1_000, 10_000, 100_000];

/// The least number of instances to run.
const INSTANCES: u32 = 200_000;

fn main() {
    let wanted = std::env::args().nth(1);
    println!(
        "subtasks: commit, ns a subtask; first job, later ones: least, median, ns an instance"
    );
    for subtasks in SUBTASKS {
        if wanted
            .as_ref()
            .is_none_or(|wanted| *wanted == subtasks.to_string())
        {
            measure(subtasks);
        }
    }
}

fn measure(subtasks: u32) {
    let jobs = (INSTANCES / subtasks).max(3);
    let machine = VirtualTime::new();
    let ends = Arc::new(Mutex::new(Vec::with_capacity(2 * jobs as usize)));
    let dag = chain(subtasks, jobs, &ends);
    let start = Instant::now();
    finish_create_dags(&[dag]).expect("the chain is right");
    let commit = each(start.elapsed(), subtasks);
    machine.run();
    let ends = ends.lock().unwrap_or_else(PoisonError::into_inner);
    let of_jobs = ends.chunks_exact(2);
    let mut of_jobs = of_jobs.map(|ends| each(ends[1] - ends[0], subtasks - 1));
    let first = of_jobs.next().expect("each job has a source and a sink");
    let mut later: Vec<f64> = of_jobs.collect();
    later.sort_unstable_by(f64::total_cmp);
    let (least, median) = (later[0], later[later.len() / 2]);
    println!("{subtasks}: {commit:.0}; {first:.0}, {least:.0}, {median:.0}");
}

fn each(time: Duration, count: u32) -> f64 {
    time.as_secs_f64() * 1e9 / f64::from(count)
}

/// Makes a chain whose source and sink note the times of their calls.
fn chain(subtasks: u32, jobs: u32, ends: &Arc<Mutex<Vec<Instant>>>) -> Dag {
    let end = || {
        let ends = Arc::clone(ends);
        move || {
            let mut ends = ends.lock().unwrap_or_else(PoisonError::into_inner);
            ends.push(Instant::now());
        }
    };
    let period = Duration::from_secs(1);
    let named = |number: u32| SubtaskAttributes::named(&format!("s{number}"));
    let topic = |number: u32| format!("t{number}");
    let dag = create_dag();
    dag.name("large").jobs(jobs.into()).in_flight(1);
    let (begin, finish) = (end(), end());
    let source = move || {
        execute_for(Duration::from_nanos(1), Occupation::Spin);
        begin();
        (1u64,)
    };
    let sink = subtasks - 1;
    dag.register_periodic_subtask(source, ["t0"], period, named(0));
    for number in 1..sink {
        let (input, output) = (topic(number - 1), topic(number));
        let body = |(value,): (u64,)| (value + 1,);
        dag.register_subtask(body, [input.as_str()], [output.as_str()], named(number));
    }
    let input = topic(sink - 1);
    let last = move |_: (u64,)| finish();
    dag.register_sink_subtask(last, [input.as_str()], period, named(sink));
    dag
}
