//! Boots into the Autoware reference system and reports its latencies.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;
use core::time::Duration;

use autoware::{Latencies, SUBTASKS, Workload};
use fass::Occupation;
use fass::commit::{Commit, ConstructionPolicy, CountLimit, finish_create_dags_with};
use kernel::report::{Distribution, Ns};
use kernel::{AppError, Machine, Run, json, println};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let workload = workload(machine)?;
    let system = workload.build();
    system.record();
    // Two lidars, and several results that other DAGs sample.
    let construction = ConstructionPolicy {
        sources: CountLimit::Several,
        sinks: CountLimit::Several,
        ..ConstructionPolicy::paper()
    };
    println!(
        "Autoware reference system: {SUBTASKS} subtasks in {} dags, 19 edges and 10 samples, \
         {} cores",
        system.dags.len(),
        machine.cores()
    );
    let commit = finish_create_dags_with(&system.dags, construction)?;
    for answer in commit.answers() {
        println!("  {answer}");
    }
    for staleness in commit.staleness() {
        println!("  {staleness}");
    }
    let bounds = Bounds::new(&commit);
    let run = machine.run()?;
    let latencies = Latencies::of(run.task_set(), run.record(), &system.acted_on);
    report(&run, &latencies, bounds, system.digest())
}

/// Reads the app's options from the command line.
fn workload(machine: &Machine) -> Result<Workload, AppError> {
    let options = machine.options();
    let jobs = options.number("jobs", 1..=10_000, 100)?;
    let crunch_us = options.number("crunch_us", 100..=1_000_000, 4_000)?;
    let least_percent = options.number("least_percent", 0..=99, 50)?;
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    let occupation = options.choice(
        "occupy",
        &[("hold", Occupation::Hold), ("spin", Occupation::Spin)],
    )?;
    options.finish(&["jobs", "crunch_us", "least_percent", "seed", "occupy"])?;
    Ok(Workload {
        jobs,
        crunch: Duration::from_micros(crunch_us),
        least_percent,
        seed,
        occupation,
    })
}

/// The bounds proven by the commit for the two latencies.
#[derive(Clone, Copy)]
struct Bounds {
    hot_path_ns: Option<u64>,
    to_vehicle_ns: Option<u64>,
}

impl Bounds {
    fn new(commit: &Commit) -> Self {
        let of_dag = |name| {
            let mut answers = commit.answers().iter();
            let answer = answers.find(|answer| answer.dag.name == name)?;
            answer.verdict.bound()
        };
        let mut samples = commit.staleness().iter();
        let hop = samples.find(|sample| {
            sample.reader.name == "BehaviorPlanner" && sample.topic == "ObjectCollisionEstimator"
        });
        let ns = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        // A sample is taken after the release of its job, so the job's end comes at most the
        // response time later.
        let to_vehicle = hop
            .and_then(|hop| hop.bound)
            .and_then(|hop| hop.checked_add(of_dag("behaviour")?));
        Self {
            hot_path_ns: of_dag("lidar").map(ns),
            to_vehicle_ns: to_vehicle.map(ns),
        }
    }
}

#[allow(clippy::too_many_lines, reason = "a report, line by line")]
fn report(run: &Run, latencies: &Latencies, bounds: Bounds, digest: u64) -> Result<(), AppError> {
    let dags = run.task_set().dags().iter();
    let statistics = dags.map(|dag| run.statistics(dag.name()));
    let violations = run
        .violations()
        .inspect(|found| println!("violation: {found}"));
    let violations = violations.count() as u64;
    let misses: u64 = statistics.clone().map(|dag| dag.misses).sum();
    let jobs: u64 = statistics.map(|dag| dag.completed).sum();
    let hot_path = Distribution::new(latencies.hot_path_ns.iter().copied());
    let to_vehicle = Distribution::new(latencies.to_vehicle_ns.iter().copied());

    println!();
    println!(
        "{jobs} jobs, {violations} violations, {misses} deadline misses, {} allocations",
        run.allocations()
    );
    println!(
        "  {:<28}{:>12}{:>12}{:>12}{:>12}{:>14}",
        "from the lidars' release to", "min", "median", "p99", "max", "bound"
    );
    for (name, latency, bound_ns) in [
        ("ObjectCollisionEstimator", &hot_path, bounds.hot_path_ns),
        ("VehicleDBWSystem", &to_vehicle, bounds.to_vehicle_ns),
    ] {
        let bound = bound_ns.map_or("not proven".into(), |ns| format!("{}", Ns(ns)));
        println!(
            "  {name:<28}{:>12}{:>12}{:>12}{:>12}{bound:>14}",
            format!("{}", Ns(latency.min())),
            format!("{}", Ns(latency.median())),
            format!("{}", Ns(latency.p99())),
            format!("{}", Ns(latency.max())),
        );
    }
    println!(
        "the vehicle has acted on {} lidar jobs again, and on {} never",
        latencies.repeated, latencies.unused
    );
    json::emit("autoware", |line| {
        line.number("subtasks", SUBTASKS as u64)
            .number("jobs", jobs)
            .number("violations", violations)
            .number("deadline_misses", misses)
            .number("allocations", run.allocations())
            .distribution("hot_path_ns", &hot_path)
            .distribution("to_vehicle_ns", &to_vehicle)
            .number("hot_path_bound_ns", bounds.hot_path_ns.unwrap_or(0))
            .number("to_vehicle_bound_ns", bounds.to_vehicle_ns.unwrap_or(0))
            .number("repeated", latencies.repeated)
            .number("unused", latencies.unused)
            .number("digest", digest);
    });
    if violations > 0 {
        return Err(AppError::Failure(format!(
            "{violations} violations of the model"
        )));
    }
    if run.allocations() > 0 {
        let count = run.allocations();
        return Err(AppError::Failure(format!(
            "{count} allocations while running"
        )));
    }
    Ok(())
}
