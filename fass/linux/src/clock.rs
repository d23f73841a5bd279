//! The clock of all threads, read from the processor's counter.
//!
//! A *base* is a reading of the counter, the time of CLOCK_MONOTONIC at that reading, and the rate
//! between both. The present time is the latest base's time, plus the ticks since. A thread finding
//! the base older than some 100 us asks the system's clock, and makes a new base unless another
//! thread is just making one: no thread waits for another.
//!
//! # Bounds
//!
//! - The time of a base never goes back: a new base begins at or after the latest reading possible
//!   with the old base. In the first millisecond of the program, a thread asking the system while
//!   another makes a base may read 0.5 us earlier than the base; later, some nanoseconds earlier.
//! - A reading is ahead of CLOCK_MONOTONIC by the duration of the clock's system call, mostly 20 ns
//!   and 8,192 ticks at most, and differs by the slew of two bases: 0.5 us at first, then 0.1 us at
//!   most. A base that is ahead runs slower, so the next bases are not ahead. The next base takes
//!   over a jump of the system's clock.
//! - A processor may read its counter some tens of nanoseconds ahead of the program's order. So a
//!   reading after another thread's may be lower by as much: events of different threads are put in
//!   order when written down (`State::now_ns`).
//! - Where the counter is not the system's own clock, each reading asks the system.

#![allow(unsafe_code, reason = "the processor's counter")]

use std::sync::atomic::{AtomicU64, Ordering, fence};
use std::sync::{Mutex, OnceLock};

use crate::sys;

/// How many ticks a base is good for.
const FRESH: u64 = 1 << 18;

/// The most ticks of a system call whose result may become a base.
const PROMPT: u64 = 1 << 13;

/// From this difference on, the system's clock or the counter has jumped.
const JUMP_NS: u64 = 1_000_000;

/// The counter and the time at an instant.
#[derive(Clone, Copy)]
struct Base {
    ticks: u64,
    ns: u64,
    /// Nanoseconds per tick, times 2^32.
    rate: u64,
}

impl Base {
    const NONE: Self = Self {
        ticks: 0,
        ns: 0,
        rate: 0,
    };

    /// Returns the time so many ticks later.
    const fn after(self, ticks: u64) -> u64 {
        self.ns + ((ticks * self.rate) >> 32)
    }
}

/// The latest two bases, on their own cache lines. While a thread writes the next base, the latest
/// stays intact.
#[repr(align(128))]
struct Bases {
    /// How many bases there have been.
    made: AtomicU64,
    places: [[AtomicU64; 3]; 2],
}

static BASES: Bases = Bases {
    made: AtomicU64::new(0),
    places: [const { [const { AtomicU64::new(0) }; 3] }; 2],
};

impl Bases {
    /// Returns the latest base, and its age in ticks.
    #[inline]
    fn latest(&self) -> (Base, u64) {
        loop {
            let made = self.made.load(Ordering::Acquire);
            let place = &self.places[(made & 1) as usize];
            let [ticks, ns, rate] = [0, 1, 2].map(|word| place[word].load(Ordering::Relaxed));
            let since = counter().wrapping_sub(ticks);
            // If any word is of a later base, the number has moved on, too.
            fence(Ordering::Acquire);
            if self.made.load(Ordering::Relaxed) == made {
                return (Base { ticks, ns, rate }, since);
            }
        }
    }

    /// Replaces the older base. Called by one thread at a time.
    fn put(&self, base: Base) {
        let made = self.made.load(Ordering::Relaxed) + 1;
        // Pairs with the fence in `latest`: a reader of a word written below sees the number move
        // on.
        fence(Ordering::Release);
        let words = [base.ticks, base.ns, base.rate];
        for (place, word) in self.places[(made & 1) as usize].iter().zip(words) {
            place.store(word, Ordering::Relaxed);
        }
        self.made.store(made, Ordering::Release);
    }
}

/// Returns the time.
#[inline]
pub(crate) fn now_ns() -> u64 {
    let (base, since) = BASES.latest();
    match since < FRESH {
        true => base.after(since),
        false => renew(base, since),
    }
}

/// Asks the system's clock, and makes a base from the answer if possible.
#[cold]
#[inline(never)]
fn renew(latest: Base, since: u64) -> u64 {
    static RATE: Mutex<Rate> = Mutex::new(Rate(Base::NONE));
    // A negative age: the base was made while this thread was about to read the counter.
    if since > FRESH.wrapping_neg() && latest.rate > 0 {
        return latest.ns;
    }
    let ticks = counter();
    let system_ns = sys::monotonic_ns();
    let is_prompt = counter().wrapping_sub(ticks) < PROMPT;
    // Time never goes back: by the latest base, no thread has read more than this.
    let ns = system_ns.max(latest.after(FRESH));
    // A slow system call blurs the instant of its reading, so no base is made of that.
    if is_prompt
        && has_counter()
        && let Ok(mut rate) = RATE.try_lock()
        // Another thread may have made a base since.
        && BASES.latest().0.ticks == latest.ticks
        && let Some(rate) = rate.learn(ticks, system_ns)
    {
        // A base ahead of the system's clock runs slower until it has lost its lead, though not
        // below half the rate. The limit keeps the shift in 64 bits.
        let slower = ((ns - system_ns).min(1 << 20) << 32) / FRESH;
        let rate = rate - slower.min(rate / 2);
        BASES.put(Base { ticks, ns, rate });
    }
    ns
}

