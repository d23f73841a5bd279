//! The edge of a run on a machine: values are written into a buffer, or taken from a recording.
//!
//! A *tape* takes what happens, from the core that completes, and makes places for values, into
//! which instances write them: it allocates nothing and waits for nothing. The *drain* makes the
//! file of it, whenever a core has time. A *replay* lends recorded values, and compares those that
//! are computed. An *echo* keeps the latest value of a topic for people to look at. If none of
//! these is asked for, the inputs of the last jobs may be kept, for the case that one fails.
//!
//! A platform reaches all this by what [`Platform::open_channels`](crate::platform::Platform::open_channels)
//! gives it, so that an image in which no topic is recorded has none of this code.
//!
//! The [`Edge`] of a platform's runs knows what is wished of it, and has what carries that out. A
//! platform has one, behind a lock of its own. Most of what it does under that lock is done
//! under the scheduler's lock, too; the drain is lent to whoever sends, so sending holds neither.

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
    /// Record it.
    Record {
        /// The app that is recorded, by its name.
        app: &'static str,
        /// The room for what is not drained yet.
        bytes: usize,
    },
    /// Replay these bytes.
    Replay {
        /// A recording.
        bytes: &'static [u8],
        /// The job of a DAG to begin with, or before it, if that is not the first one.
        from: Option<(&'static str, u64)>,
    },
    /// Keep the inputs of the last jobs, and give them away if one fails.
    Latest {
        /// The app that is recorded, by its name.
        app: &'static str,
        /// How many jobs of each DAG.
        jobs: u32,
    },
}

/// Functions of the platform that a replay needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReplayHost {
    /// Takes a signal from outside.
    pub(crate) raise: fn(u64, DagId),
    pub(crate) now_ns: fn() -> u64,
}

/// Begins to do what is wished, and, if people can look, what they see.
pub type Begin =
    fn(Option<EdgeMode>, bool) -> (Option<Box<dyn Crossing>>, Option<Box<dyn Echoing>>);

/// Calls of a platform that records or replays; times are of the run. A call that does
/// not concern a replay, or a tape, does nothing there.
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
    /// Takes the recorded topics of a DAG, and the hash of its names and edges. Reports whether
    /// the launch will take the values from where they are written, so that only those come to
    /// [`record`](Self::record) that have no room.
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool;

    /// Takes the plan, before anything of it has run. Takes all memory that will be needed.
    ///
    /// # Errors
    ///
    /// In words: there is no memory, or the replay does not fit.
    fn launch(&mut self, plan: &mut Plan) -> Result<(), String>;

    /// Takes a value, at the completion of its writer: `at_ns` on the time of the run.
    fn record(&mut self, value: &RecordedValue<'_>, at_ns: u64);

    /// Takes what has become of a job, or of an instance: an event of those of [`HEARS`].
    fn happened(&mut self, notice: &DriverNotice);

    /// Takes note that an instance has failed, and what it had sampled: `at_ns` on the time of
    /// the run, `clock_ns` on that of [`crate::now_ns`].
    fn failed(&mut self, _instance: Instance, _at_ns: u64, _clock_ns: u64) {}

    /// Returns the time for an instance that asks for it, `clock_ns` on the clock of
    /// [`crate::now_ns`] and `at_ns` on the time of the run.
    fn tell_time(&mut self, _instance: Instance, clock_ns: u64, _at_ns: u64) -> u64 {
        clock_ns
    }

    /// Returns the recorded value of a channel and a job, if there is one.
    fn find(&self, _channel: u16, _job: u64) -> Option<&'static [u8]> {
        None
    }

    /// Returns the work of core 0; the first time only. Of the last jobs there is a file when
    /// one has failed.
    fn drain(&mut self) -> Option<Box<dyn Drain>>;

    /// Returns the findings of a replay; if the run is over, also a value that it has not computed.
    fn outcome(&self, _is_over: bool) -> Option<ReplayOutcome> {
        None
    }
}

/// Shows values of a recorded topic while the run goes on.
///
/// See [`Crossing`].
pub trait Echoing: Send {
    /// Takes the recorded topics of a DAG of the plan to come.
    fn open(&mut self, channels: &[Channel]);

    /// Takes note that the plan is there.
    fn launch(&mut self);

