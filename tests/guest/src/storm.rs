//! A million timer interrupts while every core computes.
//!
//! There is a DAG for each core. Each repeats the same floating-point and memory work and compares
//! the result with the first result: any register or byte not restored by an interrupt shows as a
//! difference.

use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use executive::run::heartbeat::set_heartbeats;
use fass::finish_create_dags;
use kernel::{AppError, Machine, json};

use crate::checksum::checksum;
use crate::single::{named, single_every};

/// The time between two interrupts of a core.
const INTERRUPT_PERIOD_NS: u64 = 5_000;

/// Longer than any storm, so the only job is never late.
const PERIOD: Duration = Duration::from_secs(3600);

#[derive(Default)]
struct Findings {
    rounds: AtomicU64,
    diverged: AtomicU64,
}

/// Runs the storm until `interrupts` have been taken.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let interrupts = options.number("interrupts", 1..=1_000_000_000, 1_000_000)?;
    options.finish(&["test", "interrupts"])?;

    let findings = Arc::new(Findings::default());
    let first = kernel::timer_interrupts();
    let until = first + interrupts;
    let dags = (0..machine.cores()).map(|core| {
        let findings = Arc::clone(&findings);
        let compute = move || findings.compute_until(until);
        let name = format!("storm-{core}");
        single_every(PERIOD, &name, 1, named("compute"), compute)
    });
    finish_create_dags(&dags.collect::<Vec<_>>())?;
    set_heartbeats(INTERRUPT_PERIOD_NS);
    let run = machine.run()?;
    set_heartbeats(0);

    let diverged = findings.diverged.load(Ordering::Relaxed);
    json::emit("storm", |line| {
        line.number("interrupts", kernel::timer_interrupts() - first)
            .number("rounds", findings.rounds.load(Ordering::Relaxed))
            .number("diverged", diverged)
            .number("violations", run.violations().count() as u64)
            .number("cpus", machine.cores());
    });
    if diverged > 0 {
        return Err(AppError::Failure(format!("{diverged} results diverged")));
    }
    Ok(())
}

impl Findings {
    fn compute_until(&self, interrupts: u64) {
        let expected = checksum();
        while kernel::timer_interrupts() < interrupts {
            self.rounds.fetch_add(1, Ordering::Relaxed);
            let is_other = checksum() != expected;
            self.diverged
                .fetch_add(u64::from(is_other), Ordering::Relaxed);
        }
    }
}
