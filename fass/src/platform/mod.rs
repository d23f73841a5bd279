//! The platform: the machine below `fass`, and its interface.
//!
//! `fass` names no kernel. A platform (the kernel, Linux, or virtual time on the host) installs
//! itself once, like a logger or an allocator, before the app commits its DAGs. The commit asks the
//! platform for the policy and the cores needed for verification, and hands the [`Plan`] over.
//!
//! # Code closed to apps
//!
//! Apps cannot supply code called under a lock of the platform or in its interrupts: the clock,
//! work at the edge, callbacks for new questions, the ends of topics, parameters.
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
/// The smallest platform accepts a plan and runs one job:
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
    /// Returns the terms on which DAGs run, needed by a commit for verification and answers.
    fn terms(&self) -> RunConfig;

    /// Returns the time since the platform's start, in nanoseconds.
    fn now_ns(&self) -> u64;

    /// Returns the clock behind [`crate::now_ns`]; by default [`now_ns`](Self::now_ns) of the
    /// platform. A platform may name a clock with fewer instructions. `fass` asks at the
    /// installation and after each launch. Where the [edge](Self::at_edge) records or replays the
    /// time told to functions, a clock of the edge is used instead.
    fn clock(&self) -> &'static Clock {
        &clock::ASK_THE_PLATFORM
    }

    /// Reports whether the caller may call the app's code: the caller holds no lock of the
    /// platform, and interrupts are enabled. Only a debug build asks ([`call_app`]).
    fn may_call_app(&self) -> bool {
        true
    }

    /// Occupies the calling instance's core for `duration` of execution time.
    fn execute_for(&self, duration: Duration, how: Occupation);

    /// Takes a signal to a sporadic DAG of the plan with number `plan`, from outside all subtasks
    /// ([`Signal::raise`](crate::shared::Signal::raise)). Does nothing if that plan is not, or no
    /// longer, there.
    ///
    /// # Panics
    ///
    /// If called by a subtask's function. The default panics in any case: then only subtasks,
    /// questions and faults raise signals.
    #[track_caller]
    fn raise(&self, _plan: u64, _dag: DagId) {
        panic!("this platform takes no signals from outside; raise them in subtasks");
    }

    /// Takes the answer to a wait of the plan with number `plan`, from outside all subtasks
    /// ([`DeviceDriver::answer`](crate::shared::DeviceDriver::answer)), and passes the answer to
    /// the scheduler of the wait's DAG as a [`Request::Answer`]. Does nothing if that plan is not,
    /// or no longer, there. Must not wait.
    ///
    /// # Panics
    ///
    /// On a platform without a definition of its own.
    fn answer(&self, _plan: u64, _wait: WaitId) {
        panic!("this platform takes no answers of devices; let no subtask wait for one");
    }

    /// Returns the calling instance with its plan's number, or `None` if the caller is no instance.
    /// A platform without a definition of its own lets every function enter every
    /// [`Lock`](crate::shared::Lock).
    fn running(&self) -> Option<(u64, Instance)> {
        None
    }

    /// Reports whether a run goes on, so that a caller outside all instances must be a thread of
    /// the app's own. A platform without such threads need not define the method.
    fn is_in_run(&self) -> bool {
        false
    }

    /// Calls `section` when nobody else is in a section of the lock with the words `_lock`.
    /// Meanwhile a platform may delay the caller's preemption, for at most
    /// [`LONGEST_SECTION`](crate::shared::LONGEST_SECTION). Returns the duration of the section in
    /// nanoseconds. If the caller is in a section already, returns `None` without calling
    /// `section`. A platform with one thread, running function after function, need not define the
    /// method.
    fn section(&self, _lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
        section();
        Some(0)
    }

    /// Lends the platform's edge, which records and replays, to `work`, under the edge's lock. A
    /// platform without an edge, or with an edge of its own kind, need not define the method. The
    /// defaults of the questions below ask the edge.
    fn at_edge(&self, _work: &mut dyn FnMut(&mut Edge)) {}

    /// Reports whether the next plan is to be recorded or replayed. If not, recorded topics
    /// ([`Dag::record`](crate::Dag::record)) cost nothing.
    fn crosses(&self) -> bool {
        ask_edge(self, |edge| edge.is_wished()).unwrap_or(false)
    }

    /// Reports whether recorded topics written by subtasks other than sources matter: a replay
    /// compares their values, and computes missing ones.
    fn results_cross(&self) -> bool {
        ask_edge(self, |edge| edge.has_results()).unwrap_or(true)
    }

    /// Takes the recorded topics of a DAG and the hash of its names and edges, before the plan
    /// comes. Channels are numbered over all DAGs, in the order of the calls. `begin` is for
    /// platforms without memory of their own for recorded values. Returns the result of
    /// [`Crossing::open`](crate::edge::Crossing::open), or else `false`: then values come by
    /// [`record`](Self::record).
    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        ask_edge(self, |edge| edge.open(dag, graph, channels, begin)).unwrap_or(false)
    }

    /// Takes a value of a recorded topic at the completion of its writer, or a sampled value at the
    /// end of the sampling instance. Without an edge the value is dropped. Must not wait.
    fn record(&self, value: &RecordedValue<'_>) {
        ask_edge(self, |edge| edge.record(value));
    }

    /// Reports whether the next plan shall take the values of recorded sources from
    /// [`replay`](Self::replay), instead of calling the sources.
    fn replays(&self) -> bool {
        ask_edge(self, |edge| edge.is_replay()).unwrap_or(false)
    }

    /// Lends the recorded value of a channel and a job to `take`, if there is one. `take` may be
    /// the app's code, so no lock is held during the call.
    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        let found = ask_edge(self, |edge| edge.find(channel, job)).flatten();
        found.into_iter().for_each(|bytes| call_app(|| take(bytes)));
    }

    /// Takes a line of the [log](mod@crate::log) from the function running here. Adds the caller's
    /// instance, if there is one, and the time of the run, and [keeps](LogLine::keep) the line to
    /// be shown later. The default drops the line. Must not wait.
    fn log(&self, _line: LogLine) {}

    /// Takes a plan over. The platform decides the time of the first release.
    ///
    /// # Errors
    ///
    /// If the platform cannot schedule the plan. Nothing of the plan has run then.
    fn launch(&self, plan: Plan) -> Result<(), LaunchError>;
}

