//! Time as seen and spent by functions.

use core::time::Duration;

use super::{Platform, ask_edge, expect_installed, with_edge};
use crate::run::cell::CurrentIndex;

/// How a subtask occupies its core in [`execute_for`].
///
/// ```
/// use core::time::Duration;
/// use fass::{Occupation, execute_for};
///
/// /// A subtask that stands for 3 ms of work.
/// fn detect((frame,): (u32,)) -> (u32,) {
///     execute_for(Duration::from_millis(3), Occupation::Hold);
///     (frame,)
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Occupation {
    /// The processor computes until the time is over.
    Spin,
    /// The processor halts until the time is over, while the scheduler sees the instance run. So
    /// more cores can be busy than the host has. Virtual time does not distinguish the two.
    Hold,
}

/// Executes for `duration` on the calling instance's core, inside a subtask.
///
/// Stands for computation still missing in an app, or for work whose time is being studied.
/// Preempted time does not count. In virtual time the call takes exactly this time. A function
/// without such a call takes its WCET there (with waits, the WCET of each segment), unless the test
/// sets another time, and without a WCET no time.
///
/// # Panics
///
/// If no platform is installed.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{Occupation, SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// dag.jobs(1);
/// dag.register_periodic_subtask(
///     || {
///         fass::execute_for(Duration::from_millis(3), Occupation::Spin);
///         (fass::now_ns(),)
///     },
///     ["time"],
///     Duration::from_millis(10),
///     SubtaskAttributes::named("source"),
/// );
/// dag.register_sink_subtask(
///     |(time_ns,): (u64,)| assert_eq!(time_ns, 3_000_000),
///     ["time"],
///     Duration::from_millis(10),
///     SubtaskAttributes::named("sink"),
/// );
/// finish_create_dags(&[dag]).unwrap();
/// machine.run();
/// ```
pub fn execute_for(duration: Duration, how: Occupation) {
    expect_installed().execute_for(duration, how);
}

/// The clock in use: the platform's `now_ns`, unless the platform has named another clock, or the
/// told time is recorded or replayed.
static CLOCK: CurrentIndex<Clock> = CurrentIndex::new(&ASK_THE_PLATFORM);

/// A function returning the time in nanoseconds, like [`now_ns`].
pub type Clock = fn() -> u64;

pub(super) static ASK_THE_PLATFORM: Clock = || expect_installed().now_ns();

/// Returns the platform's time in nanoseconds. Where the told time is recorded, a replay tells the
/// functions of recorded DAGs the recorded time instead.
///
/// # Panics
///
/// If no platform is installed.
///
/// # Examples
///
/// ```
/// let machine = virtual_time::VirtualTime::new();
/// assert_eq!(fass::now_ns(), 0);
/// ```
#[inline]
pub fn now_ns() -> u64 {
    CLOCK.get()()
}

/// Tells functions the time where the told time is recorded or replayed.
static TOLD: Clock = || {
    let platform = expect_installed();
    let clock_ns = platform.now_ns();
    let running = platform.running().map(|(_, instance)| instance);
    with_edge(|edge| edge.tell_time(running, clock_ns)).unwrap_or(clock_ns)
};

/// Chooses the clock behind [`now_ns`].
pub(crate) fn settle_clock(platform: &dyn Platform) {
    let tells = ask_edge(platform, |edge| edge.tells()).unwrap_or(false);
    CLOCK.set(if tells { &TOLD } else { platform.clock() });
}
