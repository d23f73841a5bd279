//! Boots into one fault after the other, and shows the DAGs that survive. With `by=driver`, a
//! device's driver commits each fault. With `faults=N`, a single DAG commits N faults, and the app
//! shows their cost in memory.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;
use alloc::vec;

use fass::finish_create_dags;
use faults::crimes::{CRIMES, Crime};
use faults::{FATAL_JOB, FaultPolicy, JOBS, PERIOD, POLICIES, doomed, healthy, restless, served};
use kernel::{AppError, Machine, Run, json, println};
use sched_dag::DagStatistics;

kernel::entry!(main);

/// The number of the healthy DAG's jobs that overlap the fault: from the fatal job on, as long as
/// an endless loop may take to be ended.
const DURING: u64 = 2;

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let only = options.text("fault");
    let times = options.number("faults", 0..=1_000_000, 0)?;
    let by_driver = options.choice("by", &[("subtask", false), ("driver", true)])?;
    machine.offer_clusters()?;
    options.finish(&["fault", "faults", "by", "clusters"])?;
    if let Ok(times @ 1..) = u32::try_from(times) {
        return endure(machine, times);
    }
    let known = only.is_none_or(|only| CRIMES.iter().any(|(name, _)| *name == only));
    if !known {
        let names = CRIMES.map(|(name, _)| name).join(", ");
        let only = only.unwrap_or_default();
        return Err(AppError::Usage(kernel::options::UsageError::new(format!(
            "`fault={only}`: allowed are {names}"
        ))));
    }
    println!(
        "A healthy DAG and a doomed one, each with {JOBS} jobs of {} ms;",
        PERIOD.as_millis()
    );
    println!("the doomed one is at fault in its job {FATAL_JOB}.");
    machine.accept_faults(); // here they are what is wanted
    let mut counts = [0; 3];
    // A driver's DAG is not made anew: its questions would go on to nobody.
    let policies = if by_driver { &POLICIES[..1] } else { &POLICIES };
    for &(on_fault, policy) in policies {
        println!("The doomed DAG's policy: {on_fault}");
        for (name, crime) in CRIMES {
            if only.is_none_or(|only| only == name) {
                let verdict = commit_crime(machine, (name, crime), (on_fault, policy), by_driver)?;
                counts[verdict as usize] += 1;
            }
        }
    }
    let [contained, unclear, harmful] = counts;
    let tried = contained + unclear + harmful;
    println!(
        "{contained} of {tried} faults cost their own DAG what its policy says, and no other anything"
    );
    if unclear > 0 {
        println!("{unclear} cannot be judged: the healthy DAG was late even before the fault");
    }
    if harmful > 0 {
        return Err(AppError::Failure(format!(
            "{harmful} of {tried} faults did harm"
        )));
    }
    Ok(())
}

/// Runs a DAG with a hundred faults, then a DAG with `times` faults, and compares the memory left.
fn endure(machine: &Machine, times: u32) -> Result<(), AppError> {
    machine.accept_faults(); // here they are what is wanted
    let mut before = None;
    for faults in [100, times] {
        let dags = restless(faults);
        machine.spread(&dags);
        finish_create_dags(&dags)?;
        drop(dags);
        let run = machine.run()?;
        let held_bytes = machine.resources().heap_bytes;
        let (healthy, restless) = (*run.statistics("healthy"), *run.statistics("restless"));
        let violations = run.violations().count();
        drop(run);
        let now = machine.resources();
        json::emit("endurance", |line| {
            line.number("faults", restless.faults)
                .number("restarts", restless.restarts)
                .number("completed", restless.completed)
                .number("healthy_jobs", healthy.completed)
                .number("misses", healthy.misses + restless.misses)
                .number("violations", violations as u64)
                .number("held_bytes", held_bytes as u64)
                .number("heap_bytes", now.heap_bytes as u64)
                .number("contexts", now.contexts as u64);
        });
        if now != *before.get_or_insert(now) || now.contexts != now.contexts_free {
            return Err(AppError::Failure(format!("{faults} faults took memory")));
        }
    }
    Ok(())
}

/// The effect of a fault beyond its own DAG.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FaultVerdict {
    /// Nothing.
    Contained,
    /// The healthy DAG was late before the fault, so the host is too busy to judge.
    Unclear,
    /// The healthy DAG was late or incomplete, or the doomed DAG lost more or fewer jobs than its
    /// policy says, or the asking DAG failed.
    Harmful,
}

/// Runs both DAGs and judges whether only the doomed one was harmed.
fn commit_crime(
    machine: &Machine,
    (name, crime): (&str, Crime),
    (on_fault, policy): (&str, FaultPolicy),
    by_driver: bool,
) -> Result<FaultVerdict, AppError> {
    let mut dags = vec![healthy()];
    match by_driver {
        true => dags.extend(served(crime)),
        false => dags.push(doomed(crime, policy)),
    }
    machine.spread(&dags);
    finish_create_dags(&dags)?;
    let run = machine.run()?;
    let on_time = |jobs: core::ops::Range<u64>| jobs.filter(|job| is_on_time(&run, *job)).count();
    let parts = [
        0..FATAL_JOB,
        FATAL_JOB..FATAL_JOB + DURING,
        FATAL_JOB + DURING..JOBS,
    ];
    let totals = parts.clone().map(|part| part.count());
    let [before, during, after] = parts.map(on_time);
    let healthy_jobs = run.statistics("healthy").completed;
    let doomed_jobs = run.statistics("doomed").completed;
    let lost_jobs = run.statistics("doomed").failed;
    let expected = match policy {
        FaultPolicy::End => (FATAL_JOB, 0),
        FaultPolicy::Restart | FaultPolicy::FallBack => (JOBS - 1, 1),
    };
    let in_time = |asks: DagStatistics| (asks.completed, asks.misses) == (JOBS, 0);
    let asks_fail = by_driver && !in_time(*run.statistics("asks"));
    let verdict = if asks_fail || healthy_jobs < JOBS || (doomed_jobs, lost_jobs) != expected {
        FaultVerdict::Harmful
    } else if [before, during, after] == totals {
        FaultVerdict::Contained
    } else if before < totals[0] {
        FaultVerdict::Unclear
    } else {
        FaultVerdict::Harmful
    };
    let word = ["contained", "unclear", "harmful"][verdict as usize];
    println!(
        "  {name:<22} {word}: healthy jobs on time {before}/{} before, {during}/{} during, \
         {after}/{} after; {doomed_jobs} doomed jobs completed, {lost_jobs} lost",
        totals[0], totals[1], totals[2]
    );
    json::emit("containment", |line| {
        line.text("fault", name)
            .text("on_fault", on_fault)
            .text("verdict", word)
            .number("on_time_before", before as u64)
            .number("on_time_during", during as u64)
            .number("on_time_after", after as u64)
            .number("healthy_jobs", healthy_jobs)
            .number("doomed_jobs", doomed_jobs)
            .number("lost_jobs", lost_jobs);
    });
    Ok(verdict)
}

/// Reports whether a job of the healthy DAG met its deadline.
fn is_on_time(run: &Run, job: u64) -> bool {
    let healthy = run.task_set().find("healthy");
    let deadline_ns = run.task_set().dag(healthy).relative_deadline_ns();
    let release = run.record().job(healthy, job);
    release
        .and_then(|release| Some(run.record().completion_ns(healthy, job)? - release.release_ns?))
        .is_some_and(|response_ns| response_ns <= deadline_ns)
}