/// The reason why a platform did not take a plan, or found no cores for a DAG.
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
    /// Makes an error from its reason: the fact, the offender, the remedy.
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

/// The error of a second installation: the platform installed first stays.
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
/// Apps do not call the function; the kernel's entry, `Linux` or `VirtualTime` does. See
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

/// Allows people to look at recorded values, from the next commit on. Does nothing where the
/// platform has no edge.
///
/// ```
/// fass::platform::let_look(); // there is no platform
/// assert!(!fass::platform::watch(Some("pose")) && fass::platform::take_seen(&mut []).is_none());
/// assert_eq!(fass::platform::objections(), [None, None]);
/// ```
pub fn let_look() {
    with_edge(Edge::let_look);
}

/// Starts keeping the latest value of the given recorded topic; `None` stops. Reports whether there
/// is such a topic.
///
/// See [`let_look`].
pub fn watch(topic: Option<&str>) -> bool {
    with_edge(|edge| edge.watch(topic)).unwrap_or(false)
}

/// Copies the watched topic's latest value into `into` and returns its description, if there is a
/// new value.
///
/// See [`let_look`].
pub fn take_seen(into: &mut [u8]) -> Option<WatchedValue> {
    with_edge(|edge| edge.take_seen(into)).flatten()
}

/// Returns the reason why a requested recording or replay was impossible, and the difference of a
/// replay from its recording, if there is any.
///
/// See [`let_look`].
#[must_use]
pub fn objections() -> [Option<String>; 2] {
    with_edge(|edge| edge.objections()).unwrap_or_default()
}

/// Calls `work` with the edge of the installed platform, if there is one. `work` runs under a lock,
/// so it must not be the app's code.
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

/// Gives a value to the platform. The function looks the platform up itself: in a crate compiled
/// for size, a call for the lookup would be as long again.
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

/// Writes a line of the [log](mod@crate::log), for people: a level, a text, and up to four fields.
///
/// A field is a number, a truth value, a character or a `'static` text. The line shows the time
/// and, inside a subtask, the DAG, the subtask and the job of the calling instance. The caller goes
/// on after a copy of some 300 bytes; somebody else shows the line soon afterwards. On the machine
/// and on Linux a new line is dropped, and counted, while 64 lines wait.
///
/// A line is no result of its instance: the line appears even if the instance fails later.
///
/// On the machine and on Linux the word `log=off|error|warn|info|debug` sets the level up to which
/// lines are written, `info` by default. In virtual time the lines of all levels are written, into
/// the report. Without a platform they go nowhere.
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

/// Writes a line of an enabled level.
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
