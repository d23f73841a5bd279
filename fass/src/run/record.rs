//! A recorded topic: what writes its values down, and what gives them back in a replay.
//!
//! Such a topic has a *tap* between its writer and its readers. It looks at each value when the
//! writer's function has returned, and writes it down; the writer's completion lets that go to
//! the platform. In a replay the body of a source is another one, which asks the
//! platform for the values of the job, and sends them.
//!
//! What a subtask samples of such a topic is written down when it looks, and goes to the platform when
//! the instance is complete, or has failed: without it nobody could compute its fault again.
//!
//! # The way of a channel's values to the platform
//!
//! A value is written into an [outbox](super::cell::outbox) when its instance has it, and goes on
//! when the instance is complete: the platform's reader finds it there, or, if it has none, is
//! given it at once.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::fmt;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, AtomicU64, Ordering};

use recording::{Channel, Encoder, Recordable, Role, Schema};
use sched_dag::lifecycle::Request;
use sched_dag::wcets::graph_hash;
use sched_dag::{DagId, DagSpec, Instance, SubtaskId, TopicPort};

use super::cell::SetOnce;
use super::latest::{AnyLatest, Entry, Probe, SharedLatest, Slot};
use super::message::{Message, MessageType};
use super::plan::{Body, Effect, Subtask};
use super::topic::{Ports, Publisher, Wiring, Wrap};
use crate::run::cell::outbox::{Outbox, OutboxReader, outbox, words_of};

/// A recorded topic while DAGs are built.
pub(crate) struct RecordedTopic<T> {
    topic: String,
    line: Arc<Line>,
    of: PhantomData<fn() -> T>,
}

/// A recorded topic of whatever type.
pub(crate) trait AnyRecorded: AnyLatest {
    fn edge(&self) -> &'static Edge;

    /// Returns the type of its values, and their way.
    fn line(&self) -> (Schema, Arc<Line>);

    /// Returns what sends recorded values, in the place of the writer's next output port.
    fn replayed(&self, ports: &mut Ports<'_>) -> Replayed;

    /// Sets a probe for samples of the topic, and returns it, with the type of the samples and
    /// their line; none if the latest value is of another type.
    fn probe(
        &self,
        latest: &dyn Any,
        sampler: usize,
    ) -> Option<(Arc<dyn Probe>, Schema, Arc<Line>)>;

    /// Numbers all recorded topics of a DAG, what its subtasks sample of such topics, and its
    /// recorded states, tells the platform, and adds their lines to those before. Returns what is
    /// put around subtasks for that.
    fn open_all(&self, of: &OfDag<'_>, lines: &mut Vec<LineOf>) -> Vec<(usize, Around)> {
        let (dag, spec) = (of.dag, of.spec);
        if !(self.edge().crosses)() {
            return Vec::new();
        }
        let first = lines.len();
        let mut channels = Vec::new();
        let mut open = |subtask, role, topic: &str, (schema, line): (Schema, Arc<Line>), state| {
            line.set_number(narrow(lines.len()));
            lines.push(LineOf {
                dag,
                subtask,
                role,
                line,
                state,
            });
            channels.push(Channel {
                dag: narrow(dag.index()),
                subtask: narrow(subtask),
                role,
                topic: topic.into(),
                schema,
            });
        };
        let has_results = (self.edge().has_results)();
        for topic in of.recorded {
            let (subtask, role) = writer(&**topic, spec);
            if has_results || role != Role::Result {
                open(subtask, role, topic.topic(), topic.line(), None);
            }
        }
        let mut around = Vec::new();
        for sample in of.samples {
            let latest = &*sample.latest;
            if let Some((probe, schema, line)) = sample.of.probe(latest, sample.sampler) {
                let way = (schema, Arc::clone(&line));
                open(sample.subtask, Role::Sample, latest.topic(), way, None);
                let look = move |job| probe.begin(job);
                around.push((sample.subtask, looking(line, look)));
            }
        }
        for (position, of_state) in of.states {
            let state = &spec.states[*position];
            let changes = |subtask: &usize| {
                let mut users = state.users.iter();
                users.any(|user| user.updates && user.subtask == *subtask)
            };
            // The users take turns in that order.
            let mut subtasks = of.order.iter().map(|subtask| subtask.index());
            if let Some(subtask) = subtasks.find(changes) {
                let line = Arc::new(Line::new(self.edge()));
                let way = (of_state.state.schema(), Arc::clone(&line));
                open(
                    subtask,
                    Role::State,
                    &state.name,
                    way,
                    Some(Arc::clone(of_state)),
                );
                let (found, kept) = (Arc::clone(&line), Arc::clone(of_state));
                let look = move |job| kept.keep(&line, job);
                around.push((subtask, looking(found, look)));
            }
        }
        if !channels.is_empty() {
            let is_read = (self.edge().open)(dag, graph_hash(spec), &channels);
            for (of, channel) in lines[first..].iter().zip(&channels) {
                of.line.open(is_read, channel.schema.least_bytes());
            }
        }
        around
    }

    /// Puts these around the bodies of subtasks.
    fn attach(&self, around: Vec<(usize, Around)>, bodies: &mut Vec<Body>) {
        let mut all: Vec<Option<Body>> = core::mem::take(bodies).into_iter().map(Some).collect();
        for (subtask, around) in around {
            all[subtask] = all[subtask].take().map(around);
        }
        bodies.extend(all.into_iter().flatten());
    }

    /// Returns the body of a source in a replay, if there is one and the source is recorded.
    fn source(
        &self,
        all: &[Rc<dyn AnyRecorded>],
        spec: &DagSpec,
        wiring: &mut Wiring,
        subtask: usize,
    ) -> Option<Body> {
        let source = &spec.subtasks[subtask];
        let find = |topic: &str| all.iter().find(|recorded| recorded.topic() == topic);
        let is_recorded = source
            .outputs
            .iter()
            .any(|port| find(&port.topic).is_some());
        if !is_recorded || !source.inputs.is_empty() || !(self.edge().replays)() {
            return None;
        }
        let mut ports = wiring.ports(subtask);
        // The commit has made sure that all of them are recorded.
        let outputs = source.outputs.iter().filter_map(|port| find(&port.topic));
        let outputs = outputs.map(|recorded| recorded.replayed(&mut ports));
        Some(Body::new(Box::new(ReplayedSource(outputs.collect()))))
    }
}

/// A DAG whose topics are recorded.
pub(crate) struct OfDag<'d> {
    pub(crate) dag: DagId,
    pub(crate) spec: &'d DagSpec,
    /// The subtasks, each behind those that it waits for.
    pub(crate) order: &'d [SubtaskId],
    pub(crate) recorded: &'d [Rc<dyn AnyRecorded>],
    pub(crate) samples: &'d [Sampled],
    /// Its recorded states, by their positions.
    pub(crate) states: &'d [(usize, Arc<KeptState>)],
}

