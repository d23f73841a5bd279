//! The subcommand `soak`: random DAG sets for a long time, everything checked.
//!
//! The app `soak` runs rounds of random DAG sets in the guest, and checks after
//! each what can be checked there: rules, accounts, allocations, memory, stacks.
//! Here the rounds are split into boots, a few at a time, and each round's trace
//! is checked on the host against the same rules, from other evidence.
//!
//! - `plan`: which rounds, in which boots;
//! - `judge`, `figures`: what became of a boot's rounds;
//! - `coverage`: which combinations they came across;
//! - `command`: the command line.

mod command;
mod coverage;
mod figures;
mod judge;
pub mod plan;
mod trace;

use std::collections::VecDeque;
use std::fs;
use std::path::Path;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use crate::outcome::{self, Outcome};
use crate::progress::SILENCE;
use crate::qemu::{Mode, Qemu};
use crate::{image, install, probe, system};
use judge::{Judged, judge};
use plan::{Boot, Part, Plan};

pub use command::soak;
pub use coverage::Coverage;
pub use figures::Figures;

/// The guest's memory, up to a quarter of which is for journals.
const MEMORY_MIB: u64 = 256;

/// What a soak run has come to.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The figures of each part, by its name, in the plan's order.
    pub parts: Vec<(String, Figures)>,
    /// Of all parts.
    pub total: Figures,
    /// What can happen to a DAG, and how often it did.
    pub coverage: Coverage,
    /// A line for each thing that is wrong, with the command that shows it again.
    pub failures: Vec<String>,
    /// The rounds in which nothing is wrong.
    pub passed: u64,
    /// The rounds in which something is.
    pub failed: u64,
}

/// Runs a plan to its end, and calls `show` with the rounds that are over: after each
/// boot, and now and then.
///
/// # Errors
///
/// In words: there is no QEMU or no image, or a guest could not be started.
pub fn run(plan: &Plan, mut show: impl FnMut(u64)) -> Result<Report, String> {
    install::ensure_qemu()?;
    let image = image::build("soak")?;
    let machine = Qemu {
        cores: plan.cores,
        memory_mib: MEMORY_MIB,
        ..Qemu::default()
    };
    probe::choose(Some(plan.mode), plan.mode, &machine, &image.path)?;
    let waiting = Mutex::new(plan.boots().collect::<VecDeque<_>>());
    let next = || {
        waiting
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .pop_front()
    };
    let parts = plan.parts.iter();
    let mut report = Report {
        parts: (parts.map(|part| (part.to_string(), Figures::default()))).collect(),
        ..Report::default()
    };
    let (send, receive) = mpsc::channel();
    thread::scope(|scope| {
        for _ in 0..plan.side_by_side.max(1) {
            let (send, next, path) = (send.clone(), &next, &image.path);
            scope.spawn(move || {
                while let Some(boot) = next() {
                    // Nobody listens any more once another guest did not start.
                    if send.send((boot, run_boot(plan, &boot, path))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(send);
        let mut over = 0;
        loop {
            match receive.recv_timeout(SILENCE) {
                Ok((boot, judged)) => {
                    over += boot.rounds;
                    report.take(plan, &boot, &judged?);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            show(over);
        }
        Ok::<(), String>(())
    })?;
    Ok(report)
}

/// Boots a guest and judges it; its log stays only if something is wrong.
fn run_boot(plan: &Plan, boot: &Boot<'_>, image: &Path) -> Result<Judged, String> {
    let log = system::new_log("soak")?;
    let qemu = Qemu {
        mode: plan.mode,
        cores: plan.cores,
        memory_mib: MEMORY_MIB,
        guest_words: words(plan, boot),
        ..Qemu::default()
    };
    let outcome: Outcome = outcome::boot(&qemu, image, &log, limit(plan, boot), |_| {})?;
    let mut judged = judge(boot, &outcome);
    trace::judge(boot, &outcome, plan.bound_ns, &mut judged);
    if judged.failures.is_empty() {
        let _ = fs::remove_file(&log);
    } else {
        let place = format!("the serial log is {}", log.display());
        judged.failures.entry(boot.first).or_default().push(place);
    }
    Ok(judged)
}

fn words(plan: &Plan, boot: &Boot<'_>) -> String {
    let Part {
        policy,
        load,
        overrun,
        work,
        ..
    } = boot.part;
    let trouble = if boot.part.has_trouble() {
        "drawn"
    } else {
        "none"
    };
    // In real time the host's noise would exceed budgets that nobody asked for.
    let budget_factor = match plan.mode {
        Mode::Deterministic => 10,
        Mode::Kvm | Mode::Threads => 0,
    };
    format!(
        "mode={} policy={policy} load={load} overrun={overrun} work={work} first={} rounds={} round_ms={} \
         seed={} trouble={trouble} events=on budget_factor={budget_factor}",
        plan.mode,
        boot.first,
        boot.rounds,
        plan.round.as_millis(),
        plan.seed
    )
}

/// How long a boot may take in wall time: the guest's own time, and far more for
/// its trace, which goes through a serial line.
fn limit(plan: &Plan, boot: &Boot<'_>) -> Duration {
    let rounds = u32::try_from(boot.rounds).unwrap_or(u32::MAX);
    Duration::from_secs(60) + plan.round.saturating_mul(rounds).saturating_mul(30)
}

impl Report {
    fn take(&mut self, plan: &Plan, boot: &Boot<'_>, judged: &Judged) {
        let name = boot.part.to_string();
        if let Some((_, figures)) = self.parts.iter_mut().find(|(part, _)| *part == name) {
            figures.add(&judged.figures);
        }
        self.total.add(&judged.figures);
        self.coverage.add(&judged.coverage);
        for (round, reasons) in &judged.failures {
            for reason in reasons {
                self.failures
                    .push(format!("{name}, round {round}: {reason}"));
            }
            let command = plan.command(boot.part, *round);
            self.failures
                .push(format!("{name}, round {round}: again by: {command}"));
        }
        let failed = judged.failures.len() as u64;
        self.failed += failed;
        self.passed += boot.rounds.saturating_sub(failed);
    }
}
