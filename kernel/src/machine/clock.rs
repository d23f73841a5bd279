//! Time: nanoseconds since the kernel's entry, from the time stamp counter.
//!
//! The counter's rate is measured at boot against a clock whose rate is known:
//! the ACPI power management timer where there is one; else, under QEMU and
//! KVM, the local APIC's timer, which counts at 1 GHz there. The same
//! measurement gives the rate of the local APIC's timer.
//!
//! Assumed, not checked: the counters of all cores agree and their rate is
//! constant, as on every processor with an invariant counter and under QEMU.

use core::sync::atomic::{AtomicU64, Ordering};

use boot::acpi::PmTimer;

use super::{cpu, local_apic, port};

/// How long the rates are measured: so long that what a reading takes, some microseconds
/// where the host gives it, spoils less than a 10,000th.
const MEASURE_NS: u64 = 50_000_000;

/// The same where instructions are counted, as there all clocks follow the one count.
const MEASURE_COUNTED_NS: u64 = 5_000_000;

/// The counter's value at time 0.
static BASE: AtomicU64 = AtomicU64::new(0);
/// Nanoseconds per counter tick, in 2^-32.
static NS_PER_TICK: AtomicU64 = AtomicU64::new(0);
/// Local APIC timer ticks per nanosecond, in 2^-32.
static APIC_TICKS_PER_NS: AtomicU64 = AtomicU64::new(0);

/// Why there is no time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NoKnownClock;

/// Returns the time in nanoseconds since the kernel's entry.
pub(crate) fn now_ns() -> u64 {
    let ticks = cpu::time_stamp().wrapping_sub(BASE.load(Ordering::Relaxed));
    ticks_to_ns(ticks)
}

/// Converts nanoseconds to ticks of the local APIC's timer, at least 1; longer
/// times than it can count give its longest.
pub(crate) fn apic_ticks(ns: u64) -> u32 {
    /// Three days, which no timer of 32 bits can count.
    const LONGEST_NS: u64 = 1 << 48;
    let ticks = scale(
        ns.min(LONGEST_NS),
        APIC_TICKS_PER_NS.load(Ordering::Relaxed),
    );
    u32::try_from(ticks).unwrap_or(u32::MAX).max(1)
}

/// Converts ticks of the time stamp counter to nanoseconds.
pub(crate) fn ticks_to_ns(ticks: u64) -> u64 {
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

/// Measures the rates, with time 0 at counter value `base`, and returns the
/// name of the clock it measured against. Where time counts instructions, a shorter
/// measurement is as exact.
///
/// Needs the local APIC on; uses its timer.
pub(crate) fn calibrate(
    base: u64,
    pm_timer: Option<PmTimer>,
    is_counted: bool,
) -> Result<&'static str, NoKnownClock> {
    const TCG: [u8; 12] = *b"TCGTCGTCGTCG";
    const KVM: [u8; 12] = *b"KVMKVMKVM\0\0\0";
    let long_ns = if is_counted {
        MEASURE_COUNTED_NS
    } else {
        MEASURE_NS
    };
    let (name, elapsed) = match (pm_timer, cpu::hypervisor()) {
        (Some(timer), _) => ("acpi-pm-timer", measure_by_pm_timer(timer, long_ns)),
        (None, Some(TCG | KVM)) => ("local-apic-1ghz", measure_by_apic_timer(long_ns)),
        _ => return Err(NoKnownClock),
    };
    let in_2_32 = |numerator: u64, denominator: u64| {
        u64::try_from((u128::from(numerator) << 32) / u128::from(denominator.max(1)))
            .unwrap_or(u64::MAX)
    };
    BASE.store(base, Ordering::Relaxed);
    NS_PER_TICK.store(in_2_32(elapsed.ns, elapsed.counter), Ordering::Relaxed);
    APIC_TICKS_PER_NS.store(in_2_32(elapsed.apic, elapsed.ns), Ordering::Relaxed);
    Ok(name)
}

/// What each clock advanced by during the measurement.
struct Elapsed {
    ns: u64,
    counter: u64,
    apic: u64,
}

/// The counter and the local APIC's timer, read as one.
struct Reading {
    counter: u64,
    apic: u32,
}

impl Reading {
    /// Reads both clocks; of several tries takes the one during which least
    /// time passed, so that a host which takes the processor away in between
    /// does no harm.
    fn take() -> Self {
        let tries = (0..8).map(|_| {
            let before = cpu::time_stamp();
            let apic = local_apic::timer_count();
            let after = cpu::time_stamp();
            (
                after.wrapping_sub(before),
                Self {
                    counter: before,
                    apic,
                },
            )
        });
        let (_, best) = tries
            .min_by_key(|(width, _)| *width)
            .expect("there are 8 tries");
        best
    }

    fn until(&self, later: &Self, ns: impl FnOnce(u64) -> u64) -> Elapsed {
        let apic = u64::from(self.apic.wrapping_sub(later.apic));
        Elapsed {
            ns: ns(apic),
            counter: later.counter.wrapping_sub(self.counter),
            apic,
        }
    }
}

fn measure_by_apic_timer(long_ns: u64) -> Elapsed {
    local_apic::start_timer(u32::MAX);
    let start = Reading::take();
    while u64::from(start.apic.wrapping_sub(local_apic::timer_count())) < long_ns {
        cpu::relax();
    }
    let end = Reading::take();
    local_apic::start_timer(0);
    start.until(&end, |apic_ticks| apic_ticks)
}

fn measure_by_pm_timer(timer: PmTimer, long_ns: u64) -> Elapsed {
    const HZ: u64 = 3_579_545;
    const NS_PER_S: u64 = 1_000_000_000;
    let mask = u32::MAX >> (32 - timer.bits);
    // SAFETY: the port is the power management timer's, and reading it changes nothing.
    let read = || unsafe { port::read_u32(timer.port) };
    // Both ends lie right after a tick, so the count between them is exact.
    let next_tick = || {
        let before = read();
        loop {
            let now = read();
            if now != before {
                return (now, Reading::take());
            }
            cpu::relax();
        }
    };
    local_apic::start_timer(u32::MAX);
    let (start_tick, start) = next_tick();
    let passed = |now: u32| u64::from(now.wrapping_sub(start_tick) & mask);
    while passed(read()) < long_ns * HZ / NS_PER_S {
        cpu::relax();
    }
    let (end_tick, end) = next_tick();
    local_apic::start_timer(0);
    start.until(&end, |_| passed(end_tick) * NS_PER_S / HZ)
}
