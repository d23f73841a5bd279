//! Time: nanoseconds since the kernel's entry, from the time stamp counter.
//!
//! The boot measures the rates of the counter and of the local APIC's timer
//! ([`calibration`](super::calibration)).
//!
//! The cores compare their counters as they start ([`agreement`](super::agreement)). Assumed, not
//! checked: the counters' rate is constant, as on every processor with an invariant counter and
//! under QEMU.

use core::sync::atomic::{AtomicU64, Ordering};

use super::cpu;

/// The counter's value at time 0.
static BASE: AtomicU64 = AtomicU64::new(0);
/// Nanoseconds per counter tick, in 2^-32.
static NS_PER_TICK: AtomicU64 = AtomicU64::new(0);
/// Local APIC timer ticks per nanosecond, in 2^-32.
static APIC_TICKS_PER_NS: AtomicU64 = AtomicU64::new(0);

/// Returns the time in nanoseconds since the kernel's entry.
pub fn now_ns() -> u64 {
    let ticks = cpu::time_stamp().wrapping_sub(BASE.load(Ordering::Relaxed));
    ticks_to_ns(ticks)
}

/// Converts nanoseconds to ticks of the local APIC's timer, at least 1; longer
/// times than it can count give its longest.
pub fn apic_ticks(ns: u64) -> u32 {
    /// Three days, which no timer of 32 bits can count.
    const LONGEST_NS: u64 = 1 << 48;
    let ticks = scale(
        ns.min(LONGEST_NS),
        APIC_TICKS_PER_NS.load(Ordering::Relaxed),
    );
    // A count of 0 would stop the timer.
    u32::try_from(ticks).unwrap_or(u32::MAX).max(1)
}

/// Converts ticks of the time stamp counter to nanoseconds.
pub fn ticks_to_ns(ticks: u64) -> u64 {
    scale(ticks, NS_PER_TICK.load(Ordering::Relaxed))
}

/// Multiplies by a factor in 2^-32. Right for 584 years.
fn scale(value: u64, factor: u64) -> u64 {
    let product = u128::from(value) * u128::from(factor);
    #[allow(
        clippy::cast_possible_truncation,
        reason = "reading the clock is on every path: no check for what cannot be"
    )]
    {
        (product >> 32) as u64
    }
}

/// The advance of each clock during one span of time.
pub(super) struct ElapsedTicks {
    pub(super) ns: u64,
    pub(super) counter: u64,
    pub(super) apic: u64,
}

/// Sets the rates from the advance of each clock, with time 0 at counter value `base`.
pub(super) fn set_rates(base: u64, elapsed: &ElapsedTicks) {
    BASE.store(base, Ordering::Relaxed);
    NS_PER_TICK.store(in_2_32(elapsed.ns, elapsed.counter), Ordering::Relaxed);
    APIC_TICKS_PER_NS.store(in_2_32(elapsed.apic, elapsed.ns), Ordering::Relaxed);
}

fn in_2_32(numerator: u64, denominator: u64) -> u64 {
    u64::try_from((u128::from(numerator) << 32) / u128::from(denominator.max(1)))
        .unwrap_or(u64::MAX)
}
