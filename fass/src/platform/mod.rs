//! The platform: the machine below `fass`, and how one offers itself.
//!
//! `fass` names no kernel. A platform (the kernel, or virtual time on the host)
//! installs itself once, as a logger or an allocator does, before the app
//! commits its DAGs. The commit asks it for the policy and the cores to verify
//! against, and leaves the [`Plan`] with it.
//!
//! # What is kept from apps
//!
//! Code that is called under a lock of the platform's, or in its interrupts, is no app's to give: the
//! clock, work at the edge, what happens when a question is there, the ends of topics, parameters.
//!
//! ```compile_fail,E0603
//! fass::platform::with_edge(|_| panic!("under a lock"));
//! ```
//!
//! ```compile_fail,E0425
//! static CLOCK: fass::platform::Clock = || panic!("wherever time is told");
//! fass::platform::set_clock(&CLOCK);
//! ```
//!
//! ```compile_fail,E0599
//! let (_device, driver) = fass::shared::create_device::<(), ()>("sonar");
//! driver.on_question(|| panic!("in the scheduler's step"));
//! ```
//!
//! ```compile_fail,E0277
//! struct Bomb;
//!
//! impl fass::MulRecv for Bomb {
//!     type Items = ();
//!     fn recv_all(&mut self) -> impl Future<Output = ()> + Send {
//!         std::future::ready(())
//!     }
//!     fn grant(&mut self, _: u64) {}
//!     fn discard_all(&mut self, _: u64) {
//!         panic!("where a job is cut");
//!     }
//! }
//! ```
//!
//! ```compile_fail,E0277
//! struct Bomb;
//!
//! impl fass::shared::Tunable for Bomb {
//!     fn name(&self) -> &str {
//!         panic!("in the heartbeat");
//!     }
//!     fn set_text(&self, _: &str) -> bool {
//!         true
//!     }
//!     fn write_allowed(&self, _: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
//!         Ok(())
//!     }
//!     fn write(&self, _: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
//!         Ok(())
//!     }
//!     fn share(&self) -> std::sync::Arc<dyn fass::shared::Tunable> {
//!         std::sync::Arc::new(Bomb)
//!     }
//! }
//! ```

pub mod at_edge;
pub(crate) mod clock;
mod protocol;
mod run_config;

use alloc::string::String;
use core::fmt;
use core::time::Duration;

use recording::Channel;
use sched_dag::lifecycle::WaitId;
use sched_dag::{DagId, Instance};

use crate::Occupation;
use crate::edge::{Begin, Edge, WatchedValue};
use crate::run::gate::guard;
use crate::run::line::RecordedValue;
use crate::run::log::{Field, Level, LogLine};

pub use clock::Clock;
pub use protocol::Protocol;
pub use run_config::RunConfig;
pub use sched_dag::lifecycle::{Request, WaitLimit};

pub use crate::run::cell::SetOnce;
pub use crate::run::gate::call_app;
pub use crate::run::lock_words::LockWords;
pub use crate::run::plan::{Plan, ReplacementCode, SubtaskCode, SubtaskRunner};
pub use crate::run::wire::buffer::Buffer;

/// A machine that schedules committed DAGs.
///
/// # Examples
///
/// The smallest platform, which accepts a plan and runs one job of it:
///
/// ```standalone_crate
/// use core::time::Duration;
/// use fass::platform::{LaunchError, Plan, Platform, RunConfig};
/// use fass::Occupation;
///
/// struct OneJob;
///
/// impl Platform for OneJob {
///     fn terms(&self) -> RunConfig {
///         RunConfig::of_cores(1)
///     }
///     fn now_ns(&self) -> u64 {
///         0
///     }
///     fn execute_for(&self, _: Duration, _: Occupation) {}
///     fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
///         for (dag, bodies) in plan.task_set.dags().iter().zip(&mut plan.bodies) {
///             for subtask in dag.topological_order() {
///                 bodies[subtask.index()].run(0);
///             }
///         }
///         Ok(())
///     }
/// }
///
/// fass::platform::install(&OneJob).unwrap();
/// assert_eq!(fass::now_ns(), 0);
/// ```
pub trait Platform: Sync {
    /// Returns on what terms DAGs run: a commit verifies and answers by these.
    fn terms(&self) -> RunConfig;

