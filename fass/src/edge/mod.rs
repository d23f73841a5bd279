//! The edge of a run on a machine: values are written into a buffer, or taken from a recording.
//!
//! A *tape* takes events from the core executing a completion, and provides places into which
//! instances write their values; it allocates nothing and waits for nothing. The *drain* turns the
//! tape into a file whenever core 0 has time, or in a thread on Linux. A *replay* lends recorded
//! values, and compares computed values with them. An *echo* keeps the latest value of a topic for
//! people to look at. Without any of these, the edge may keep the inputs of the last jobs, in case
//! an instance fails.
//!
//! A machine and Linux reach all this through the parameters of
//! [`Platform::open_channels`](crate::platform::Platform::open_channels), so an image without a
//! recorded topic contains none of this code.
//!
//! The [`Edge`] of a platform's runs knows the mode requested on the command line, and owns the
//! parts carrying it out. A machine or Linux has one edge, behind a lock of its own; virtual time
//! has another edge for each of its machines. Most work under that lock is done under the
//! scheduler's lock, too. The drain is lent to the sender, so sending holds neither lock.

mod echo;
mod excerpt;
mod kept;
pub(crate) mod latest;
mod replay;
mod tape;

use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use core::fmt;

use recording::{DagHeader, Header, Schema, Stream};
use sched_dag::journal::EventKind;
use sched_dag::{DagId, DriverNotice, Instance, TaskSet};

use crate::run::plan::Plan;

pub use excerpt::Excerpt;
pub use kept::BootRecord;
pub use latest::LatestJobs;
pub use recording::{Channel, Sink};
pub use replay::{Divergence, Replay, ReplayOutcome, job_of};

pub use crate::run::line::RecordedValue;

/// The mode of an edge: recording, replaying, or keeping the latest jobs.
///
/// See [`Crossing`].
#[derive(Clone, Copy, Debug)]
pub enum EdgeMode {
    /// Record the run.
    Record {
        /// The name of the recorded app.
        app: &'static str,
        /// The room for records not drained yet, in bytes.
        bytes: usize,
    },
    /// Replay these bytes.
    Replay {
        /// A recording.
        bytes: &'static [u8],
        /// The job of a DAG to be computed, if not the first recorded one. The replay begins with
        /// it or before.
        from: Option<(&'static str, u64)>,
    },
    /// Keep the inputs of the last jobs, and hand them out if one fails.
    Latest {
        /// The name of the recorded app.
        app: &'static str,
        /// The number of jobs kept of each DAG, 64 at most.
        jobs: u32,
    },
}

/// Functions of the platform needed by a replay.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReplayHost {
    /// Raises a signal from outside, by the number of the plan and the DAG.
    pub(crate) raise: fn(u64, DagId),
    pub(crate) now_ns: fn() -> u64,
}

/// A function making the crossing for the requested mode, and an echo if people can look.
pub type Begin =
    fn(Option<EdgeMode>, bool) -> (Option<Box<dyn Crossing>>, Option<Box<dyn Echoing>>);

/// The calls by which a platform records or replays. Times are of the run. A call without meaning
/// for a replay, or for a tape, does nothing there.
///
/// ```
/// use fass::edge::{Begin, Crossing, EdgeMode};
///
/// /// What a platform does in `open_channels`, once.
/// fn crossing(begin: Begin, file: &'static [u8]) -> Option<Box<dyn Crossing>> {
///     begin(Some(EdgeMode::Replay { bytes: file, from: None }), false).0
/// }
/// ```
pub trait Crossing: Send {
    /// Takes the recorded topics of a DAG, and the hash of its names and edges. Reports whether the
    /// launch will read the values in the places where they are written. Then only values without
    /// room come to [`record`](Self::record).
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool;

    /// Takes the plan before anything of it has run, and allocates all memory needed later.
    ///
    /// # Errors
    ///
    /// Returns a message if there is no memory, or the replay does not fit.
    fn launch(&mut self, plan: &mut Plan) -> Result<(), String>;

