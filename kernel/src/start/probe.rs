//! The probe: checks that the machine does what the kernel needs, before anything relies on it.
//!
//! With the option `probe=on` the image runs no app. Instead a *token* goes round the cores. The
//! core with the token sets its timer. The timer's interrupt wakes the next core, and the wake-up's
//! interrupt hands that core the token. The round ends when core 0 is woken up. By then each core
//! has taken a timer interrupt and a wake-up from the core before it (on a single core: from
//! itself). At each step a sum is formed in floating point, in the SSE registers used by all
//! compiled code.
//!
//! The host boots the probe before choosing KVM (`scripts/tool/src/probe.rs`): on some hosts a
//! guest of a few instructions runs, but a kernel does not.

use alloc::format;
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use crate::watch::panic;
use executive::machine::context::Parked;
use executive::machine::interrupt::{Handlers, Interrupted};
use executive::machine::timer::{self, Alarm};
use executive::machine::{clock, cpu, interrupt_flag, local_apic, this_core, vector};
use executive::run::contexts;
use front::app::ending::AppError;
use front::json;

/// The handlers that replace the scheduler's.
pub(crate) const HANDLERS: Handlers = Handlers {
    timer: pass_token_on,
    wake: take_token,
    end: |_| {},
    beat: |_, _| {},
    exception: panic::exception,
    work: rest,
    release: contexts::give_back,
};

/// The time for which each core keeps the token, in nanoseconds.
const HOLD_NS: u64 = 10_000;

/// The limit on the whole round, in nanoseconds: far more than a busy host needs.
const LIMIT_NS: u64 = 2_000_000_000;

/// The steps made by the token: two a core, its timer and the next core's wake-up.
static STEPS: AtomicU32 = AtomicU32::new(0);
/// The sum of the numbers of these steps, as the bits of an `f64`.
static SUM: AtomicU64 = AtomicU64::new(0);

/// Sends the token round the cores, and prints how far the token came. Called on core 0, where the
/// round begins.
pub(crate) fn run() -> Result<(), AppError> {
    let cores = this_core::all().len();
    let start_ns = clock::now_ns();
    timer::set(Alarm::Hold, start_ns + HOLD_NS);
    // Do not halt: the interrupt that would end the halt may be the missing one.
    while steps() < 2 * cores && clock::now_ns() - start_ns < LIMIT_NS {
        cpu::relax();
    }
    let (steps, took_ns) = (steps(), clock::now_ns() - start_ns);
    json::emit("probe", |line| {
        line.number("cpus", cores as u64)
            .number("steps", steps as u64)
            .number("took_ns", took_ns);
    });
    judge(cores, steps, f64::from_bits(SUM.load(Ordering::Acquire)))
}

fn steps() -> usize {
    STEPS.load(Ordering::Acquire) as usize
}

/// Names the missing part, if there is one.
fn judge(cores: usize, steps: usize, sum: f64) -> Result<(), AppError> {
    let (core, next) = (steps / 2, (steps / 2 + 1) % cores);
    let missing = match steps % 2 {
        _ if steps == 2 * cores => {
            let right: f64 = (0..u32::try_from(steps).unwrap_or(0)).map(f64::from).sum();
            if sum.to_bits() == right.to_bits() {
                return Ok(());
            }
            // The message has no numbers: printing floating point would add 18 KiB to the image.
            "a core adds up wrongly in floating point".into()
        }
        0 => format!("core {core} took no timer interrupt"),
        _ => format!("core {next} took no wake-up from core {core}"),
    };
    Err(AppError::Failure(missing))
}

/// Handles the timer of the core with the token.
fn pass_token_on(_: &mut Interrupted) {
    if timer::take_due(Alarm::Hold, clock::now_ns()) {
        step();
        let cores = this_core::all();
        let next = (this_core::get().index as usize + 1) % cores.len();
        local_apic::send(cores[next].apic_id(), vector::WAKE);
    }
    timer::arm_earliest();
}

/// Handles the wake-up that brings the token.
fn take_token(_: &mut Interrupted) {
    step();
    // Core 0 began the round, so the token's return ends it.
    if this_core::get().index != 0 {
        timer::set(Alarm::Hold, clock::now_ns() + HOLD_NS);
    }
}

fn step() {
    // Only the core with the token comes here, so the two stores need not be atomic together.
    let step = STEPS.load(Ordering::Acquire);
    let sum = f64::from_bits(SUM.load(Ordering::Acquire)) + f64::from(step);
    SUM.store(sum.to_bits(), Ordering::Release);
    STEPS.store(step + 1, Ordering::Release);
}

/// The work of every core but core 0: halting.
fn rest() -> Parked {
    loop {
        interrupt_flag::enable_and_halt();
    }
}

#[cfg(test)]
mod tests {
    use super::judge;

    fn missing(cores: usize, steps: usize, sum: f64) -> String {
        judge(cores, steps, sum)
            .expect_err("it is missing")
            .to_string()
    }

    #[test]
    fn the_place_where_the_token_stopped_names_what_is_missing() {
        assert!(judge(2, 4, 6.0).is_ok());
        assert_eq!(missing(2, 0, 0.0), "core 0 took no timer interrupt");
        assert_eq!(missing(2, 1, 0.0), "core 1 took no wake-up from core 0");
        assert_eq!(missing(2, 2, 1.0), "core 1 took no timer interrupt");
        assert_eq!(missing(2, 3, 3.0), "core 0 took no wake-up from core 1");
        assert_eq!(missing(1, 1, 0.0), "core 0 took no wake-up from core 0");
        let wrong = "a core adds up wrongly in floating point";
        assert_eq!(missing(2, 4, 5.0), wrong);
    }
}
