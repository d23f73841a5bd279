//! The platform: the machine below `fass`, and how one offers itself.
//!
//! `fass` names no kernel. A platform (the kernel, or virtual time on the host)
//! installs itself once, as a logger or an allocator does, before the app
//! commits its DAGs. The commit asks it for the policy and the cores to verify
//! against, and leaves the [`Plan`] with it.
//!
//! # The terms on which a platform runs DAGs
//!
//! They are the same for every platform: what its scheduler does with its cores, and what a
//! commit reckons with. A platform keeps one of these, lets apps change it before their commits,
//! and shows it to each commit.

use alloc::borrow::Cow;
use alloc::string::String;
use core::fmt;
use core::time::Duration;

use recording::Channel;
use sched_dag::analysis::{AnalysisSettings, OverheadSource, Overheads};
use sched_dag::{CoreDivision, DagId, Policy, Preemption, SchedulerOptions, TaskSet};

use crate::edge::Begin;
use crate::run::cell::{CurrentIndex, SetOnce};
use crate::run::line::RecordedValue;
use crate::run::log::{Field, Level, LogLine};
use crate::run::plan::Plan;

/// A machine that schedules committed DAGs.
///
/// # Examples
///
/// The smallest platform, which accepts a plan and runs one job of it:
///
/// ```standalone_crate
/// use core::time::Duration;
/// use fass::{LaunchError, Occupation, Plan, Platform, RunConfig};
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
/// fass::install(&OneJob).unwrap();
/// assert_eq!(fass::now_ns(), 0);
/// ```
pub trait Platform: Sync {
    /// Returns on what terms DAGs run: a commit verifies and answers by these.
    fn terms(&self) -> RunConfig;

    /// Divides the cores for these DAGs, by [`assign_clusters`](crate::assign_clusters), if the
    /// terms leave that to the commit; a platform whose terms never do does not define this. (So
    /// an image that never divides its cores has none of that code.)
    ///
    /// # Errors
    ///
    /// If a DAG gets no cores.
    fn assign(&self, task_set: &mut TaskSet) -> Result<(), LaunchError> {
        let _ = task_set;
        Ok(())
    }

    /// Returns the time since the platform's start, in nanoseconds.
    fn now_ns(&self) -> u64;

    /// Occupies the calling instance's core for `duration` of execution time.
    fn execute_for(&self, duration: Duration, how: Occupation);

    /// Takes a signal to a sporadic DAG of the plan with a number, from outside all
    /// subtasks ([`Signal::raise`](crate::Signal::raise)); does nothing if that plan
    /// is not, or no longer, there.
    ///
    /// # Panics
    ///
    /// If called by a subtask's function. A platform that does not define this
    /// panics in any case: then only subtasks raise signals.
    #[track_caller]
    fn raise(&self, plan: u64, dag: DagId) {
        let _ = (plan, dag);
        panic!("this platform takes no signals from outside; raise them in subtasks");
    }

    /// Reports whether the plan to come shall be recorded or replayed. If it shall not, recorded
    /// topics ([`Dag::record`](crate::Dag::record)) cost nothing.
    fn crosses(&self) -> bool {
        false
    }

    /// Reports whether recorded topics matter that other subtasks than sources write: a replay
    /// compares their values, and computes them if they are not there.
    fn results_cross(&self) -> bool {
        true
    }