    /// Takes a value at its writer's completion, at time `at_ns` of the run.
    fn record(&mut self, value: &RecordedValue<'_>, at_ns: u64);

    /// Takes an event of a job or an instance, of the kinds in [`HEARS`].
    fn happened(&mut self, notice: &DriverNotice);

    /// Notes that an instance has failed, and takes its recorded samples, states and answers: at
    /// time `at_ns` of the run, and `clock_ns` on the clock of [`crate::now_ns`].
    fn failed(&mut self, _instance: Instance, _at_ns: u64, _clock_ns: u64) {}

    /// Returns the time for an instance asking for it, at `clock_ns` on the clock of
    /// [`crate::now_ns`] and at time `at_ns` of the run.
    fn tell_time(&mut self, _instance: Instance, clock_ns: u64, _at_ns: u64) -> u64 {
        clock_ns
    }

    /// Returns the recorded value of a channel and a job, if any.
    fn find(&self, _channel: u16, _job: u64) -> Option<&'static [u8]> {
        None
    }

    /// Returns the drain, the first time only. When keeping the last jobs, there is a drain only
    /// after a fault.
    fn drain(&mut self) -> Option<Box<dyn Drain>>;

    /// Returns the findings of a replay. If the run is over, they include a value the run has not
    /// computed.
    fn outcome(&self, _is_over: bool) -> Option<ReplayOutcome> {
        None
    }
}

/// Shows values of a recorded topic while the run goes on.
///
/// See [`Crossing`].
pub trait Echoing: Send {
    /// Takes the recorded topics of a DAG of the next plan.
    fn open(&mut self, channels: &[Channel]);

    /// Notes the launch of the plan.
    fn launch(&mut self);

    /// Takes a value at its writer's completion.
    fn record(&mut self, value: &RecordedValue<'_>);

    /// Keeps the latest value of this topic from now on; `None`: of no topic. Reports whether the
    /// topic is recorded.
    fn watch(&mut self, topic: Option<&str>) -> bool;

    /// Takes the latest value out, if one has come since the last call. Allocates nothing.
    fn take(&mut self, into: &mut [u8]) -> Option<WatchedValue>;
}

/// A value of the watched topic.
///
/// See [`Echoing`].
#[derive(Clone, Debug)]
pub struct WatchedValue {
    /// The job of the value.
    pub job: u64,
    /// The number of values skipped since the last value taken.
    pub left_out: u64,
    /// The value's length in bytes; `None`: longer than the room for it.
    length: Option<usize>,
    schema: Arc<Schema>,
    /// The function writing the value as text. Only an image with a recorded topic contains one.
    write: fn(&Schema, &[u8], &mut fmt::Formatter<'_>) -> fmt::Result,
}

impl WatchedValue {
    /// Returns the value as text, from the buffer it was taken into. Allocates nothing.
    ///
    /// See [`Echoing`].
    pub fn shown<'s>(&'s self, buffer: &'s [u8]) -> impl fmt::Display + 's {
        let bytes = self.length.and_then(|length| buffer.get(..length));
        fmt::from_fn(move |f| match bytes {
            Some(bytes) => (self.write)(&self.schema, bytes, f),
            None => write!(f, "(more than {} bytes)", buffer.len()),
        })
    }
}

/// The file for recorded entries.
pub type Record = Stream<dyn Sink + Send>;

/// The work of core 0 in its spare time, or of a thread on Linux: writing the recording into a
/// file, with no allocation except for the header, or raising the signals of a replay.
///
/// See [`Crossing`].
pub trait Drain: Send {
    /// Sends the header.
    fn send_header(&mut self, to: &mut Record);

    /// Takes the start of the run's time, on the clock of [`crate::now_ns`].
    fn begin_run(&mut self, _epoch_ns: u64) {}

    /// Sends the next entry, if the file can take it now; `false`: nothing was sent.
    fn step(&mut self, to: Option<&mut Record>) -> bool;

