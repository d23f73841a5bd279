//! The line of a channel: the path of its values across the edge of a DAG, to the platform.
//!
//! An instance writes a value into an [outbox](super::cell::outbox) as soon as it has the value.
//! When the instance is complete, the platform's reader finds the value there. A platform without a
//! reader is given the value at once.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering};

use recording::{Encoder, Recordable, Role, Schema};
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Instance};

use super::cell::SetOnce;
use super::effect::Effect;
use crate::run::cell::outbox::{Outbox, OutboxReader, outbox, words_of};

/// The number of a channel not numbered yet.
const NO_CHANNEL: u16 = u16::MAX;

/// The state of a channel, shared by its writer, its publisher and a replay.
pub(crate) struct ChannelState {
    number: AtomicU16,
    pub(super) edge: &'static TopicEdge,
    /// Whether the platform reads the values; otherwise each is given to it.
    is_read: AtomicBool,
    /// The outbox for the values, if anybody wants them.
    outbox: SetOnce<Outbox>,
}

impl ChannelState {
    pub(crate) const fn new(edge: &'static TopicEdge) -> Self {
        Self {
            number: AtomicU16::new(NO_CHANNEL),
            edge,
            is_read: AtomicBool::new(false),
            outbox: SetOnce::new(),
        }
    }

    /// Reports whether the channel has a number: otherwise nobody wants its values.
    pub(super) fn is_open(&self) -> bool {
        self.number() != NO_CHANNEL
    }

    /// Returns the number of the channel.
    pub(super) fn number(&self) -> u16 {
        self.number.load(Ordering::Relaxed)
    }

    pub(crate) fn set_number(&self, number: u16) {
        self.number.store(number, Ordering::Relaxed);
    }

    /// Notes whether the platform reads the values, each of at least `least_bytes` bytes.
    pub(crate) fn open(&self, is_read: bool, least_bytes: usize) {
        self.is_read.store(is_read, Ordering::Relaxed);
        // Nobody drains the outbox in the background, so it needs room for only one value at a
        // time.
        if !is_read && let Some((outbox, _)) = outbox(words_of(room_for(least_bytes))) {
            // Cannot fail: the commit, which comes once, sets this outbox or the other.
            let _ = self.outbox.set(outbox);
        }
    }

    /// Returns the effect of the writer's completion.
    pub(super) fn effect(self: &Arc<Self>) -> Box<dyn Effect> {
        match self.is_read.load(Ordering::Relaxed) {
            true => Box::new(ReaderPublish(Arc::clone(self))),
            false => Box::new(PlatformGive(Arc::clone(self))),
        }
    }

    /// Makes a reader of values of at least `least_bytes` bytes, with room for `words` words, or
    /// more if too few values would fit. `None`: out of memory. If the platform is given each value
    /// instead, also returns the outbox where it puts them.
    pub(crate) fn reader(
        &self,
        words: usize,
        least_bytes: usize,
    ) -> Option<(OutboxReader, Option<Outbox>)> {
        // Half of this room is in one piece, wherever the next value starts.
        let least = 2 * words_of(room_for(least_bytes)) + 1;
        let (outbox, reader) = outbox(words.max(least))?;
        // The outbox for staging is in place already; this one is for the platform to keep given
        // values.
        if !self.is_read.load(Ordering::Relaxed) {
            return Some((reader, Some(outbox)));
        }
        let _ = self.outbox.set(outbox);
        Some((reader, None))
    }

    /// Writes the value of an instance before its completion.
    #[inline(always)]
    pub(super) fn stage<T: Recordable>(&self, job: u64, write: impl Fn(&mut Encoder<'_>)) {
        if let Some(outbox) = self.outbox.get() {
            // Computed by the compiler, not on the path of each value.
            let most = const { room_for(T::LEAST_BYTES) };
            outbox.stage(job, most, |bytes| {
                let mut out = Encoder::new(bytes);
                write(&mut out);
                out.finish()
            });
        }
    }

    /// Lets the reader have the staged value, if any: its instance is complete.
    #[inline(always)]
    fn publish(&self, completed_ns: u64) {
        if let Some(outbox) = self.outbox.get()
            // No room to publish: the value is given instead, and the platform decides about the
            // loss.
            && !outbox.publish(completed_ns)
        {
            self.show(completed_ns, self.edge.record);
        }
    }

    /// Gives the staged value to the platform, or reports its lack of room.
    #[inline(never)]
    pub(crate) fn show(&self, completed_ns: u64, take: impl FnOnce(&RecordedValue<'_>)) {
        if let Some(outbox) = self.outbox.get() {
            outbox.show(|job, bytes| {
                take(&RecordedValue {
                    channel: self.number(),
                    job,
                    completed_ns,
                    bytes,
                });
            });
        }
    }

    /// Publishes the value, or gives it to the platform if it cannot be published.
    pub(super) fn give(&self, completed_ns: u64) {
        self.publish_or_give(completed_ns, self.edge.record);
    }

    /// Publishes the value, or gives it to `take` if there is no reader or no room to publish.
    pub(crate) fn publish_or_give(&self, at_ns: u64, take: impl FnOnce(&RecordedValue<'_>)) {
        let is_read = self.is_read.load(Ordering::Relaxed);
        if !is_read || !(self.outbox.get()).is_some_and(|outbox| outbox.publish(at_ns)) {
            self.show(at_ns, take);
        }
    }
}

/// Lets the reader have a value.
struct ReaderPublish(Arc<ChannelState>);

impl Effect for ReaderPublish {
    // Compiled with the app: this crate's own code is compiled for size.
    #[inline]
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.publish(completed_ns);
    }
}

/// Gives a value to the platform.
struct PlatformGive(Arc<ChannelState>);

impl Effect for PlatformGive {
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.show(completed_ns, self.0.edge.record);
    }
}

/// Publishes or gives the samples, answers and states found by an instance, even a failed one:
/// without them nobody could compute its fault again.
pub(super) struct InstanceOutputs(pub(super) Arc<ChannelState>);

impl Effect for InstanceOutputs {
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.give(completed_ns);
    }

