//! A million timer interrupts while every core computes.
//!
//! One DAG has as many parallel subtasks as there are cores. Each of them
//! repeats the same floating-point and memory work and compares the result with
//! the first one's: a register or a byte that an interrupt does not restore
//! shows as a difference.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine, json};

use crate::checksum::checksum;

/// The time between two interrupts of one core.
const INTERRUPT_PERIOD: Duration = Duration::from_micros(5);

/// Longer than any storm, so that the one job is never late.
const PERIOD: Duration = Duration::from_secs(3600);

#[derive(Default)]
struct Findings {
    rounds: AtomicU64,
    diverged: AtomicU64,
}

/// Runs the storm until `interrupts` have been taken.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let options = machine.options();
    let interrupts = options.number("interrupts", 1..=1_000_000_000, 1_000_000)?;
    options.finish(&["test", "interrupts"])?;

    let findings = Arc::new(Findings::default());
    let first = kernel::timer_interrupts();
    finish_create_dags(&[storm_dag(machine.cores(), first + interrupts, &findings)])?;
    kernel::set_heartbeat(INTERRUPT_PERIOD);
    let run = machine.run()?;
    kernel::set_heartbeat(Duration::ZERO);

    let diverged = findings.diverged.load(Ordering::Relaxed);
    json::emit("storm", |line| {
        line.number("interrupts", kernel::timer_interrupts() - first)
            .number("rounds", findings.rounds.load(Ordering::Relaxed))
            .number("diverged", diverged)
            .number("violations", run.violations().count() as u64)
            .number("cpus", machine.cores());
    });
    if diverged > 0 {
        return Err(Ending::Failure(format!("{diverged} results diverged")));
    }
    Ok(())
}

/// Builds source -> a worker for each core -> a chain of collectors -> sink.
fn storm_dag(cores: u32, until: u64, findings: &Arc<Findings>) -> Dag {
    let dag = create_dag();
    dag.name("storm").jobs(1);
    let source = SubtaskAttributes::named("start");
    dag.register_periodic_subtask(|| (0u64,), vec!["collected-0"], PERIOD, source);
    // Every worker reads the start; the collectors then wait for one after the
    // other, so any number of cores will do.
    for core in 0..cores {
        let findings = findings.clone();
        let work = move |(start,): (u64,)| (start + compute_until(until, &findings),);
        let output = format!("work-{core}");
        let attributes = SubtaskAttributes::named(&format!("worker-{core}"));
        dag.register_subtask(work, vec!["collected-0"], vec![&output], attributes);
    }
    for core in 0..cores {
        let inputs = [format!("collected-{core}"), format!("work-{core}")];
        let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
        let output = format!("collected-{}", core + 1);
        let attributes = SubtaskAttributes::named(&format!("collector-{core}"));
        let add = |(sum, work): (u64, u64)| (sum + work,);
        dag.register_subtask(add, inputs, vec![&output], attributes);
    }
    let last = format!("collected-{cores}");
    let sink = SubtaskAttributes::named("end");
    dag.register_sink_subtask(|(_,): (u64,)| (), vec![&last], PERIOD, sink);
    dag
}

fn compute_until(interrupts: u64, findings: &Findings) -> u64 {
    let expected = checksum();
    let mut rounds = 0;
    while kernel::timer_interrupts() < interrupts {
        rounds += 1;
        if checksum() != expected {
            findings.diverged.fetch_add(1, Ordering::Relaxed);
        }
    }
    findings.rounds.fetch_add(rounds, Ordering::Relaxed);
    rounds
}
