//! Measuring the time stamp counter, and the local APIC's timer, by a clock whose rate is known.
//!
//! Where there are two such clocks both are read, and where the processor states the
//! counter's rate that is compared: each may be wrong on some board, and a wrong clock makes
//! all times wrong in silence.
//!
//! # The clocks of known rate
//!
//! In the order in which they are trusted: the ACPI power management timer, the high
//! precision event timer (HPET), the local APIC's timer where it is QEMU's or KVM's, and
//! the programmable interval timer (PIT) of the first PCs, which is slow to read.

use boot::acpi::{Platform, PmTimer};

use super::clock::{self, ElapsedTicks};
use super::{cpu, local_apic, port};

/// How long the rates are measured: so long that what a reading takes, some microseconds
/// where the host gives it, spoils less than a 10,000th.
const MEASURE_NS: u64 = 50_000_000;

/// The same where instructions are counted, as there all clocks follow the one count.
const MEASURE_COUNTED_NS: u64 = 5_000_000;

/// The rate of the time stamp counter, as calibrated.
#[derive(Clone, Copy, Debug)]
pub struct TscRate {
    /// The clock that it was measured by.
    pub clock: &'static str,
    /// The rate.
    pub khz: u64,
    /// Another clock or the processor, and the rate by that.
    pub check: Option<(&'static str, u64)>,
}

impl TscRate {
    /// Reports whether the two rates, if there are two, differ by less than 1 %.
    pub fn is_undisputed(&self) -> bool {
        let (_, other_khz) = self.check.unwrap_or(("", self.khz));
        self.khz.abs_diff(other_khz) < self.khz.div_ceil(100)
    }
}

/// Measures the rates and sets time, with 0 at counter value `base`, by the first of `clocks`
/// that counts, or by the one called `asked` only. Where time counts instructions, a shorter
/// measurement is as exact.
///
/// Needs the local APIC on; uses its timer.
pub fn calibrate(
    base: u64,
    clocks: &[Option<KnownClock>],
    asked: Option<&str>,
    is_counted: bool,
) -> Option<TscRate> {
    let long_ns = if is_counted {
        MEASURE_COUNTED_NS
    } else {
        MEASURE_NS
    };
    let may_be = |clock: &&KnownClock| asked.is_none_or(|name| name == clock.name);
    let mut candidates = clocks.iter().flatten().filter(may_be);
    let (clock, judge, (elapsed, judge_ns)) = candidates.find_map(|clock| {
        let mut others = clocks.iter().flatten().filter(|it| it.name != clock.name);
        let judge = others.find(|other| other.judges);
        Some((
            clock,
            judge,
            TickCounter::start(clock, judge).measure(long_ns)?,
        ))
    })?;
    clock::set_rates(base, &elapsed);
    let khz = |ns: u64| elapsed.counter * 1_000_000 / ns.max(1);
    let measured = judge.map(|judge| (judge.name, khz(judge_ns)));
    let stated = || Some(("cpuid", stated_khz(cpu::counter_ratio())?));
    Some(TscRate {
        clock: clock.name,
        khz: khz(elapsed.ns),
        check: measured.or_else(stated),
    })
}

/// Returns the counter's rate that the processor states: by CPUID leaf 0x15 it is the
/// crystal's, which may be left out and is not to be guessed, times a ratio.
fn stated_khz([denominator, numerator, crystal_hz]: [u32; 3]) -> Option<u64> {
    let hz = u64::from(crystal_hz) * u64::from(numerator);
    let khz = (hz / 1000).checked_div(u64::from(denominator));
    khz.filter(|khz| *khz > 0)
}

/// All clocks, read as one.
struct ClockReadings {
    /// How long that took, by the counter.
    width: u64,
    ticks: u64,
    counter: u64,
    apic: u32,
    judge: u32,
}

/// A clock that counts ticks from its start on.
struct TickCounter<'c> {
    clock: &'c KnownClock,
    judge: Option<&'c KnownClock>,
    last: u32,
    ticks: u64,
}

impl<'c> TickCounter<'c> {
    fn start(clock: &'c KnownClock, judge: Option<&'c KnownClock>) -> Self {
        local_apic::start_timer(u32::MAX);
        clock.start();
        judge.inspect(|judge| judge.start());
        Self {
            clock,
            judge,
            last: clock.read(),
            ticks: 0,
        }
    }