    /// Reports the lost values to the file, when the run is over and nothing is left to send;
    /// `None`: there is no file.
    fn send_losses(&mut self, to: &mut Record) -> Option<RecordingState>;
}

/// The completeness of a recording.
///
/// See [`Drain`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordingState {
    /// The number of entries.
    pub entries: u64,
    /// The number of entries for values without room.
    pub lost: u64,
    /// Whether the recording says nothing of the time after its last entry.
    pub is_cut: bool,
}

impl RecordingState {
    fn of(file: &Record, is_cut: bool) -> Self {
        Self {
            entries: file.entries(),
            lost: file.lost(),
            is_cut,
        }
    }
}

/// Makes the crossing for the requested mode.
pub(crate) fn new_crossing(wish: EdgeMode, host: ReplayHost) -> Box<dyn Crossing> {
    match wish {
        EdgeMode::Record { app, bytes, .. } => Box::new(tape::RunRecorder::new(app, bytes)),
        EdgeMode::Replay { bytes, from } => Box::new(replay::OfMachine::new(bytes, from, host)),
        EdgeMode::Latest { app, jobs } => Box::new(latest::RecentJobs::new(app, jobs)),
    }
}

/// Makes the echo.
pub(crate) fn begin_echo() -> Box<dyn Echoing> {
    Box::new(echo::TopicEcho::new())
}

/// Adds the recorded topics of a DAG to a header.
pub fn open(header: &mut Header, dag: DagId, graph: u64, channels: &[Channel]) {
    let dags = header.dags.len().max(dag.index() + 1);
    // DAGs without recorded topics have an empty header, as a DAG's number in the plan is its place
    // here.
    header.dags.resize(dags, DagHeader::default());
    header.dags[dag.index()].graph = graph;
    header.channels.extend_from_slice(channels);
}

/// Adds the names of the recorded app and its DAGs to a header.
pub fn name(header: &mut Header, app: &str, task_set: &TaskSet) {
    header.app = app.into();
    let dags = task_set.dags();
    header.dags.resize(dags.len(), DagHeader::default());
    for (header, dag) in header.dags.iter_mut().zip(dags) {
        header.name = dag.name().into();
    }
}

/// The kinds of events that a platform passes to a [`Crossing`].
pub const HEARS: &[EventKind] = &[
    EventKind::Due,
    EventKind::Skipped,
    EventKind::Cancelled,
    EventKind::Restarted,
];

/// Returns the kind of entry recording an event, if any.
#[must_use]
pub const fn recorded(what: EventKind) -> Option<recording::EntryKind> {
    match what {
        EventKind::Due => Some(recording::EntryKind::Signal),
        EventKind::Skipped => Some(recording::EntryKind::Skip),
        EventKind::Cancelled => Some(recording::EntryKind::Cut),
        EventKind::Restarted => Some(recording::EntryKind::Restart),
        EventKind::Ended => Some(recording::EntryKind::Fault),
        // All other events follow from these when the functions are called again.
        _ => None,
    }
}

/// The sender of a recording, if any.
pub type Outgoing = Option<Box<dyn Drain>>;

/// The edge of a platform's runs.
///
/// ```
/// use fass::edge::{Edge, EdgeMode};
///
/// let mut edge = Edge::new();
/// assert!(!edge.is_wished());
/// edge.set_wish(EdgeMode::Latest { app: "pump", jobs: 4 });
/// assert!(edge.is_wished() && !edge.has_results());
/// ```
#[derive(Default)]
pub struct Edge {
    /// The mode stated by the command line.
    wish: Option<EdgeMode>,
    /// Whether people can look at values.
    shows: bool,
    crossing: Option<Box<dyn Crossing>>,
    echo: Option<Box<dyn Echoing>>,
    /// Whether a plan has been launched in a requested mode.
    is_on: bool,
    /// Whether the time told to functions is recorded or replayed.
    tells: bool,
    /// The start of the run's time, on the clock.
    epoch_ns: u64,
    /// The sender of the next run's recording.
    outgoing: Outgoing,
    /// Whether the jobs before a fault have been sent.
    has_sent_latest: bool,
    /// Why the requested mode does not suit the recording or the app.
    refusal: Option<String>,
    /// The difference of a replay from its recording, if any.
    complaint: Option<String>,
}

impl Edge {
    /// Makes an edge without a requested mode.
    pub const fn new() -> Self {
        Self {
            wish: None,
            shows: false,
            crossing: None,
            echo: None,
            is_on: false,
            tells: false,
            epoch_ns: 0,
            outgoing: None,
            has_sent_latest: false,
            refusal: None,
            complaint: None,
        }
    }