    /// Returns the time since the platform's start, in nanoseconds.
    fn now_ns(&self) -> u64;

    /// Returns the clock behind [`crate::now_ns`], which is [`now_ns`](Self::now_ns) at first. It is
    /// asked for at the installation and after each launch, for one that takes fewer instructions.
    /// Where the [edge](Self::at_edge) records the time that functions are told, its clock does so.
    fn clock(&self) -> &'static Clock {
        &clock::ASK_THE_PLATFORM
    }

    /// Reports whether the caller may call the app's code: it holds no lock of the platform's, and
    /// interrupts are enabled. Only a debug build asks ([`call_app`]).
    fn may_call_app(&self) -> bool {
        true
    }

    /// Occupies the calling instance's core for `duration` of execution time.
    fn execute_for(&self, duration: Duration, how: Occupation);

    /// Takes a signal to a sporadic DAG of the plan with a number, from outside all
    /// subtasks ([`Signal::raise`](crate::shared::Signal::raise)); does nothing if that plan
    /// is not, or no longer, there.
    ///
    /// # Panics
    ///
    /// If called by a subtask's function. A platform that does not define this
    /// panics in any case: then only subtasks raise signals.
    #[track_caller]
    fn raise(&self, _plan: u64, _dag: DagId) {
        panic!("this platform takes no signals from outside; raise them in subtasks");
    }

    /// Takes the answer to a wait of the plan with a number, from outside all subtasks
    /// ([`DeviceDriver::answer`](crate::shared::DeviceDriver::answer)), and passes it to the scheduler
    /// of the wait's DAG as a [`Request::Answer`]; does nothing if that plan is not, or no longer,
    /// there. Must not wait.
    ///
    /// # Panics
    ///
    /// On a platform that does not define this.
    fn answer(&self, _plan: u64, _wait: WaitId) {
        panic!("this platform takes no answers of devices; let no subtask wait for one");
    }

    /// Returns the instance that the caller is, if it is one, with its plan's number. A platform that
    /// does not define this lets every function enter every [`Lock`](crate::shared::Lock).
    fn running(&self) -> Option<(u64, Instance)> {
        None
    }

    /// Reports whether a run goes on, so that a caller that is no instance is a thread of the app's
    /// own. A platform on which an app has none need not define this.
    fn is_in_run(&self) -> bool {
        false
    }

    /// Calls `section` once nobody else is in a section of the lock that these are the words of, and
    /// puts the caller's preemption off for that time, for
    /// [`LONGEST_SECTION`](crate::shared::LONGEST_SECTION) at most. Returns for how many nanoseconds;
    /// `None`, and does not call it, if the caller is in a section already. A platform of one thread,
    /// which runs function after function, need not define this.
    fn section(&self, _lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
        section();
        Some(0)
    }

    /// Lends `work` what the platform keeps at its edge, under its lock; a platform that keeps
    /// nothing there, or has an edge of its own kind, does not define this. The questions below
    /// are answered by it.
    fn at_edge(&self, _work: &mut dyn FnMut(&mut Edge)) {}

    /// Reports whether the plan to come shall be recorded or replayed. If it shall not, recorded
    /// topics ([`Dag::record`](crate::Dag::record)) cost nothing.
    fn crosses(&self) -> bool {
        ask_edge(self, |edge| edge.is_wished()).unwrap_or(false)
    }

    /// Reports whether recorded topics matter that other subtasks than sources write: a replay
    /// compares their values, and computes them if they are not there.
    fn results_cross(&self) -> bool {
        ask_edge(self, |edge| edge.has_results()).unwrap_or(true)
    }

    /// Takes the recorded topics of a DAG and the hash of its names and edges, before the plan
    /// comes. Channels are numbered over all DAGs, in the order of the calls. `begin` is for
    /// platforms that have no memory of their own for what crosses. Reports what
    /// [`Crossing::open`](crate::edge::Crossing::open) does, or else `false`: then values come by
    /// [`record`](Self::record).
    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        ask_edge(self, |edge| edge.open(dag, graph, channels, begin)).unwrap_or(false)
    }

    /// Takes a value of a recorded topic, at the completion of its writer, or what a subtask had
    /// sampled of one, at the end of that instance; without
    /// an edge it is forgotten. Must not wait.
    fn record(&self, value: &RecordedValue<'_>) {
        ask_edge(self, |edge| edge.record(value));
    }

    /// Reports whether the plan to come shall take the values of recorded sources from
    /// [`replay`](Self::replay), in place of calling them.
    fn replays(&self) -> bool {
        ask_edge(self, |edge| edge.is_replay()).unwrap_or(false)
    }

    /// Lends the recorded value of a channel and a job to `take`, if there is one. What takes it may
    /// be the app's, so no lock is held.
    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        let found = ask_edge(self, |edge| edge.find(channel, job)).flatten();
        found.into_iter().for_each(|bytes| call_app(|| take(bytes)));
    }

    /// Takes a line of the [log](mod@crate::log) from the function that runs here. Adds which
    /// instance that is, if it is one, and the time of the run, and [keeps](LogLine::keep) it for
    /// what shows it later; without a definition it is forgotten. Must not wait.
    fn log(&self, _line: LogLine) {}

    /// Takes a plan over. Its first release is the platform's to time.
    ///
    /// # Errors
    ///
    /// If the platform cannot schedule the plan. Nothing of it has run then.
    fn launch(&self, plan: Plan) -> Result<(), LaunchError>;
}