    /// Takes a value, at the completion of its writer.
    fn record(&mut self, value: &RecordedValue<'_>);

    /// Keeps the latest value of this topic from now on, or nothing. Reports whether the topic is
    /// recorded.
    fn watch(&mut self, topic: Option<&str>) -> bool;

    /// Takes the latest value out, if there is one since the last call. Allocates nothing.
    fn take(&mut self, into: &mut [u8]) -> Option<WatchedValue>;
}

/// A value of a topic that is watched.
///
/// See [`Echoing`].
#[derive(Clone, Debug)]
pub struct WatchedValue {
    /// The job that it is of.
    pub job: u64,
    /// How many values came since the one that was taken before, and were not.
    pub left_out: u64,
    /// How many bytes it has; `None`: more than there was room for.
    length: Option<usize>,
    schema: Arc<Schema>,
    /// The function that makes its text, which only an image with a recorded topic has.
    write: fn(&Schema, &[u8], &mut fmt::Formatter<'_>) -> fmt::Result,
}

impl WatchedValue {
    /// Returns the value in the buffer that it was taken into, as text. Nothing is allocated.
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

/// The file that what is recorded goes into.
pub type Record = Stream<dyn Sink + Send>;

/// The part that core 0 does when it has nothing else to do: it makes a file of what is recorded,
/// and
/// allocates nothing but for the header; or it raises the signals of a replay.
///
/// See [`Crossing`].
pub trait Drain: Send {
    /// Sends the header.
    fn send_header(&mut self, to: &mut Record);

    /// Takes when the time of the run begins, on the clock of [`crate::now_ns`].
    fn begin_run(&mut self, _epoch_ns: u64) {}

    /// Sends the next entry, if the file can take it now; `false`: nothing was sent.
    fn step(&mut self, to: Option<&mut Record>) -> bool;

    /// Sends what is lost, when the run is over and nothing is left; `None`: there is no file.
    fn send_losses(&mut self, to: &mut Record) -> Option<RecordingState>;
}

/// How complete a recording is.
///
/// See [`Drain`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordingState {
    /// The entries.
    pub entries: u64,
    /// Those of values for which there was no room.
    pub lost: u64,
    /// Whether it says nothing of what happened after its last entry.
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

/// Begins to do what is wished.
pub(crate) fn new_crossing(wish: EdgeMode, host: ReplayHost) -> Box<dyn Crossing> {
    match wish {
        EdgeMode::Record { app, bytes, .. } => Box::new(tape::RunRecorder::new(app, bytes)),
        EdgeMode::Replay { bytes, from } => Box::new(replay::OfMachine::new(bytes, from, host)),
        EdgeMode::Latest { app, jobs } => Box::new(latest::RecentJobs::new(app, jobs)),
    }
}

/// Begins to show values.
pub(crate) fn begin_echo() -> Box<dyn Echoing> {
    Box::new(echo::TopicEcho::new())
}

/// Adds the recorded topics of a DAG to a header.
pub fn open(header: &mut Header, dag: DagId, graph: u64, channels: &[Channel]) {
    let dags = header.dags.len().max(dag.index() + 1);
    // DAGs that record nothing have an empty header: numbers are those of the plan.
    header.dags.resize(dags, DagHeader::default());
    header.dags[dag.index()].graph = graph;
    header.channels.extend_from_slice(channels);
}

/// Adds the names to a header: of what is recorded, and of its DAGs.
pub fn name(header: &mut Header, app: &str, task_set: &TaskSet) {
    header.app = app.into();
    let dags = task_set.dags();
    header.dags.resize(dags.len(), DagHeader::default());
    for (header, dag) in header.dags.iter_mut().zip(dags) {
        header.name = dag.name().into();
    }
}

/// The events that a platform tells a [`Crossing`] of.
pub const HEARS: &[EventKind] = &[
    EventKind::Due,
    EventKind::Skipped,
    EventKind::Cancelled,
    EventKind::Restarted,
];

/// Returns the kind of entry that records an event, if one does.
#[must_use]
pub const fn recorded(what: EventKind) -> Option<recording::EntryKind> {
    match what {
        EventKind::Due => Some(recording::EntryKind::Signal),
        EventKind::Skipped => Some(recording::EntryKind::Skip),
        EventKind::Cancelled => Some(recording::EntryKind::Cut),
        EventKind::Restarted => Some(recording::EntryKind::Restart),
        EventKind::Ended => Some(recording::EntryKind::Fault),
        // All else follows from these when the functions are called again.
        _ => None,
    }
}

/// The sender of a recording, if there is one.
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
    /// The mode that the command line states.
    wish: Option<EdgeMode>,
    /// Whether people can look at what crosses.
    shows: bool,
    crossing: Option<Box<dyn Crossing>>,
    echo: Option<Box<dyn Echoing>>,
    /// Whether a plan has been launched with it.
    is_on: bool,
    /// Whether the time that functions are told is recorded or replayed.
    tells: bool,
    /// When the run's time begins, on the clock.
    epoch_ns: u64,
    /// The sender of the next run's recording.
    outgoing: Outgoing,
    /// Whether the jobs before a fault have been sent.
    has_sent_latest: bool,
    /// Why the recording, or the app, does not go with the wish.
    refusal: Option<String>,
    /// How a replay differed from its recording, if it did.
    complaint: Option<String>,
}

impl Edge {
    /// Begins without a wish.
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

