//! Measuring the time stamp counter, and the local APIC's timer, by a clock whose rate is known.
//!
//! Where there are two such clocks both are read, and where the processor states the
//! counter's rate that is compared: each may be wrong on some board, and a wrong clock makes
//! all times wrong in silence.

use super::clock::{self, Elapsed};
use super::known_clock::KnownClock;
use super::{cpu, local_apic};

/// How long the rates are measured: so long that what a reading takes, some microseconds
/// where the host gives it, spoils less than a 10,000th.
const MEASURE_NS: u64 = 50_000_000;

/// The same where instructions are counted, as there all clocks follow the one count.
const MEASURE_COUNTED_NS: u64 = 5_000_000;

/// What was found of the time stamp counter's rate.
#[derive(Clone, Copy, Debug)]
pub struct Rate {
    /// The clock that it was measured by.
    pub clock: &'static str,
    /// The rate.
    pub khz: u64,
    /// Another clock or the processor, and the rate by that.
    pub check: Option<(&'static str, u64)>,
}

impl Rate {
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
) -> Option<Rate> {
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
            Stopwatch::start(clock, judge).measure(long_ns)?,
        ))
    })?;
    clock::set_rates(base, &elapsed);
    let khz = |ns: u64| elapsed.counter * 1_000_000 / ns.max(1);
    let measured = judge.map(|judge| (judge.name, khz(judge_ns)));
    let stated = || Some(("cpuid", stated_khz(cpu::counter_ratio())?));
    Some(Rate {
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
struct Reading {
    /// How long that took, by the counter.
    width: u64,
    ticks: u64,
    counter: u64,
    apic: u32,
    judge: u32,
}

/// A clock that counts ticks from its start on.
struct Stopwatch<'c> {
    clock: &'c KnownClock,
    judge: Option<&'c KnownClock>,
    last: u32,
    ticks: u64,
}

impl<'c> Stopwatch<'c> {
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
    fn measure(mut self, long_ns: u64) -> Option<(Elapsed, u64)> {
        let start = self.read_all()?;
        while self.clock.ns(self.ticks - start.ticks) < long_ns {
            self.advance();
            cpu::relax();
        }
        let end = self.read_all()?;
        local_apic::start_timer(0);
        let elapsed = Elapsed {
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
    fn read_all(&mut self) -> Option<Reading> {
        const TRIES: u32 = 8;
        /// Many times what the slowest clock needs for all.
        const MOST_READS: u32 = 100_000;
        let mut best: Option<Reading> = None;
        let mut tries = 0;
        for _ in 0..MOST_READS {
            let before = cpu::time_stamp();
            if self.advance() {
                let counter = cpu::time_stamp();
                let apic = local_apic::timer_count();
                let judge = self.judge.map_or(0, KnownClock::read);
                let width = cpu::time_stamp().wrapping_sub(before);
                if best.as_ref().is_none_or(|best| width < best.width) {
                    best = Some(Reading {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_disputed_from_1_percent_on() {
        let rate = |check| Rate {
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
