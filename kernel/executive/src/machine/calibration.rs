//! Calibration: measures the time stamp counter and the local APIC's timer by a clock of known
//! rate.
//!
//! The measured rate is checked by a second such clock, if another can be read at any two moments,
//! and otherwise by the counter's rate stated by the processor, if any. Each may be wrong on some
//! board, and a wrong clock makes all times wrong in silence.
//!
//! # The clocks of known rate
//!
//! In the order of trust: the ACPI power management timer, the high precision event timer (HPET),
//! the local APIC's timer under QEMU or KVM, and the programmable interval timer (PIT) of the first
//! PCs, which is slow to read.

use boot::acpi::{Platform, PmTimer};

use super::clock::{self, ElapsedTicks};
use super::{cpu, local_apic, port};

/// How long the rates are measured, in nanoseconds: long enough that the time for a reading, some
/// microseconds if the host emulates the clock, spoils less than a 10,000th.
const MEASURE_NS: u64 = 50_000_000;

/// The same time where instructions are counted, as all clocks there follow the one count.
const MEASURE_COUNTED_NS: u64 = 5_000_000;

/// The rate of the time stamp counter, as calibrated.
#[derive(Clone, Copy, Debug)]
pub struct TscRate {
    /// The reference clock of the measurement.
    pub clock: &'static str,
    /// The rate, in kHz.
    pub khz: u64,
    /// Another clock or the processor, and its figure for the rate, in kHz.
    pub check: Option<(&'static str, u64)>,
}

impl TscRate {
    /// Reports whether the two rates, if both exist, differ by less than 1 %.
    pub fn is_undisputed(&self) -> bool {
        let (_, other_khz) = self.check.unwrap_or(("", self.khz));
        self.khz.abs_diff(other_khz) < self.khz.div_ceil(100)
    }
}

/// Measures the rates and sets time, with 0 at counter value `base`, by the first counting clock of
/// `clocks`, or only by the clock called `asked`. Where time counts instructions, a shorter
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

/// Returns the counter's rate stated by the processor, in kHz: by CPUID leaf 0x15 the rate of the
/// crystal times a ratio. The crystal's rate may be left out and must not be guessed.
fn stated_khz([denominator, numerator, crystal_hz]: [u32; 3]) -> Option<u64> {
    let hz = u64::from(crystal_hz) * u64::from(numerator);
    let khz = (hz / 1000).checked_div(u64::from(denominator));
    khz.filter(|khz| *khz > 0)
}

/// All clocks, read together.
struct ClockReadings {
    /// The duration of the reading, in counter ticks.
    width: u64,
    ticks: u64,
    counter: u64,
    apic: u32,
    judge: u32,
}

/// A clock whose ticks are counted from the start on.
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

    /// Measures for `long_ns` nanoseconds, and stops the local APIC's timer. Returns the elapsed
    /// ticks and the elapsed nanoseconds of the other clock; `None` if the clock stands still.
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
            // The local APIC's timer counts down.
            apic: u64::from(start.apic.wrapping_sub(end.apic)),
        };
        let judge_ns = self.judge.map_or(0, |judge| {
            judge.ns(u64::from(end.judge.wrapping_sub(start.judge) & judge.mask))
        });
        Some((elapsed, judge_ns))
    }

    /// Looks at the clock, and reports whether the clock has moved. To be called before the count
    /// wraps around.
    fn advance(&mut self) -> bool {
        let now = self.clock.read();
        let step = now.wrapping_sub(self.last) & self.clock.mask;
        self.last = now;
        self.ticks += u64::from(step);
        step != 0
    }

    /// Reads all clocks right after a tick, so that the count between two readings is exact. Of
    /// several tries keeps the fastest, so that a host taking the processor away in between does no
    /// harm. One function for both readings: an image has little room.
    #[inline(never)]
    fn read_all(&mut self) -> Option<ClockReadings> {
        const TRIES: u32 = 8;
        /// Many times the reads needed by the slowest clock for all tries.
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

/// A clock that counts up to a number of bits, and then from 0 again.
#[derive(Clone, Copy, Debug)]
pub struct KnownClock {
    /// Its name in the `boot` line and in the option `clock=`.
    pub name: &'static str,
    /// The time between two counts, in femtoseconds.
    tick_fs: u64,
    /// The counting bits.
    pub(super) mask: u32,
    /// Whether other clocks may be compared with this clock: only two reads are needed, at any
    /// time.
    pub(super) judges: bool,
    source: ClockSource,
}

#[derive(Clone, Copy, Debug)]
enum ClockSource {
    /// At an I/O port.
    PmTimer(u16),
    /// With registers at an address.
    Hpet(u64),
    LocalApic,
    Pit,
}

/// The period of the common quartz of PIT and power management timer, 14.31818 MHz, in
/// femtoseconds.
const QUARTZ_FS: u64 = 69_841_279;

impl KnownClock {
    /// Returns this machine's possible clocks, the most trusted first.
    ///
    /// # Safety
    ///
    /// `platform` holds what the machine's tables say, and its registers are mapped uncached and
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

    /// Returns the HPET at `base`, whose first register states the duration of a tick (IA-PC HPET
    /// specification 1.0a, 2.3.4).
    ///
    /// # Safety
    ///
    /// `base` is its address, mapped uncached and writable.
    unsafe fn hpet(base: u64) -> Option<Self> {
        const LONGEST_TICK_FS: u32 = 100_000_000;
        let period = (base + 4) as *const u32;
        // SAFETY: the caller vouches for the register.
        let tick_fs = unsafe { period.read_volatile() };
        // Without an HPET at the address, reads give 0 or all ones.
        (1..=LONGEST_TICK_FS).contains(&tick_fs).then_some(Self {
            name: "hpet",
            tick_fs: u64::from(tick_fs),
            mask: u32::MAX,
            judges: true,
            source: ClockSource::Hpet(base),
        })
    }

    /// Starts the clock, if it needs a start.
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
                // reading the gate's changes nothing, and without a PIT writes go nowhere.
                let gate = unsafe { port::read_u8(0x61) };
                let setup = [(0x61, gate & !2 | 1), (0x43, 0xb4), (0x42, 0), (0x42, 0)];
                for (register, value) in setup {
                    // SAFETY: as above.
                    unsafe { port::write_u8(register, value) };
                }
            }
        }
    }

    /// Returns the duration of a number of ticks in nanoseconds; fewer than 2^32 ticks.
    pub(super) const fn ns(&self, ticks: u64) -> u64 {
        ticks * self.tick_fs / 1_000_000
    }

    /// Reads the clock; only the bits of its mask count. One function for all clocks: never on a
    /// hot path, and an image has little room.
    #[inline(never)]
    pub(super) fn read(&self) -> u32 {
        match self.source {
            // SAFETY: the port is the power management timer's, and reading it changes nothing.
            ClockSource::PmTimer(port) => unsafe { port::read_u32(port) },
            // SAFETY: the register is the count of the HPET that `hpet` was told of.
            ClockSource::Hpet(base) => unsafe { ((base + 0xf0) as *const u32).read_volatile() },
            // Counts down; its complement counts up like the other clocks.
            ClockSource::LocalApic => !local_apic::timer_count(),
            ClockSource::Pit => {
                const LATCH_2: u8 = 0x80;
                // SAFETY: the ports are the PIT's, as in `start`.
                unsafe { port::write_u8(0x43, LATCH_2) };
                // SAFETY: likewise. The low byte comes first.
                let [low, high] = [(); 2].map(|()| unsafe { port::read_u8(0x42) });
                // Counts down, likewise.
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