/// Why a platform did not take a plan, or found no cores for a DAG.
///
/// # Examples
///
/// ```
/// let error = fass::platform::LaunchError::new("640 KiB of memory are free, the plan needs 700 KiB; \
///     register fewer subtasks or give the machine more memory");
/// assert!(error.to_string().starts_with("640 KiB"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LaunchError {
    message: String,
}

impl LaunchError {
    /// States the reason: fact, offender, remedy.
    ///
    /// ```
    /// let error = fass::platform::LaunchError::new("a plan runs already; wait for its end");
    /// assert_eq!(error.to_string(), "a plan runs already; wait for its end");
    /// ```
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
        }
    }
}

impl fmt::Display for LaunchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl core::error::Error for LaunchError {}

static PLATFORM: SetOnce<&'static dyn Platform> = SetOnce::new();

/// A platform is installed already; the earlier one stays.
///
/// # Examples
///
/// ```
/// assert!(fass::platform::AlreadyInstalled.to_string().contains("already installed"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlreadyInstalled;

impl fmt::Display for AlreadyInstalled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a platform is already installed; install one platform, once, at start")
    }
}

impl core::error::Error for AlreadyInstalled {}

/// Installs the platform, once, for the whole program.
///
/// # Errors
///
/// [`AlreadyInstalled`] from the second call on.
///
/// # Examples
///
/// Apps do not call it; the kernel's entry or `VirtualTime` does. See
/// [`Platform`] for a platform of one's own.
///
/// ```standalone_crate
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new(); // installs itself
/// assert_eq!(fass::now_ns(), 0);
/// ```
pub fn install(platform: &'static dyn Platform) -> Result<(), AlreadyInstalled> {
    if PLATFORM.set(platform) {
        clock::settle_clock(platform);
        guard(|| expect_installed().may_call_app());
        Ok(())
    } else {
        Err(AlreadyInstalled)
    }
}

/// Lets people look at what crosses, from the next commit on. Nothing, where no platform has an edge.
///
/// ```
/// fass::platform::let_look(); // there is no platform
/// assert!(!fass::platform::watch(Some("pose")) && fass::platform::take_seen(&mut []).is_none());
/// assert_eq!(fass::platform::objections(), [None, None]);
/// ```
pub fn let_look() {
    with_edge(Edge::let_look);
}

/// Keeps the latest value of a recorded topic from now on, or nothing. Reports whether there is such
/// a topic.
///
/// See [`let_look`].
pub fn watch(topic: Option<&str>) -> bool {
    with_edge(|edge| edge.watch(topic)).unwrap_or(false)
}