    /// Sets the mode stated by the command line, once.
    pub fn set_wish(&mut self, wish: EdgeMode) {
        self.wish = Some(wish);
    }

    /// Lets people look at values.
    pub fn let_look(&mut self) {
        self.shows = true;
    }

    /// Reports whether a mode or an echo is requested.
    pub const fn is_wished(&self) -> bool {
        self.wish.is_some() || self.shows
    }

    /// Reports whether results of subtasks are wanted at the edge, besides inputs.
    pub const fn has_results(&self) -> bool {
        self.shows || !matches!(self.wish, Some(EdgeMode::Latest { .. }))
    }

    /// Reports whether a replay is requested.
    pub const fn is_replay(&self) -> bool {
        matches!(self.wish, Some(EdgeMode::Replay { .. }))
    }

    /// Reports whether a plan has been launched in a requested mode, so events are of interest.
    pub(crate) const fn is_on(&self) -> bool {
        self.is_on
    }

    /// Reports whether the time told to functions is recorded or replayed.
    pub(crate) const fn tells(&self) -> bool {
        self.tells
    }

    /// Takes the recorded topics of a DAG. Reports whether their values are read in the places
    /// where they are written.
    pub fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        // Made at the first recorded topic: an app without one contains no code behind `begin`.
        if self.is_wished() && self.crossing.is_none() && self.echo.is_none() {
            (self.crossing, self.echo) = begin(self.wish, self.shows);
        }
        if let Some(echo) = &mut self.echo {
            echo.open(channels);
        }
        let crossing = self.crossing.as_mut();
        let is_read = crossing.is_some_and(|crossing| crossing.open(dag, graph, channels));
        // Any topic may become the watched one, so with an echo each value has to come by here.
        is_read && self.echo.is_none()
    }

    /// Sets up the recording or replay of a plan, if requested, and begins the recording in the
    /// file, if there is one.
    pub(crate) fn launch(
        &mut self,
        plan: &mut Plan,
        to: Option<&mut Record>,
    ) -> Result<(), String> {
        if let Some(echo) = &mut self.echo {
            echo.launch();
        }
        let (is_asked_for, replays) = match self.wish {
            None => return Ok(()),
            Some(EdgeMode::Record { .. }) => (true, false),
            Some(EdgeMode::Replay { .. }) => (true, true),
            Some(EdgeMode::Latest { .. }) => (false, false),
        };
        let is_second = is_asked_for && self.is_on;
        let launched = match &mut self.crossing {
            None if !replays => return Ok(()),
            // The values of a later commit are not recorded.
            Some(_) if is_second && !replays => return Ok(()),
            None => Err("`replay`: no topic of the app is recorded; name topics by `Dag::record`".into()),
            Some(_) if is_second => Err(
                "`replay`: a recording is of one commit, and this is another one; leave the word out".into()
            ),
            Some(crossing) => crossing.launch(plan).map(|()| crossing.drain()),
        };
        match launched {
            Ok(outgoing) => self.outgoing = outgoing,
            Err(why) => {
                self.refusal.get_or_insert_with(|| why.clone());
                return Err(why);
            }
        }
        if let (Some(drain), Some(to)) = (&mut self.outgoing, to) {
            // Here and not during the run: the header takes long on a slow device.
            drain.send_header(to);
        }
        self.is_on = true;
        // Not for the latest jobs: their history keeps no told times, so functions read the clock
        // itself.
        self.tells |= is_asked_for;
        Ok(())
    }