/// The rate of the counter, and the instant from which the rate is measured.
struct Rate(Base);

impl Rate {
    /// Learns from an instant, and returns the rate up to that instant; `None` at first, and where
    /// another thread has been here with a later instant.
    fn learn(&mut self, ticks: u64, ns: u64) -> Option<u64> {
        let Self(from) = self;
        let since = ticks.checked_sub(from.ticks)?;
        let passed_ns = u128::from(ns.saturating_sub(from.ns));
        let expected_ns = (u128::from(since) * u128::from(from.rate)) >> 32;
        let has_jumped = passed_ns.abs_diff(expected_ns) > u128::from(JUMP_NS);
        if from.ticks == 0 || from.rate > 0 && has_jumped {
            (from.ticks, from.ns) = (ticks, ns);
        } else if since > 8 * FRESH {
            let rate = u64::try_from((passed_ns << 32) / u128::from(since)).unwrap_or(0);
            // From some 60 MHz to 16 GHz; otherwise the system's clock has jumped in the first
            // window.
            match (1 << 28..1 << 36).contains(&rate) {
                true => from.rate = rate,
                false => *from = Base { ticks, ns, rate: 0 },
            }
        }
        (from.rate > 0).then_some(from.rate)
    }
}

/// Reports whether the counter runs alike on all processors, at any speed of theirs, as far as the
/// system relies on the counter.
fn has_counter() -> bool {
    static HAS: OnceLock<bool> = OnceLock::new();
    *HAS.get_or_init(|| {
        let source = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
        let source = std::fs::read_to_string(source).unwrap_or_default();
        matches!(source.trim(), "tsc" | "kvm-clock") && is_counter_invariant()
    })
}

/// Reports whether the processor declares a constant rate of its counter (AMD manual 3, CPUID
/// function 8000_0007h).
#[cfg(all(target_arch = "x86_64", not(miri)))]
fn is_counter_invariant() -> bool {
    use std::arch::x86_64::__cpuid;
    const POWER: u32 = 0x8000_0007;
    __cpuid(0x8000_0000).eax >= POWER && __cpuid(POWER).edx >> 8 & 1 == 1
}

#[cfg(any(not(target_arch = "x86_64"), miri))]
const fn is_counter_invariant() -> bool {
    false
}

/// Returns the processor's counter.
#[cfg(all(target_arch = "x86_64", not(miri)))]
#[inline]
fn counter() -> u64 {
    // SAFETY: every x86-64 has the instruction, and Linux lets programs use it.
    unsafe { std::arch::x86_64::_rdtsc() }
}

/// Returns a value that makes each reading ask the system, as there is no counter.
#[cfg(any(not(target_arch = "x86_64"), miri))]
const fn counter() -> u64 {
    u64::MAX
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    /// Until there have been so many bases, or for so many readings where there is no counter.
    fn readings() -> impl Iterator<Item = u64> {
        let from = BASES.made.load(Ordering::Relaxed);
        let goes_on = move |round: &u32| {
            BASES.made.load(Ordering::Relaxed) < from + 20 && (has_counter() || *round < 1_000)
        };
        (0..).take_while(goes_on).map(|_| now_ns())
    }

    #[test]
    fn it_is_the_systems_clock() {
        const BOUND_NS: u64 = 10_000;
        let mut before_ns = sys::monotonic_ns();
        for now_ns in readings() {
            let after_ns = sys::monotonic_ns();
            assert!(before_ns <= now_ns + BOUND_NS && now_ns <= after_ns + BOUND_NS);
            before_ns = after_ns;
        }
    }

    #[test]
    fn it_never_goes_back_in_a_thread_and_hardly_between_threads() {
        const BOUND_NS: u64 = 1_000;
        let latest_ns = AtomicU64::new(0);
        thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| {
                    let mut own_ns = 0;
                    let mut others_ns = 0;
                    for now_ns in readings() {
                        assert!(now_ns >= own_ns && now_ns + BOUND_NS >= others_ns);
                        own_ns = now_ns;
                        latest_ns.fetch_max(now_ns, Ordering::AcqRel);
                        others_ns = latest_ns.load(Ordering::Acquire);
                    }
                });
            }
        });
    }

    #[test]
    fn a_counter_that_was_read_before_the_base_is_not_taken_for_a_stale_base() {
        let (ticks, ns) = (counter(), sys::monotonic_ns() + 1_000_000);
        let rate = 1 << 32;
        let base = Base { ticks, ns, rate };
        assert_eq!(renew(base, 100_u64.wrapping_neg()), ns);
        assert!(renew(base, 2 * FRESH) >= base.after(FRESH));
    }

    #[test]
    fn a_jump_leaves_the_rate() {
        let mut rate = Rate(Base::NONE);
        let (tick, ns) = (9 * FRESH, 9 * FRESH / 2);
        assert_eq!(rate.learn(tick, 0), None);
        assert_eq!(rate.learn(tick - 1, 0), None, "another thread was quicker");
        assert_eq!(rate.learn(2 * tick, ns), Some(1 << 31));
        let later_ns = 2 * ns + 2 * JUMP_NS;
        assert_eq!(rate.learn(3 * tick, later_ns), Some(1 << 31));
        assert_eq!(rate.learn(4 * tick, later_ns + ns), Some(1 << 31));
    }
}