/// Takes that value out, if there is a new one.
///
/// See [`let_look`].
pub fn take_seen(into: &mut [u8]) -> Option<WatchedValue> {
    with_edge(|edge| edge.take_seen(into)).flatten()
}

/// Returns why a recording, or a replay, could not be what was wished, and how a replay differs from
/// its recording, if that is so.
///
/// See [`let_look`].
#[must_use]
pub fn objections() -> [Option<String>; 2] {
    with_edge(|edge| edge.objections()).unwrap_or_default()
}

/// Does `work` with what the installed platform keeps at its edge, if it does: under a lock, so it is
/// none of the app's.
fn with_edge<T>(work: impl FnOnce(&mut Edge) -> T) -> Option<T> {
    ask_edge(installed()?, work)
}

fn ask_edge<T>(
    platform: &(impl Platform + ?Sized),
    work: impl FnOnce(&mut Edge) -> T,
) -> Option<T> {
    let (mut work, mut answer) = (Some(work), None);
    platform.at_edge(&mut |edge| answer = work.take().map(|work| work(edge)));
    answer
}

/// Returns the installed platform, if there is one.
#[inline]
pub(crate) fn installed() -> Option<&'static dyn Platform> {
    PLATFORM.get().copied()
}

#[inline]
pub(crate) fn expect_installed() -> &'static dyn Platform {
    match installed() {
        Some(platform) => platform,
        None => missing(),
    }
}

/// Gives a value to the platform. It looks for the platform itself: a function that is called for
/// that is, in a crate compiled for size, as long again.
pub(crate) fn record(value: &RecordedValue<'_>) {
    match PLATFORM.get() {
        Some(platform) => platform.record(value),
        None => missing(),
    }
}

#[cold]
fn missing() -> ! {
    panic!("no platform is installed; boot the kernel, or make a `virtual_time::VirtualTime`")
}

/// Says a line of the [log](mod@crate::log), for people: a level, a text, and up to four fields.
///
/// A field is a number, a truth value, a character or a text that lasts for ever. The line bears
/// the DAG, the subtask and the job of the instance that says it, and the time; outside of subtasks
/// the time only. It is shown soon, and never by the caller, which goes on after a copy of some 300
/// bytes.
///
/// A line is no result of its instance: it is shown although that fails later.
///
/// On the machine and on Linux the word `log=off|error|warn|info|debug` says up to which level
/// lines are said, `info` by default. In virtual time all are, and go to the report. Without a
/// platform they go nowhere.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// let period = Duration::from_millis(10);
/// dag.name("front").jobs(2).period(period).relative_deadline(period);
/// let watch = |job| {
///     if job == 1 {
///         fass::log!(Warn, "camera late", by_ns = 300 * job, eye = "left");
///     }
/// };
/// dag.register_untyped_subtask(watch, SubtaskAttributes::named("watch"));
/// finish_create_dags(&[dag]).unwrap();
/// fass::log!(Debug, "committed");
///
/// let said = machine.run().logs;
/// let warns = r#"warn front/watch[1] 10000000 ns: camera late by_ns=300 eye="left""#;
/// assert_eq!(said, ["debug 0 ns: committed", warns]);
/// ```
#[macro_export]
macro_rules! log {
    ($level:ident, $text:expr $(, $key:ident = $value:expr)* $(,)?) => {
        if $crate::log::Level::$level.is_on() {
            const { ::core::assert!(<[&str]>::len(&[$(::core::stringify!($key)),*]) <= $crate::log::FIELDS) };
            let fields = [$((::core::stringify!($key), ::core::convert::From::from($value))),*];
            $crate::platform::say($crate::log::Level::$level, $text, &fields);
        }
    };
}

/// Says a line of a level that is on.
///
/// See [`log!`](crate::log!).
#[cold]
#[doc(hidden)]
#[inline(never)]
pub fn say(level: Level, text: &'static str, fields: &[Field]) {
    // Without a platform nobody reads: a line is no reason to fail.
    if let Some(platform) = installed() {
        platform.log(LogLine::new(level, text, fields));
    }
}