/// A latest value of a recorded topic, as a subtask samples it.
pub(crate) struct Sampled {
    pub(crate) subtask: usize,
    pub(crate) latest: Rc<dyn AnyLatest>,
    /// The number that the subtask has at the latest value.
    pub(crate) sampler: usize,
    /// The topic.
    pub(crate) of: Rc<dyn AnyRecorded>,
}

fn narrow(number: usize) -> u16 {
    u16::try_from(number).unwrap_or(u16::MAX)
}

/// Returns the subtask that writes a recorded topic, and what the topic is to its DAG.
fn writer(topic: &dyn AnyRecorded, spec: &DagSpec) -> (usize, Role) {
    let mut subtasks = spec.subtasks.iter().enumerate();
    let writer = subtasks.find(|(_, subtask)| {
        let mut outputs = subtask.outputs.iter();
        outputs.any(|port| port.topic == topic.topic())
    });
    let role = match writer {
        Some((_, writer)) if writer.inputs.is_empty() => Role::Source,
        _ => Role::Result,
    };
    (writer.map_or(0, |(number, _)| number), role)
}

/// What sends the recorded value of a job to a topic.
type Replayed = Box<dyn FnMut(u64) + Send>;

impl<T: Recordable> RecordedTopic<T> {
    pub(crate) fn new(topic: &str, edge: &'static Edge) -> Self {
        Self {
            topic: topic.into(),
            line: Arc::new(Line::new(edge)),
            of: PhantomData,
        }
    }
}

impl<T: Message + Recordable> AnyLatest for RecordedTopic<T> {
    fn topic(&self) -> &str {
        &self.topic
    }

    fn port(&self) -> TopicPort {
        MessageType::of::<T>().port(&self.topic)
    }

    /// The tap, which is a reader.
    fn samplers(&self) -> usize {
        1
    }

