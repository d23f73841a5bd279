//! The edge of the runs of a platform: what is wished of it, and what carries that out.
//!
//! A platform has one, behind a lock of its own. Most of what it does under that lock is done
//! under the scheduler's lock, too; the drain is lent to whoever sends, so sending holds neither.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::{String, ToString};
use core::fmt;

use sched_dag::{DagId, Instance, Notice};

use super::{Begin, Channel, Crossing, Drain, Outcome, Record, Seen, Wish};
use crate::run::crossing::Recorded;
use crate::run::plan::Plan;

/// What sends a recording, if anything does.
pub type Outgoing = Option<Box<dyn Drain>>;

/// What crosses the edge of a platform's runs.
///
/// ```
/// use fass::edge::{Edge, Wish};
///
/// let mut edge = Edge::new();
/// assert!(!edge.is_wished());
/// edge.set_wish(&Wish::Latest { app: "pump", jobs: 4 });
/// assert!(edge.is_wished() && !edge.has_results());
/// ```
#[derive(Default)]
pub struct Edge {
    /// What the command line says.
    wish: Option<&'static Wish>,
    /// Whether people can look at what crosses.
    shows: bool,
    crossing: Option<Box<dyn Crossing>>,
    /// Whether a plan has been launched with it, so that events are of interest.
    is_on: bool,
    /// What sends the recording of the run to come.
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
    #[must_use]
    pub const fn new() -> Self {
        Self {
            wish: None,
            shows: false,
            crossing: None,
            is_on: false,
            outgoing: None,
            has_sent_latest: false,
            refusal: None,
            complaint: None,
        }
    }

    /// Takes what the command line says, once.
    pub fn set_wish(&mut self, wish: &'static Wish) {
        self.wish = Some(wish);
    }

    /// Lets people look at what crosses.
    pub fn let_look(&mut self) {
        self.shows = true;
    }

    /// Reports whether there is a wish.
    #[must_use]
    pub const fn is_wished(&self) -> bool {
        self.wish.is_some() || self.shows
    }

    /// Reports whether there are results among what crosses.
    #[must_use]
    pub const fn has_results(&self) -> bool {
        self.shows || !matches!(self.wish, Some(Wish::Latest { .. }))
    }

    /// Reports whether a replay is wished.
    #[must_use]
    pub const fn is_replay(&self) -> bool {
        matches!(self.wish, Some(Wish::Replay { .. }))
    }

    /// Reports whether a plan has been launched with a wish, so that events are of interest.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.is_on
    }

    /// Takes the recorded topics of a DAG, and reports whether their values are read where they
    /// are written.
    pub fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        let wish = match (self.wish, self.shows) {
            (wish, true) => Wish::Echo(wish),
            (Some(wish), false) => *wish,
            (None, false) => return false,
        };
        let crossing = self.crossing.get_or_insert_with(|| begin(wish));
        crossing.open(dag, graph, channels)
    }

    /// Makes a plan one that is recorded or replayed, if there is a wish, and begins a
    /// recording in the file, if there is one. Reports whether that goes for the times, too, that functions are told.
    ///
    /// # Errors
    ///
    /// If nothing of the plan is recorded, it does not fit a replay, or it is a second one.
    pub fn launch(&mut self, plan: &mut Plan, to: Option<&mut Record>) -> Result<bool, String> {
        let word = match self.wish {
            None => {
                let launched = self.crossing.as_mut().map(|crossing| crossing.launch(plan));
                return launched.unwrap_or(Ok(())).map(|()| false);
            }
            Some(Wish::Record { .. }) => "record",
            Some(Wish::Replay { .. }) => "replay",
            Some(Wish::Latest { .. } | Wish::Echo(_)) => "latest",
        };
        let is_asked_for = !matches!(self.wish, Some(Wish::Latest { .. }));
        let is_needed = match self.wish {
            Some(Wish::Record { is_needed, .. }) => *is_needed,
            _ => is_asked_for,
        };
        let launched = match &mut self.crossing {
            None if !is_needed => return Ok(false),
            // Of the other commits all is kept but values.
            Some(_) if !is_needed && self.is_on && is_asked_for => return Ok(false),
            None => Err(format!(
                "`{word}`: no topic of the app is recorded; name topics by `Dag::record`"
            )),
            Some(_) if is_asked_for && self.is_on => Err(format!(
                "`{word}`: a recording is of one commit, and this is another one; leave the word out"
            )),
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
            drain.begin(to);
        }
        self.is_on = true;
        Ok(is_asked_for)
    }

    /// Tells an instance the time, and has it written down; or tells what the recording says that
    /// it was. Times are the clock's and the run's.
    pub fn tell_time(&mut self, instance: Option<Instance>, clock_ns: u64, at_ns: u64) -> u64 {
        match (&mut self.crossing, instance) {
            (Some(crossing), Some(instance)) => crossing.tell_time(instance, clock_ns, at_ns),
            _ => clock_ns,
        }
    }

    /// Takes what sends the recording of the run that begins, whose time begins then.
    pub fn begin_run(&mut self, epoch_ns: u64) -> Outgoing {
        let mut outgoing = self.outgoing.take();
        if let Some(drain) = &mut outgoing {
            drain.begin_run(epoch_ns);
        }
        outgoing
    }

    /// Ends a run. Returns what a replay has found; if the run `is_over`, also a value that it has
    /// not computed.
    pub fn end_run(&mut self, is_over: bool) -> Option<Outcome> {
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

    /// Takes note that an instance has failed, on the run's time and the clock's.
    pub fn failed(&mut self, instance: Instance, at_ns: u64, clock_ns: u64) {
        if self.is_on
            && let Some(crossing) = &mut self.crossing
        {
            crossing.failed(instance, at_ns, clock_ns);
        }
    }

    /// Takes a value that is not read where it was written, and when that was in the time of the
    /// run.
    pub fn record(&mut self, value: &Recorded<'_>, at_ns: u64) {
        if let Some(crossing) = &mut self.crossing {
            crossing.record(value, at_ns);
        }
    }

    /// Takes what became of a job or an instance, if it is of interest.
    pub fn happened(&mut self, notice: &Notice) {
        if self.is_on
            && let Some(crossing) = &mut self.crossing
        {
            crossing.happened(notice);
        }
    }

    /// Keeps the latest value of a recorded topic from now on, or nothing. Reports whether there
    /// is such a topic.
    pub fn watch(&mut self, topic: Option<&str>) -> bool {
        let echo = self.crossing.as_mut().and_then(|crossing| crossing.echo());
        echo.is_some_and(|echo| echo.watch(topic))
    }

    /// Takes that value out, if there is one.
    pub fn take_seen(&mut self, into: &mut [u8]) -> Option<Seen> {
        self.crossing.as_mut()?.echo()?.take(into)
    }

    /// Lends a recorded value.
    pub fn lend(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        if let Some(crossing) = &self.crossing {
            crossing.lend(channel, job, take);
        }
    }

    /// Returns why the wish could not be met, if it could not.
    #[must_use]
    pub fn refusal(&self) -> Option<&str> {
        self.refusal.as_deref()
    }

    /// Returns how a replay differs from its recording, if it does.
    #[must_use]
    pub fn complaint(&self) -> Option<&str> {
        self.complaint.as_deref()
    }
}

impl fmt::Debug for Edge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Edge")
            .field("wish", &self.wish)
            .finish_non_exhaustive()
    }
}
