//! Bytes from the serial port, releasing a DAG.
//!
//! With `later_ms=N` the releases count from N milliseconds later, and nothing may begin before.

use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{create_dag, finish_create_dags};
use kernel::{AppError, Machine, json};

use crate::single::{named, single};

/// The time from which the releases count.
static EPOCH_NS: AtomicU64 = AtomicU64::new(0);

/// Time for the cores to get ready.
const LEAD_NS: u64 = 100_000;

/// Runs a periodic DAG and a DAG released by bytes.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let later_ms = machine.options().number("later_ms", 0..=10_000, 0)?;
    machine.options().finish(&["test", "later_ms"])?;
    let ticks = single("ticks", 60, named("tick"), || {
        let epoch_ns = EPOCH_NS.load(Ordering::Relaxed);
        assert!(fass::now_ns() >= epoch_ns, "released before the epoch");
    });
    let (input, ms) = (create_dag(), Duration::from_millis(1));
    // Of two bytes before time 0 one is kept.
    let jobs = if later_ms == 0 { 2 } else { 1 };
    input.name("input").jobs(jobs).relative_deadline(5 * ms);
    let button = input.sporadic(ms);
    input.source(|| ()).register(named("byte"));
    finish_create_dags(&[ticks, input])?;
    machine.raise_on_input(&button);
    json::emit("listening", |_| {});
    // Time for the host to type, so that the byte is there before the epoch.
    let typed_ns = fass::now_ns() + later_ms * 1_000_000;
    while fass::now_ns() < typed_ns {
        core::hint::spin_loop();
    }
    let epoch_ns = fass::now_ns() + LEAD_NS + later_ms * 1_000_000;
    EPOCH_NS.store(epoch_ns, Ordering::Relaxed);
    let run = machine.run_from(epoch_ns)?;
    json::emit("input", |line| {
        line.number("answers", run.statistics("input").completed)
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}