    fn stages(&self) -> Box<dyn Any> {
        let line = Arc::clone(&self.line);
        // The tap of a topic looks at each value on its way.
        let tap = |mut to: Publisher<T>| {
            Publisher::by_way_of(move |job, value: T| {
                line.stage::<T>(job, |out| value.encode(out));
                to.send(job, value);
            })
        };
        let wrap: Wrap<T> = (self.line.is_open()).then(|| Box::new(tap) as _);
        Box::new(wrap)
    }

    fn effects(&self) -> Vec<Box<dyn Effect>> {
        let effect = self.line.is_open().then(|| self.line.effect());
        effect.into_iter().collect()
    }
}

impl<T: Message + Recordable> AnyRecorded for RecordedTopic<T> {
    fn edge(&self) -> &'static Edge {
        self.line.edge
    }

    fn line(&self) -> (Schema, Arc<Line>) {
        (T::schema(), Arc::clone(&self.line))
    }

    fn replayed(&self, ports: &mut Ports<'_>) -> Replayed {
        let (mut publisher, line) = (ports.publisher::<T>(), Arc::clone(&self.line));
        Box::new(move |job| {
            let mut value = None;
            (line.edge.replay)(line.number(), job, &mut |bytes| {
                value = T::from_bytes(bytes).ok();
            });
            match value {
                Some(value) => publisher.send(job, value),
                None => panic!("the recording has no value of this job, or one of another type"),
            }
        })
    }

    fn probe(
        &self,
        latest: &dyn Any,
        sampler: usize,
    ) -> Option<(Arc<dyn Probe>, Schema, Arc<Line>)> {
        let shared = latest.downcast_ref::<SharedLatest<T>>()?;
        let line = Arc::new(Line::new(self.line.edge));
        let probe: Arc<dyn Probe> = Arc::new(SampleProbe::<T> {
            line: Arc::clone(&line),
            job: AtomicU64::new(0),
            of: PhantomData,
        });
        shared.set_probe(sampler, Arc::clone(&probe));
        Some((probe, Sample::<T>::schema(), line))
    }
}

/// A source that is not called.
struct ReplayedSource(Vec<Replayed>);

impl Subtask for ReplayedSource {
    fn take_turn(&mut self, job: u64) {
        self.0.iter_mut().for_each(|send| send(job));
    }

    fn discard(&mut self, _job: u64) {}

    // It has no function.
    fn forget(self: Box<Self>) {}
}

/// A sample as it is written down: its job, when that was complete, and the value.
type Sample<T> = Option<(u64, u64, T)>;

/// The probe of a subtask that samples values of this type.
struct SampleProbe<T> {
    line: Arc<Line>,
    /// The job whose instance runs.
    job: AtomicU64,
    of: PhantomData<fn() -> T>,
}

impl<T: Recordable + 'static> Probe for SampleProbe<T> {
    fn begin(&self, job: u64) {
        self.job.store(job, Ordering::Relaxed);
    }

    fn replay(&self, slot: &dyn Any) -> bool {
        let mut found = None;
        let job = self.job.load(Ordering::Relaxed);
        (self.line.edge.replay)(self.line.number(), job, &mut |bytes| {
            found = Sample::<T>::from_bytes(bytes).ok();
        });
        let slot = slot.downcast_ref::<Slot<T>>();
        let Some((found, mut slot)) = found.zip(slot.and_then(Slot::change)) else {
            return false;
        };
        *slot = found.map(|(job, completed_ns, value)| Entry {
            value,
            job,
            completed_ns,
        });
        true
    }

    fn look_at(&self, slot: &dyn Any) {
        let slot = slot.downcast_ref::<Slot<T>>();
        let Some(sample) = slot.and_then(Slot::look) else {
            return;
        };
        let job = self.job.load(Ordering::Relaxed);
        self.line.stage::<Sample<T>>(job, |out| {
            // As an `Option` of a tuple is written.
            sample.is_some().encode(out);
            if let Some(entry) = &*sample {
                (entry.job, entry.completed_ns).encode(out);
                entry.value.encode(out);
            }
        });
    }
}

/// Puts something around a body.
type Around = Box<dyn FnOnce(Body) -> Body>;

/// Has a subtask look for something before each turn, and the line give away what it has found.
fn looking(line: Arc<Line>, look: impl Fn(u64) + Send + 'static) -> Around {
    let found: Box<dyn Effect> = Box::new(Found(line));
    let look = move |job| {
        look(job);
        true
    };
    Box::new(|body| {
        let mut body = body.before(look);
        body.add_effects([found]);
        body
    })
}

/// The number of a channel while it has none.
const NO_CHANNEL: u16 = u16::MAX;

