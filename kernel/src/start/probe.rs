//! The probe: whether this machine does what the kernel needs, asked before anything
//! relies on it.
//!
//! With the word `probe=on` the image runs no app. A *token* goes round the cores
//! instead. The core that has it sets its timer; the timer's interrupt wakes up the
//! next core, and the wake-up's interrupt hands that core the token. The round ends when
//! core 0 is woken up, so each core has then taken one timer interrupt and one wake-up
//! from the core before it (on one core: from itself). At each step a sum is made in
//! floating point, in the SSE registers that all compiled code uses.
//!
//! The host boots this before it chooses KVM (`scripts/tool/src/probe.rs`): there are hosts
//! where a guest of a few instructions runs and a kernel does not.

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

/// Handlers in place of the scheduler's.
pub(crate) const HANDLERS: Handlers = Handlers {
    timer: pass_token_on,
    wake: take_token,
    end: |_| {},
    beat: |_, _| {},
    exception: panic::exception,
    work: rest,
    release: contexts::give_back,
};

/// How long each core keeps the token.
const HOLD_NS: u64 = 10_000;

/// How long the whole round may take: far more than it needs on a busy host.
const LIMIT_NS: u64 = 2_000_000_000;

/// The steps that the token has made: two a core, its timer and the next one's wake-up.
static STEPS: AtomicU32 = AtomicU32::new(0);
/// The sum of the numbers of these steps, as the bits of an `f64`.
static SUM: AtomicU64 = AtomicU64::new(0);

/// Sends the token round from core 0, which executes this, and says how far it came.
pub(crate) fn run() -> Result<(), AppError> {
    let cores = this_core::all().len();
    let start_ns = clock::now_ns();
    timer::set(Alarm::Hold, start_ns + HOLD_NS);
    // Not halted: the interrupt that would end the halt may be what is missing.
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

/// Says what is missing, if anything is.
fn judge(cores: usize, steps: usize, sum: f64) -> Result<(), AppError> {
    let (core, next) = (steps / 2, (steps / 2 + 1) % cores);
    let missing = match steps % 2 {
        _ if steps == 2 * cores => {
            let right: f64 = (0..u32::try_from(steps).unwrap_or(0)).map(f64::from).sum();
            if sum.to_bits() == right.to_bits() {
                return Ok(());
            }
            // Without the numbers: printing floating point would weigh 18 KiB.
            "a core adds up wrongly in floating point".into()
        }
        0 => format!("core {core} took no timer interrupt"),
        _ => format!("core {next} took no wake-up from core {core}"),
    };
    Err(AppError::Failure(missing))
}

/// Handles the timer of the core that has the token.
fn pass_token_on(_: &mut Interrupted) {
    if timer::take_due(Alarm::Hold, clock::now_ns()) {
        step();
        let cores = this_core::all();
        let next = (this_core::get().index as usize + 1) % cores.len();
        local_apic::send(cores[next].apic_id(), vector::WAKE);
    }
    timer::arm_earliest();
}

/// Handles the wake-up that comes with the token.
fn take_token(_: &mut Interrupted) {
    step();
    // Core 0 has begun the round.
    if this_core::get().index != 0 {
        timer::set(Alarm::Hold, clock::now_ns() + HOLD_NS);
    }
}

fn step() {
    // Only the core with the token is here.
    let step = STEPS.load(Ordering::Acquire);
    let sum = f64::from_bits(SUM.load(Ordering::Acquire)) + f64::from(step);
    SUM.store(sum.to_bits(), Ordering::Release);
    STEPS.store(step + 1, Ordering::Release);
}

/// The work of every core but core 0: it halts.
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