    /// Takes what the command line says, once.
    pub fn set_wish(&mut self, wish: EdgeMode) {
        self.wish = Some(wish);
    }

    /// Lets people look at what crosses.
    pub fn let_look(&mut self) {
        self.shows = true;
    }

    /// Reports whether there is a wish.
    pub const fn is_wished(&self) -> bool {
        self.wish.is_some() || self.shows
    }

    /// Reports whether there are results among what crosses.
    pub const fn has_results(&self) -> bool {
        self.shows || !matches!(self.wish, Some(EdgeMode::Latest { .. }))
    }

    /// Reports whether a replay is wished.
    pub const fn is_replay(&self) -> bool {
        matches!(self.wish, Some(EdgeMode::Replay { .. }))
    }

    /// Reports whether a plan has been launched with a wish, so that events are of interest.
    pub(crate) const fn is_on(&self) -> bool {
        self.is_on
    }

    /// Reports whether the time that functions are told is recorded or replayed.
    pub(crate) const fn tells(&self) -> bool {
        self.tells
    }

    /// Takes the recorded topics of a DAG, and reports whether their values are read where they
    /// are written.
    pub fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        if self.is_wished() && self.crossing.is_none() && self.echo.is_none() {
            (self.crossing, self.echo) = begin(self.wish, self.shows);
        }
        if let Some(echo) = &mut self.echo {
            echo.open(channels);
        }
        let crossing = self.crossing.as_mut();
        let is_read = crossing.is_some_and(|crossing| crossing.open(dag, graph, channels));
        // Any topic may be the one that is watched, so each value has to come by here.
        is_read && self.echo.is_none()
    }

    /// Sets recording or replay of a plan up, if it was asked for, and begins a recording in the
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
            // Of the other commits all is kept but values.
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
            // Not during the run: it takes long where a byte does.
            drain.send_header(to);
        }
        self.is_on = true;
        self.tells |= is_asked_for;
        Ok(())
    }

    /// Converts a time on the clock to the run's.
    const fn of_run(&self, clock_ns: u64) -> u64 {
        clock_ns.saturating_sub(self.epoch_ns)
    }

    /// Returns the time and records it, or returns the recorded one.
    pub(crate) fn tell_time(&mut self, instance: Option<Instance>, clock_ns: u64) -> u64 {
        let at_ns = self.of_run(clock_ns);
        match (&mut self.crossing, instance) {
            (Some(crossing), Some(instance)) => crossing.tell_time(instance, clock_ns, at_ns),
            _ => clock_ns,
        }
    }

    /// Takes what sends the recording of the run that begins, whose time begins then.
    pub fn begin_run(&mut self, epoch_ns: u64) -> Outgoing {
        self.epoch_ns = epoch_ns;
        let mut outgoing = self.outgoing.take();
        if let Some(drain) = &mut outgoing {
            drain.begin_run(epoch_ns);
        }
        outgoing
    }

    /// Ends a run. Returns the findings of a replay; if the run `is_over`, also a value that it has
    /// not computed.
    pub fn end_run(&mut self, is_over: bool) -> Option<ReplayOutcome> {
        if !self.is_replay() {
            return None;
        }
        let outcome = self.crossing.as_ref()?.outcome(is_over)?;
        self.complaint = outcome.divergence.as_ref().map(ToString::to_string);
        Some(outcome)
    }

    /// Takes what sends the jobs before a fault, if there was one; once, for there is one file.
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

    /// Keeps the latest value of a recorded topic from now on, or nothing. Reports whether there
    /// is such a topic.
    pub fn watch(&mut self, topic: Option<&str>) -> bool {
        (self.echo.as_mut()).is_some_and(|echo| echo.watch(topic))
    }

    /// Takes that value out, if there is one.
    pub fn take_seen(&mut self, into: &mut [u8]) -> Option<WatchedValue> {
        self.echo.as_mut()?.take(into)
    }

    /// Returns a recorded value, which outlasts the edge's lock: what reads it is the app's.
    pub fn find(&self, channel: u16, job: u64) -> Option<&'static [u8]> {
        self.crossing.as_ref()?.find(channel, job)
    }

    /// Returns why the wish could not be met, and how a replay differs from its recording, if that
    /// is so.
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