    /// Measures for so long, and stops the local APIC's timer. Returns with what has elapsed
    /// that by the other clock, in nanoseconds; nothing if the clock stands still.
    fn measure(mut self, long_ns: u64) -> Option<(ElapsedTicks, u64)> {
        let start = self.read_all()?;
        while self.clock.ns(self.ticks - start.ticks) < long_ns {
            self.advance();
            cpu::relax();
        }
        let end = self.read_all()?;
        local_apic::start_timer(0);
        let elapsed = ElapsedTicks {
            ns: self.clock.ns(end.ticks - start.ticks),
            counter: end.counter.wrapping_sub(start.counter),
            apic: u64::from(start.apic.wrapping_sub(end.apic)),
        };
        let judge_ns = self.judge.map_or(0, |judge| {
            judge.ns(u64::from(end.judge.wrapping_sub(start.judge) & judge.mask))
        });
        Some((elapsed, judge_ns))
    }

    /// Looks at the clock, and reports whether it has moved. To be called before it comes
    /// round.
    fn advance(&mut self) -> bool {
        let now = self.clock.read();
        let step = now.wrapping_sub(self.last) & self.clock.mask;
        self.last = now;
        self.ticks += u64::from(step);
        step != 0
    }

    /// Reads all clocks right after a tick, so that the count between two readings is exact.
    /// Of several tries takes the one during which least time passed, so that a host which
    /// takes the processor away in between does no harm. One function for both readings: an
    /// image has little room.
    #[inline(never)]
    fn read_all(&mut self) -> Option<ClockReadings> {
        const TRIES: u32 = 8;
        /// Many times what the slowest clock needs for all.
        const MOST_READS: u32 = 100_000;
        let mut best: Option<ClockReadings> = None;
        let mut tries = 0;
        for _ in 0..MOST_READS {
            let before = cpu::time_stamp();
            if self.advance() {
                let counter = cpu::time_stamp();
                let apic = local_apic::timer_count();
                let judge = self.judge.map_or(0, KnownClock::read);
                let width = cpu::time_stamp().wrapping_sub(before);
                if best.as_ref().is_none_or(|best| width < best.width) {
                    best = Some(ClockReadings {
                        width,
                        ticks: self.ticks,
                        counter,
                        apic,
                        judge,
                    });
                }
                tries += 1;
                if tries == TRIES {
                    return best;
                }
            }
            cpu::relax();
        }
        None
    }
}

/// A clock that counts up to some number of bits, and then from 0 again.
#[derive(Clone, Copy, Debug)]
pub struct KnownClock {
    /// Its name in the `boot` line and in the word `clock=`.
    pub name: &'static str,
    /// The time from one count to the next, in femtoseconds.
    tick_fs: u64,
    /// The bits that count.
    pub(super) mask: u32,
    /// Whether others may be compared with it: it needs to be read twice only, at any time.
    pub(super) judges: bool,
    source: ClockSource,
}

#[derive(Clone, Copy, Debug)]
enum ClockSource {
    /// At this I/O port.
    PmTimer(u16),
    /// With registers at this address.
    Hpet(u64),
    LocalApic,
    Pit,
}

/// The period of the PIT's and the power management timer's common quartz, 14.31818 MHz.
const QUARTZ_FS: u64 = 69_841_279;

impl KnownClock {
    /// Returns the clocks that this machine may have, the most trusted first.
    ///
    /// # Safety
    ///
    /// `platform` is what the machine's tables say, and its registers are mapped uncached and
    /// writable at their addresses.
    pub unsafe fn all(platform: &Platform) -> [Option<Self>; 4] {
        const TCG: [u8; 12] = *b"TCGTCGTCGTCG";
        const KVM: [u8; 12] = *b"KVMKVMKVM\0\0\0";
        let is_emulated = matches!(cpu::hypervisor(), Some(TCG | KVM));
        [
            platform.pm_timer.map(Self::pm_timer),
            // SAFETY: passed on from the caller.
            platform.hpet.and_then(|base| unsafe { Self::hpet(base) }),
            is_emulated.then_some(Self {
                name: "local-apic-1ghz",
                tick_fs: 1_000_000,
                mask: u32::MAX,
                judges: false,
                source: ClockSource::LocalApic,
            }),
            Some(Self {
                name: "pit",
                tick_fs: 12 * QUARTZ_FS,
                mask: 0xffff,
                judges: false,
                source: ClockSource::Pit,
            }),
        ]
    }

    fn pm_timer(timer: PmTimer) -> Self {
        Self {
            name: "acpi-pm-timer",
            tick_fs: 4 * QUARTZ_FS,
            mask: u32::MAX >> (32 - timer.bits),
            judges: true,
            source: ClockSource::PmTimer(timer.port),
        }
    }