/// What those share who write a channel's values, publish them, or replay them.
pub(crate) struct Line {
    number: AtomicU16,
    pub(super) edge: &'static Edge,
    /// Whether the platform reads the values; else it is given each.
    is_read: AtomicBool,
    /// Where the values are written, if anybody wants them.
    outbox: SetOnce<Outbox>,
}

impl Line {
    pub(super) const fn new(edge: &'static Edge) -> Self {
        Self {
            number: AtomicU16::new(NO_CHANNEL),
            edge,
            is_read: AtomicBool::new(false),
            outbox: SetOnce::new(),
        }
    }

    /// Reports whether the channel has a number, for else nobody wants its values.
    pub(super) fn is_open(&self) -> bool {
        self.number() != NO_CHANNEL
    }

    /// Returns the number of the channel.
    pub(super) fn number(&self) -> u16 {
        self.number.load(Ordering::Relaxed)
    }

    pub(super) fn set_number(&self, number: u16) {
        self.number.store(number, Ordering::Relaxed);
    }

    /// Notes whether the platform reads the values, which have at least so many bytes.
    pub(super) fn open(&self, is_read: bool, least_bytes: usize) {
        self.is_read.store(is_read, Ordering::Relaxed);
        if !is_read && let Some((outbox, _)) = outbox(words_of(room_for(least_bytes))) {
            // The commit, which comes once, does this or the other.
            let _ = self.outbox.set(outbox);
        }
    }

    /// Returns what the writer's completion does.
    pub(super) fn effect(self: &Arc<Self>) -> Box<dyn Effect> {
        match self.is_read.load(Ordering::Relaxed) {
            true => Box::new(Publishing(Arc::clone(self))),
            false => Box::new(Giving(Arc::clone(self))),
        }
    }

    /// Returns what reads the values, which have at least so many bytes, from a place of so many
    /// words, or more where that would hold too few of them; `None`: there is no memory. If values
    /// are given, also what whoever takes them puts them into.
    pub(crate) fn reader(
        &self,
        words: usize,
        least_bytes: usize,
    ) -> Option<(OutboxReader, Option<Outbox>)> {
        // Half of it is in one piece, wherever the next value comes.
        let least = 2 * words_of(room_for(least_bytes)) + 1;
        let (outbox, reader) = outbox(words.max(least))?;
        if !self.is_read.load(Ordering::Relaxed) {
            return Some((reader, Some(outbox)));
        }
        let _ = self.outbox.set(outbox);
        Some((reader, None))
    }

    /// Writes the value of an instance that is not complete.
    #[inline(always)]
    pub(super) fn stage<T: Recordable>(&self, job: u64, write: impl Fn(&mut Encoder<'_>)) {
        if let Some(outbox) = self.outbox.get() {
            let most = const { room_for(T::LEAST_BYTES) };
            outbox.stage(job, most, |bytes| {
                let mut out = Encoder::new(bytes);
                write(&mut out);
                out.finish()
            });
        }
    }

    /// Lets the reader have the value, if there is one: its instance is complete.
    #[inline(always)]
    fn publish(&self, completed_ns: u64) {
        if let Some(outbox) = self.outbox.get()
            && !outbox.publish(completed_ns)
        {
            self.show(completed_ns, self.edge.record);
        }
    }

    /// Gives what is there to the platform: the value, or that it had no room.
    #[inline(never)]
    pub(crate) fn show(&self, completed_ns: u64, take: impl FnOnce(&Recorded<'_>)) {
        if let Some(outbox) = self.outbox.get() {
            outbox.show(|job, bytes| {
                take(&Recorded {
                    channel: self.number(),
                    job,
                    completed_ns,
                    bytes,
                });
            });
        }
    }

    /// Publishes or gives the value, whichever it is.
    pub(super) fn give(&self, completed_ns: u64) {
        self.end(completed_ns, self.edge.record);
    }

    /// Publishes the value, or gives it to that, as what has no room to be published.
    pub(crate) fn end(&self, at_ns: u64, take: impl FnOnce(&Recorded<'_>)) {
        let is_read = self.is_read.load(Ordering::Relaxed);
        if !is_read || !(self.outbox.get()).is_some_and(|outbox| outbox.publish(at_ns)) {
            self.show(at_ns, take);
        }
    }
}

/// Lets the reader have a value.
struct Publishing(Arc<Line>);

impl Effect for Publishing {
    // Compiled with the app: this crate's own code is compiled for size.
    #[inline]
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.publish(completed_ns);
    }
}

/// Gives a value to the platform.
struct Giving(Arc<Line>);

impl Effect for Giving {
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.show(completed_ns, self.0.edge.record);
    }
}

/// Publishes or gives what an instance has found, also if it has failed: without that nobody
/// could compute its fault again.
pub(super) struct Found(pub(super) Arc<Line>);

impl Effect for Found {
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.give(completed_ns);
    }