    /// Takes the recorded topics of a DAG and the hash of its names and edges, before the plan
    /// comes. Channels are numbered over all DAGs, in the order of the calls. `begin` is for
    /// platforms that have no memory of their own for what crosses. Reports what
    /// [`Crossing::open`](crate::edge::Crossing::open) does, or else `false`: then values come by
    /// [`record`](Self::record).
    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        let _ = (dag, graph, channels, begin);
        false
    }

    /// Takes a value of a recorded topic, at the completion of its writer, or what a subtask had
    /// sampled of one, at the end of that instance; without a
    /// definition it is forgotten. Must not wait.
    fn record(&self, value: &RecordedValue<'_>) {
        let _ = value;
    }

    /// Reports whether the plan to come shall take the values of recorded sources from
    /// [`replay`](Self::replay), in place of calling them.
    fn replays(&self) -> bool {
        false
    }

    /// Lends the recorded value of a channel and a job to `take`, if there is one.
    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        let _ = (channel, job, take);
    }

    /// Takes a line of the [log](mod@crate::log) from the function that runs here. Adds which
    /// instance that is, if it is one, and the time of the run, and [keeps](LogLine::keep) it for
    /// what shows it later; without a definition it is forgotten. Must not wait.
    fn log(&self, line: LogLine) {
        let _ = line;
    }

    /// Takes a plan over. Its first release is the platform's to time.
    ///
    /// # Errors
    ///
    /// If the platform cannot schedule the plan. Nothing of it has run then.
    fn launch(&self, plan: Plan) -> Result<(), LaunchError>;
}

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
    /// The processor halts until the time is over, while the scheduler sees the
    /// instance run. More busy cores can then be studied than the host has.
    Hold,
}

/// Why a platform did not take a plan, or found no cores for a DAG.
///
/// # Examples
///
/// ```
/// let error = fass::LaunchError::new("640 KiB of memory are free, the plan needs 700 KiB; \
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
    /// let error = fass::LaunchError::new("a plan runs already; wait for its end");
    /// assert_eq!(error.to_string(), "a plan runs already; wait for its end");
    /// ```
    #[must_use]
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

/// Executes for `duration` on the calling instance's core, inside a subtask.
///
/// Stands for computation that an app does not have yet, or whose time is what
/// is being studied. Preempted time does not count. In virtual time it is the
/// only thing that takes time.
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

static PLATFORM: SetOnce<&'static dyn Platform> = SetOnce::new();

/// A platform is installed already; the earlier one stays.
///
/// # Examples
///
/// ```
/// assert!(fass::AlreadyInstalled.to_string().contains("already installed"));
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
        Ok(())
    } else {
        Err(AlreadyInstalled)
    }
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

/// The clock: the platform's, unless it has named another one.
static CLOCK: CurrentIndex<Clock> = CurrentIndex::new(&(ASK_THE_PLATFORM as Clock));

/// Tells the time, as [`now_ns`] does.
pub type Clock = fn() -> u64;

const ASK_THE_PLATFORM: Clock = || expect_installed().now_ns();

/// Returns the platform's time in nanoseconds.
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
#[must_use]
pub fn now_ns() -> u64 {
    CLOCK.get()()
}

/// Replaces the clock behind [`now_ns`], which is [`Platform::now_ns`] at first.
///
/// For platforms: one that records the time that functions are told sets a clock that does so, and
/// all others one that takes fewer instructions.
///
/// # Examples
///
/// ```standalone_crate
/// static HALF_PAST: fass::Clock = || 30;
///
/// fass::set_clock(&HALF_PAST);
/// assert_eq!(fass::now_ns(), 30);
/// ```
pub fn set_clock(clock: &'static Clock) {
    CLOCK.set(clock);
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
            $crate::say($crate::log::Level::$level, $text, &fields);
        }
    };
}

/// Says a line of a level that is on.
///
/// See [`log!`](crate::log!).
#[cold]
#[inline(never)]
pub fn say(level: Level, text: &'static str, fields: &[Field]) {
    // Without a platform nobody reads: a line is no reason to fail.
    if let Some(platform) = installed() {
        platform.log(LogLine::new(level, text, fields));
    }
}