    /// Returns the HPET at `base`, whose first register says how long its tick takes (IA-PC
    /// HPET specification 1.0a, 2.3.4).
    ///
    /// # Safety
    ///
    /// `base` is its address, mapped uncached and writable.
    unsafe fn hpet(base: u64) -> Option<Self> {
        const LONGEST_TICK_FS: u32 = 100_000_000;
        let period = (base + 4) as *const u32;
        // SAFETY: the caller vouches for the register.
        let tick_fs = unsafe { period.read_volatile() };
        (1..=LONGEST_TICK_FS).contains(&tick_fs).then_some(Self {
            name: "hpet",
            tick_fs: u64::from(tick_fs),
            mask: u32::MAX,
            judges: true,
            source: ClockSource::Hpet(base),
        })
    }

    /// Has the clock count, if it needs to be told.
    pub(super) fn start(&self) {
        match self.source {
            // The local APIC's timer is measured, too, and counts already.
            ClockSource::PmTimer(_) | ClockSource::LocalApic => {}
            ClockSource::Hpet(base) => {
                const ENABLE: u32 = 1;
                let configuration = (base + 0x10) as *mut u32;
                // SAFETY: `hpet` was told that there is one, and only this module uses it.
                let value = unsafe { configuration.read_volatile() };
                // SAFETY: likewise; its interrupts are masked in the I/O APICs.
                unsafe { configuration.write_volatile(value | ENABLE) };
            }
            ClockSource::Pit => {
                // The gate of channel 2 on, its speaker off; then both bytes of the count,
                // over and over from the top (Intel 8254 data sheet, mode 2).
                // SAFETY: the ports are the PIT's and its gate's, which only this module uses;
                // reading that changes nothing, and where there is none, writes go nowhere.
                let gate = unsafe { port::read_u8(0x61) };
                let setup = [(0x61, gate & !2 | 1), (0x43, 0xb4), (0x42, 0), (0x42, 0)];
                for (register, value) in setup {
                    // SAFETY: as above.
                    unsafe { port::write_u8(register, value) };
                }
            }
        }
    }

    /// Returns how long so many counts take: less than 2^32 of them.
    pub(super) const fn ns(&self, ticks: u64) -> u64 {
        ticks * self.tick_fs / 1_000_000
    }

    /// Reads the clock, of which the bits of its mask count. One function for all: it is
    /// never on a hot path, and an image has little room.
    #[inline(never)]
    pub(super) fn read(&self) -> u32 {
        match self.source {
            // SAFETY: the port is the power management timer's, and reading it changes nothing.
            ClockSource::PmTimer(port) => unsafe { port::read_u32(port) },
            // SAFETY: the register is the count of the HPET that `hpet` was told of.
            ClockSource::Hpet(base) => unsafe { ((base + 0xf0) as *const u32).read_volatile() },
            ClockSource::LocalApic => !local_apic::timer_count(),
            ClockSource::Pit => {
                const LATCH_2: u8 = 0x80;
                // SAFETY: the ports are the PIT's, as in `start`.
                unsafe { port::write_u8(0x43, LATCH_2) };
                // SAFETY: likewise. The low byte comes first.
                let [low, high] = [(); 2].map(|()| unsafe { port::read_u8(0x42) });
                !u32::from(u16::from_le_bytes([low, high]))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_disputed_from_1_percent_on() {
        let rate = |check| TscRate {
            clock: "hpet",
            khz: 2_000_000,
            check,
        };
        assert!(rate(None).is_undisputed());
        for (khz, is_undisputed) in [
            (2_000_000, true),
            (2_019_999, true),
            (1_980_001, true),
            (2_020_000, false),
            (1_980_000, false),
            (28_800, false),
        ] {
            let rate = rate(Some(("cpuid", khz)));
            assert_eq!(rate.is_undisputed(), is_undisputed, "{khz}");
        }
    }

    #[test]
    fn the_processor_states_a_rate_only_with_a_crystal() {
        assert_eq!(stated_khz([2, 176, 24_000_000]), Some(2_112_000));
        assert_eq!(stated_khz([1, 100, 19_200_000]), Some(1_920_000));
        assert_eq!(stated_khz([2, 292, 0]), None, "as Bochs has it");
        assert_eq!(stated_khz([0, 0, 0]), None);
        assert_eq!(stated_khz([0, 176, 24_000_000]), None);
    }
}