    /// Converts a time on the clock to the run's time.
    const fn of_run(&self, clock_ns: u64) -> u64 {
        clock_ns.saturating_sub(self.epoch_ns)
    }

    /// Returns the present time and records it, or in a replay returns the recorded time.
    pub(crate) fn tell_time(&mut self, instance: Option<Instance>, clock_ns: u64) -> u64 {
        let at_ns = self.of_run(clock_ns);
        match (&mut self.crossing, instance) {
            (Some(crossing), Some(instance)) => crossing.tell_time(instance, clock_ns, at_ns),
            // Outside an instance the time is no input of a job, so there is nothing to record.
            _ => clock_ns,
        }
    }

    /// Takes the sender for the run starting now. The run's time starts at `epoch_ns` on the clock.
    pub fn begin_run(&mut self, epoch_ns: u64) -> Outgoing {
        self.epoch_ns = epoch_ns;
        let mut outgoing = self.outgoing.take();
        if let Some(drain) = &mut outgoing {
            drain.begin_run(epoch_ns);
        }
        outgoing
    }

    /// Ends a run. Returns the findings of a replay; if the run `is_over`, they include a value it
    /// has not computed.
    pub fn end_run(&mut self, is_over: bool) -> Option<ReplayOutcome> {
        if !self.is_replay() {
            return None;
        }
        let outcome = self.crossing.as_ref()?.outcome(is_over)?;
        self.complaint = outcome.divergence.as_ref().map(ToString::to_string);
        Some(outcome)
    }

    /// Takes the sender of the jobs before a fault, if there was one: once, as there is only one
    /// file.
    pub fn before_fault(&mut self) -> Outgoing {
        let drain = self.crossing.as_mut()?.drain()?;
        let is_first = !core::mem::replace(&mut self.has_sent_latest, true);
        is_first.then_some(drain)
    }

    pub(crate) fn failed(&mut self, instance: Instance, clock_ns: u64) {
        let at_ns = self.of_run(clock_ns);
        if let Some(crossing) = &mut self.crossing {
            crossing.failed(instance, at_ns, clock_ns);
        }
    }

    /// Takes a value that is not read where it was written.
    pub(crate) fn record(&mut self, value: &RecordedValue<'_>) {
        let at_ns = self.of_run(value.completed_ns);
        if let Some(echo) = &mut self.echo {
            echo.record(value);
        }
        if let Some(crossing) = &mut self.crossing {
            crossing.record(value, at_ns);
        }
    }

    pub(crate) fn happened(&mut self, notice: &DriverNotice) {
        if let Some(crossing) = &mut self.crossing {
            crossing.happened(notice);
        }
    }

    /// Keeps the latest value of a recorded topic from now on; `None`: of no topic. Reports whether
    /// such a topic exists.
    pub fn watch(&mut self, topic: Option<&str>) -> bool {
        (self.echo.as_mut()).is_some_and(|echo| echo.watch(topic))
    }

    /// Takes the watched value out, if there is one.
    pub fn take_seen(&mut self, into: &mut [u8]) -> Option<WatchedValue> {
        self.echo.as_mut()?.take(into)
    }

    /// Returns a recorded value, which outlasts the edge's lock: the app's code reads it.
    pub fn find(&self, channel: u16, job: u64) -> Option<&'static [u8]> {
        self.crossing.as_ref()?.find(channel, job)
    }

    /// Returns why the requested mode could not be carried out, and how a replay differs from its
    /// recording, where either applies.
    #[must_use]
    pub fn objections(&self) -> [Option<String>; 2] {
        [self.refusal.clone(), self.complaint.clone()]
    }
}

impl fmt::Debug for Edge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Edge")
            .field("wish", &self.wish)
            .finish_non_exhaustive()
    }
}
