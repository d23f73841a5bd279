//! Wall clocks: from the instants of a run to Unix time.
//!
//! Unix time is an instant, such as [`now_ns`](crate::now_ns), plus an *offset*. The app sets the
//! offset at first, by the machine's own clock where there is one, and peers may correct the offset
//! later. A *source* reads the offset when it starts, like a [parameter](crate::shared::Parameter),
//! and sends the offset along edges: so a job has one offset, replayed with the source's results
//! where those are recorded.
//!
//! No clock sets an offset by itself: an image without a wall clock contains no code for one. A run
//! in virtual time has the Unix time set by its test, or none.

use alloc::string::String;
use alloc::sync::Arc;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use super::dag::Dag;
use super::uses::{OutsideInput, Uses, sealed};
use crate::draft::part::PartKind;
use crate::run::waiting::nanoseconds;

/// Stands for an offset not yet set.
const UNKNOWN: u64 = u64::MAX;

/// A clock of Unix time. Clones are handles of the same clock.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::shared::{UnixTime, WallClock};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags, now_ns};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let ms = Duration::from_millis;
/// let clock = WallClock::new(); // on a machine: `machine.set_clock(&clock)`
/// let dag = create_dag();
/// dag.jobs(4).period(ms(10)).relative_deadline(ms(10));
/// let mut expected = [None, Some(1_000_000_000), Some(1_010_000_000), Some(1_021_000_000)].into_iter();
/// let stamp = move |time: UnixTime| assert_eq!(time.of(now_ns()), expected.next().unwrap());
/// dag.using(clock.reading()).source(stamp).register(SubtaskAttributes::named("stamp"));
/// finish_create_dags(&[dag]).unwrap();
///
/// machine.run_for(ms(5));
/// clock.correct(10_000_000, 1_000_000_000, ms(1)); // the first time counts as it is
/// machine.run_for(ms(20));
/// clock.correct(25_000_000, 2_000_000_000, ms(1)); // a later one by 1 ms at most
/// machine.run();
/// ```
#[derive(Clone, Debug)]
pub struct WallClock(Arc<AtomicU64>);

/// The declaration that a source reads a [`WallClock`]: the function gets the [`UnixTime`]. Made by
/// [`WallClock::reading`].
///
/// See [`WallClock`].
#[derive(Debug)]
pub struct WallClockUse(WallClock);

recording::recordable! {
    /// The conversion of a job's instants to Unix time.
    ///
    /// See [`WallClock`].
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct UnixTime {
        offset_ns: u64,
    }
}

impl UnixTime {
    /// Returns the nanoseconds since 1970, without leap seconds, of an instant on the clock of
    /// [`now_ns`](crate::now_ns). Returns `None` while the offset is unknown.
    pub fn of(self, instant_ns: u64) -> Option<u64> {
        (self.offset_ns != UNKNOWN).then(|| self.offset_ns.saturating_add(instant_ns))
    }
}

impl WallClock {
    /// Makes a clock without a time.
    pub fn new() -> Self {
        Self(Arc::new(AtomicU64::new(UNKNOWN)))
    }

    /// Returns the declaration that a source reads the clock, for [`Dag::using`].
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn reading(&self) -> WallClockUse {
        WallClockUse(self.clone())
    }

    /// Returns the Unix time of an instant on the clock of [`now_ns`](crate::now_ns), in
    /// nanoseconds. For platforms; a DAG [reads](Self::reading) the clock.
    pub fn at(&self, instant_ns: u64) -> Option<u64> {
        let offset_ns = self.0.load(Ordering::Relaxed);
        UnixTime { offset_ns }.of(instant_ns)
    }

    /// Sets the Unix time of an instant, for the jobs to come; for example as told by a peer,
    /// possibly wrong. The first time counts as given. A later time moves the clock by at most
    /// `most`, also backwards; so take intervals from [`now_ns`](crate::now_ns).
    pub fn correct(&self, instant_ns: u64, unix_ns: u64, most: Duration) {
        let most_ns = nanoseconds(most);
        let wanted_ns = unix_ns.saturating_sub(instant_ns).min(UNKNOWN - 1);
        let corrected = |known_ns: u64| match known_ns {
            UNKNOWN => wanted_ns,
            known_ns => {
                let end_ns = known_ns.saturating_add(most_ns);
                wanted_ns.clamp(known_ns.saturating_sub(most_ns), end_ns)
            }
        };
        self.0
            .update(Ordering::Relaxed, Ordering::Relaxed, corrected);
    }
}

impl Default for WallClock {
    fn default() -> Self {
        Self::new()
    }
}

impl sealed::Sealed for WallClockUse {}

impl Uses for WallClockUse {
    type Borrowed<'a> = UnixTime;
    type Held = WallClock;
    type Guard<'a> = (UnixTime, PhantomData<&'a ()>);

    fn hold(self, dag: &Dag, subtask: usize) -> WallClock {
        let takes = String::from("reads a wall clock");
        let input = OutsideInput { subtask, takes };
        dag.draft.borrow_mut().add(PartKind::Input, input);
        self.0
    }

    fn enter(held: &mut WallClock) -> Self::Guard<'_> {
        let offset_ns = held.0.load(Ordering::Relaxed);
        (UnixTime { offset_ns }, PhantomData)
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> UnixTime {
        guard.0
    }
}