    fn fail(&mut self, failed_ns: u64) {
        self.0.give(failed_ns);
    }
}

/// A state that is written down, of whatever type.
pub(crate) trait AnyState: Send + Sync {
    fn schema(&self) -> Schema;

    /// Writes down what it is now, unless somebody changes it.
    fn stage(&self, line: &Line, job: u64);

    /// Makes it what was written down; `false`: it cannot be.
    fn restore(&self, bytes: &[u8]) -> bool;
}

/// A state that is written down, and how often.
pub(crate) struct KeptState {
    pub(crate) state: Arc<dyn AnyState>,
    /// It is written down in each job whose number is a multiple of that.
    every: AtomicU32,
}

impl KeptState {
    pub(crate) fn new(state: Arc<dyn AnyState>, every: u32) -> Self {
        Self {
            state,
            every: AtomicU32::new(every.max(1)),
        }
    }

    /// Writes it down, if that is due in the job.
    pub(super) fn keep(&self, line: &Line, job: u64) {
        if job.is_multiple_of(self.every.load(Ordering::Relaxed).into()) {
            self.state.stage(line, job);
        }
    }

    /// Has it written down every so many jobs, if that is more often.
    pub(crate) fn keep_every(&self, jobs: u32) {
        self.every.fetch_min(jobs.max(1), Ordering::Relaxed);
    }
}

/// The line of a channel of a plan, and of which subtask it is.
pub(crate) struct LineOf {
    pub(crate) dag: DagId,
    pub(crate) subtask: usize,
    pub(crate) role: Role,
    pub(crate) line: Arc<Line>,
    /// The state whose values they are, if they are of one.
    pub(crate) state: Option<Arc<KeptState>>,
}

impl LineOf {
    /// Reports whether it has what an instance has found: samples, or a state.
    pub(crate) fn is_found_by(&self, instance: Instance) -> bool {
        let of = (self.dag, self.subtask);
        !self.role.is_written() && of == (instance.dag, instance.subtask.index())
    }
}

impl fmt::Debug for LineOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("LineOf")
    }
}

/// The least room for a value.
const ROOM: usize = 4096;

/// A value that a recorded topic gives to the platform, when its writer's instance is complete.
///
/// ```
/// fn show(value: &fass::Recorded<'_>) {
///     match value.bytes {
///         Some(bytes) => println!("channel {}, job {}: {bytes:?}", value.channel, value.job),
///         None => println!("channel {}, job {} is lost", value.channel, value.job),
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'v> {
    /// The number of the channel ([`Platform::open_channels`](crate::Platform::open_channels)).
    pub channel: u16,
    /// The job.
    pub job: u64,
    /// When the instance was complete, on the clock of [`crate::now_ns`].
    pub completed_ns: u64,
    /// The value; `None` if there was no room for it.
    pub bytes: Option<&'v [u8]>,
}

/// The way from a topic to the platform, and back. What a commit does about recorded topics is
/// reached through them only, so that an image without any has no code for it.
pub(crate) struct Edge {
    /// Reports whether anything is recorded or replayed.
    pub(crate) crosses: fn() -> bool,
    /// Reports whether that is so of what other subtasks than sources write, too.
    pub(crate) has_results: fn() -> bool,
    /// Takes the recorded topics of a DAG, and the hash of its graph. Reports whether the plan's
    /// taker will read the values; else they are given to it.
    pub(crate) open: fn(DagId, u64, &[Channel]) -> bool,
    /// Takes a value.
    pub(crate) record: fn(&Recorded<'_>),
    /// Reports whether there is a replay.
    pub(crate) replays: fn() -> bool,
    /// Lends a value, if there is one.
    pub(crate) replay: Lend,
}

/// Lends the value of a channel and a job.
type Lend = fn(u16, u64, &mut dyn FnMut(&[u8]));

/// Returns the room for a value of at least so many bytes.
pub(crate) const fn room_for(least_bytes: usize) -> usize {
    match 2 * least_bytes {
        room if room > ROOM => room,
        _ => ROOM,
    }
}