    fn fail(&mut self, failed_ns: u64) {
        self.0.give(failed_ns);
    }
}

/// A recorded state of any type.
pub(crate) trait AnyState: Send + Sync {
    fn schema(&self) -> Schema;

    /// Writes down the present value, unless somebody is changing it.
    fn stage(&self, line: &ChannelState, job: u64);

    /// Restores a recorded value; `false`: the bytes are no such value, or somebody has a claim.
    fn restore(&self, bytes: &[u8]) -> bool;
}

/// A recorded state, and how often it is written down.
pub(crate) struct KeptState {
    pub(crate) state: Arc<dyn AnyState>,
    /// The state is written down in each job whose number is a multiple of `every`.
    every: AtomicU32,
}

impl KeptState {
    pub(crate) fn new(state: Arc<dyn AnyState>, every: u32) -> Self {
        Self {
            state,
            // By 0, job 0 alone would count as a multiple.
            every: AtomicU32::new(every.max(1)),
        }
    }

    /// Writes the state down, if due in the job.
    pub(crate) fn keep(&self, line: &ChannelState, job: u64) {
        if job.is_multiple_of(self.every.load(Ordering::Relaxed).into()) {
            self.state.stage(line, job);
        }
    }

    /// Has the state written down at least every `jobs` jobs.
    pub(crate) fn keep_every(&self, jobs: u32) {
        // There may be two requests; the more frequent one serves both.
        self.every.fetch_min(jobs.max(1), Ordering::Relaxed);
    }
}

/// The line of a channel of a plan, with its subtask.
pub(crate) struct LineOf {
    pub(crate) dag: DagId,
    pub(crate) subtask: usize,
    pub(crate) role: Role,
    pub(crate) line: Arc<ChannelState>,
    /// The state whose values the line carries, if any.
    pub(crate) state: Option<Arc<KeptState>>,
}

impl LineOf {
    /// Reports whether the line carries samples, answers or a state found by an instance.
    pub(crate) fn is_found_by(&self, instance: Instance) -> bool {
        let of = (self.dag, self.subtask);
        !self.role.is_written() && of == (instance.dag, instance.subtask.index())
    }
}

impl fmt::Debug for KeptState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("KeptState")
    }
}

impl fmt::Debug for LineOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("LineOf")
    }
}

/// The least room for a value, in bytes.
const ROOM: usize = 4096;

/// A recorded value: of a topic, a sample, a state or the answers of a device, given to the
/// platform when the instance that wrote or found it is complete, or, for a finding, has failed.
///
/// ```
/// fn show(value: &fass::edge::RecordedValue<'_>) {
///     match value.bytes {
///         Some(bytes) => println!("channel {}, job {}: {bytes:?}", value.channel, value.job),
///         None => println!("channel {}, job {} is lost", value.channel, value.job),
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct RecordedValue<'v> {
    /// The number of the channel
    /// ([`Platform::open_channels`](crate::platform::Platform::open_channels)).
    pub channel: u16,
    /// The job.
    pub job: u64,
    /// The time of the instance's completion or fault, on the clock of [`crate::now_ns`].
    pub completed_ns: u64,
    /// The value; `None` if there was no room for it.
    pub bytes: Option<&'v [u8]>,
}

/// The path from a topic to the platform, and back. An image without recorded topics has none.
pub(crate) struct TopicEdge {
    /// Takes a value.
    pub(crate) record: fn(&RecordedValue<'_>),
    /// Reports whether there is a replay.
    pub(crate) replays: fn() -> bool,
    /// Lends a value, if there is one.
    pub(crate) replay: Lend,
}

/// A function lending the value of a channel and a job.
type Lend = fn(u16, u64, &mut dyn FnMut(&[u8]));

/// Returns the room for a value of at least `least_bytes` bytes, in bytes.
pub(crate) const fn room_for(least_bytes: usize) -> usize {
    match 2 * least_bytes {
        room if room > ROOM => room,
        _ => ROOM,
    }
}