/// The terms on which a platform runs the DAGs of the commits to come.
///
/// ```
/// use fass::{CoreDivision, Policy, RunConfig};
///
/// let mut terms = RunConfig::of_cores(3);
/// terms.scheduler.policy = Policy::Edf;
/// terms.divide(&[1, 2]);
/// assert_eq!(terms.clusters, CoreDivision::Of(vec![1, 2]));
/// ```
#[derive(Clone, Debug)]
pub struct RunConfig {
    /// The scheduling policy, which decides what attributes are needed; whether a started
    /// instance may lose its core; and the number of processors that run subtasks, at least 1.
    pub scheduler: SchedulerOptions,
    /// How these are divided. If they are, DAGs say which cluster is theirs
    /// ([`Dag::cluster`](crate::Dag::cluster)).
    pub clusters: CoreDivision,
    /// Whether the commit divides them ([`Platform::assign`]).
    pub assigns: bool,
    /// The cost of the platform's own work for an instance at most, as measured on it. The commit
    /// adds
    /// it to each WCET before it answers about deadlines
    /// ([`Commit::answers`](crate::Commit::answers)); it changes nothing else. Without
    /// measurements, nothing is added: then WCETs have to include it.
    ///
    /// ```
    /// use fass::{Overheads, Preemption};
    ///
    /// let measured = Overheads {
    ///     context_switch_ns: 300,
    ///     dispatch_ns: 900,
    ///     interrupt_ns: 2_000,
    ///     ready_ns: 0,
    /// };
    /// // Into the instance, out of it, one dispatch, one interrupt to preempt another.
    /// assert_eq!(measured.of_an_instance_ns(Preemption::Enabled), Some(3_500));
    /// ```
    pub overheads: Overheads,
    /// Where these are from, for the answer to say so.
    pub overhead_source: OverheadSource,
    /// A file of WCETs that were observed, if there is one; the commit takes what it has for its
    /// DAGs in place of what they state. `sched_dag::wcets` has the format.
    pub wcets: Option<Cow<'static, str>>,
    /// The budget of a subtask that states a WCET only, in WCETs; 0 for none.
    pub budget_factor: u64,
    /// The most events that journals have room for; 0: nothing is written down.
    pub most_events: u64,
}

impl RunConfig {
    /// Makes terms of so many cores: they are not divided, static priorities and preemption rule,
    /// nothing is charged, and there are no budgets but stated ones.
    ///
    /// See [`RunConfig`].
    #[must_use]
    pub const fn of_cores(cores: u32) -> Self {
        Self {
            scheduler: SchedulerOptions {
                policy: Policy::StaticPriority,
                preemption: Preemption::Enabled,
                cores,
            },
            clusters: CoreDivision::Undivided,
            assigns: false,
            overheads: Overheads {
                context_switch_ns: 0,
                dispatch_ns: 0,
                interrupt_ns: 0,
                ready_ns: 0,
            },
            overhead_source: OverheadSource::Stated,
            wcets: None,
            budget_factor: 0,
            most_events: u64::MAX,
        }
    }

    /// Divides the cores into clusters of so many each, from core 0 on; no number: they are not
    /// divided. Each cluster schedules its own DAGs.
    ///
    /// See [`RunConfig`].
    pub fn divide(&mut self, sizes: &[u32]) {
        self.assigns = false;
        self.clusters = match sizes {
            [] => CoreDivision::Undivided,
            sizes => CoreDivision::Of(sizes.to_vec()),
        };
    }

    /// Lets the commit divide the cores: a DAG that needs several gets a cluster of its own, the
    /// others share clusters of one core each. All subtasks need WCETs. See
    /// [`ClusterPlacement`](crate::ClusterPlacement).
    ///
    /// See [`RunConfig`].
    pub fn divide_by_commit(&mut self) {
        (self.clusters, self.assigns) = (CoreDivision::Undivided, true);
    }

    /// Returns the settings for the analysis of a commit.
    pub(crate) fn settings(&self) -> AnalysisSettings {
        let SchedulerOptions {
            policy,
            preemption,
            cores,
        } = self.scheduler;
        AnalysisSettings {
            policy,
            preemption,
            cores,
            overheads: self.overheads,
        }
    }
}

impl Default for RunConfig {
    fn default() -> Self {
        Self::of_cores(1)
    }
}
