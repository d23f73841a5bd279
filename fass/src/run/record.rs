//! A recorded topic: what writes its values down, and what gives them back in a replay.
//!
//! Such a topic has a reader of its own, the *tap*. It takes no value but looks at it, when the
//! writer's function has returned, and writes it into a buffer; the writer's completion gives
//! the buffer to the platform. In a replay the body of a source is another one, which asks the
//! platform for the values of the job, and sends them.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::marker::PhantomData;
use core::mem;
use core::sync::atomic::{AtomicU16, Ordering};

use recording::{Channel, Encoder, Full, Recordable, Role, Schema};
use sched_dag::lifecycle::Request;
use sched_dag::wcets::graph_hash;
use sched_dag::{DagId, DagSpec, TopicPort};

use super::cell::Shared;
use super::crossing::{Edge, Recorded, room_of};
use super::effect::Effect;
use super::latest::{AnyLatest, SharedLatest, Stage};
use super::message::{Message, MessageType};
use super::plan::{Body, Subtask};
use super::sample::{self, SampleLine, SampledBy};
use super::sampling;
use super::topic::{Ports, Publisher, Wiring};

/// A recorded topic while DAGs are built.
pub(crate) struct RecordedTopic<T> {
    topic: String,
    line: Arc<Line>,
    of: PhantomData<fn() -> T>,
}

/// A recorded topic of whatever type.
pub(crate) trait AnyRecorded {
    fn topic(&self) -> &str;

    fn edge(&self) -> &'static Edge;

    /// Takes the number of the channel, and returns the type of its values.
    fn open(&self, number: u16) -> Schema;

    /// Returns what sends recorded values, in the place of the writer's next output port.
    fn replayed(&self, ports: &mut Ports<'_>) -> Box<dyn Replayed>;

    /// Sets a probe for samples of the topic, and returns the type of the samples, and the
    /// probe's line; none if the latest value is of another type.
    fn probe(&self, latest: &dyn AnyLatest, sampler: usize) -> Option<(Schema, Arc<SampleLine>)>;

    /// Numbers all recorded topics of a DAG, and what its subtasks sample of such topics, and
    /// tells the platform. Returns the lines of the samples, with their subtasks.
    fn open_all(
        &self,
        all: &[Rc<dyn AnyRecorded>],
        samples: &[Sampled],
        (dag, spec): (DagId, &DagSpec),
        next: &mut usize,
    ) -> Vec<(usize, Arc<SampleLine>)> {
        if !(self.edge().crosses)() {
            return Vec::new();
        }
        let number = || {
            *next += 1;
            narrow(*next - 1)
        };
        let numbers = core::iter::repeat_with(number);
        let has_results = (self.edge().has_results)();
        let written = all.iter().map(|topic| (topic, writer(&**topic, spec)));
        let written = written.filter(|(_, (_, role))| has_results || *role != Role::Result);
        let mut channels: Vec<Channel> = (written.zip(numbers))
            .map(|((topic, (subtask, role)), number)| Channel {
                dag: narrow(dag.index()),
                subtask,
                role,
                topic: topic.topic().into(),
                schema: topic.open(number),
            })
            .collect();
        let mut lines = Vec::new();
        for Sampled {
            subtask,
            latest,
            sampler,
            of,
        } in samples
        {
            if let Some((schema, line)) = of.probe(&**latest, *sampler) {
                line.set_number(narrow(*next));
                *next += 1;
                lines.push((*subtask, line));
                channels.push(Channel {
                    dag: narrow(dag.index()),
                    subtask: narrow(*subtask),
                    role: Role::Sample,
                    topic: latest.topic().into(),
                    schema,
                });
            }
        }
        if !channels.is_empty() {
            (self.edge().open)(dag, graph_hash(spec), &channels);
        }
        lines
    }

    /// Lets the bodies of sampling subtasks tell their lines which job they run, and notes who
    /// they are.
    fn attach(
        &self,
        lines: Vec<(usize, Arc<SampleLine>)>,
        bodies: (DagId, &mut Vec<Body>),
        samplers: &mut Vec<SampledBy>,
    ) {
        sampling::attach(lines, bodies, samplers);
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
        let outputs = source.outputs.iter().map(|port| match find(&port.topic) {
            Some(recorded) => recorded.replayed(&mut ports),
            None => Box::new(NotRecorded(port.topic.clone())) as Box<dyn Replayed>,
        });
        Some(Body::new(Box::new(ReplayedSource(outputs.collect()))))
    }
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
fn writer(topic: &dyn AnyRecorded, spec: &DagSpec) -> (u16, Role) {
    let mut subtasks = spec.subtasks.iter().enumerate();
    let writer = subtasks.find(|(_, subtask)| {
        let mut outputs = subtask.outputs.iter();
        outputs.any(|port| port.topic == topic.topic())
    });
    let role = match writer {
        Some((_, writer)) if writer.inputs.is_empty() => Role::Source,
        _ => Role::Result,
    };
    (narrow(writer.map_or(0, |(number, _)| number)), role)
}

/// What sends recorded values to a topic.
pub(crate) trait Replayed: Send {
    fn send(&mut self, job: u64);
}

/// The number of a topic's channel while it has none.
const NO_CHANNEL: u16 = u16::MAX;

/// What the tap, the completion and a replay of a topic share.
struct Line {
    number: AtomicU16,
    edge: &'static Edge,
    room: Shared<Room>,
}

/// The value of an instance that is not complete yet.
struct Room {
    bytes: Vec<u8>,
    /// Its job; [`NO_JOB`]: there is none.
    job: u64,
    /// How many bytes it has; more than there are: it did not fit.
    length: usize,
}

/// Stands where a job's number does, for none: no run gets so far.
const NO_JOB: u64 = u64::MAX;

impl<T: Recordable> RecordedTopic<T> {
    pub(crate) fn new(topic: &str, edge: &'static Edge) -> Self {
        Self {
            topic: topic.into(),
            line: Arc::new(Line {
                number: AtomicU16::new(NO_CHANNEL),
                edge,
                room: Shared::new(Room {
                    bytes: Vec::new(),
                    job: NO_JOB,
                    length: 0,
                }),
            }),
            of: PhantomData,
        }
    }
}

impl Line {
    /// Reports whether values of the topic are of interest.
    fn is_open(&self) -> bool {
        self.number.load(Ordering::Relaxed) != NO_CHANNEL
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
        let tap = || Box::new(Tap(Arc::clone(&self.line))) as Box<dyn Stage<T>>;
        let tap = self.line.is_open().then(tap);
        Box::new(Vec::from_iter(tap))
    }

    fn effects(&self) -> Vec<Box<dyn Effect>> {
        let tap = || Box::new(Tap(Arc::clone(&self.line))) as Box<dyn Effect>;
        self.line.is_open().then(tap).into_iter().collect()
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl<T: Message + Recordable> AnyRecorded for RecordedTopic<T> {
    fn topic(&self) -> &str {
        &self.topic
    }

    fn edge(&self) -> &'static Edge {
        self.line.edge
    }

    fn open(&self, number: u16) -> Schema {
        self.line.number.store(number, Ordering::Relaxed);
        if let Some(mut room) = self.line.room.change() {
            room.bytes.resize(room_of::<T>(), 0);
        }
        T::schema()
    }

    fn replayed(&self, ports: &mut Ports<'_>) -> Box<dyn Replayed> {
        Box::new(Source {
            publisher: ports.publisher::<T>(),
            line: Arc::clone(&self.line),
        })
    }

    fn probe(&self, latest: &dyn AnyLatest, sampler: usize) -> Option<(Schema, Arc<SampleLine>)> {
        let shared = latest.as_any().downcast_ref::<SharedLatest<T>>()?;
        Some(sample::probe(shared, sampler, self.line.edge))
    }
}

/// The tap of a topic: the reader that looks, and what the completion does.
struct Tap(Arc<Line>);

impl Tap {
    /// Claims the room. Only the writer's body uses it, which is `&mut` there.
    #[inline]
    fn change(&self, change: impl FnOnce(&mut Room)) {
        if let Some(mut room) = self.0.room.change() {
            change(&mut room);
        }
    }
}

impl<T: Recordable> Stage<T> for Tap {
    fn looks_at(&mut self, job: u64, value: &T) -> bool {
        self.change(|room| {
            let mut out = Encoder::new(&mut room.bytes);
            value.encode(&mut out);
            let (Ok(length) | Err(Full { needed: length })) = out.finish();
            (room.job, room.length) = (job, length);
        });
        true
    }

    fn stage(&mut self, _job: u64, _value: T) {}
}

impl Effect for Tap {
    // Compiled with the app: this crate's own code is compiled for size.
    #[inline]
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.change(|room| {
            let job = mem::replace(&mut room.job, NO_JOB);
            if job != NO_JOB {
                (self.0.edge.record)(&Recorded {
                    channel: self.0.number.load(Ordering::Relaxed),
                    job,
                    completed_ns,
                    bytes: room.bytes.get(..room.length),
                });
            }
        });
    }
}

/// Sends recorded values.
struct Source<T> {
    publisher: Publisher<T>,
    line: Arc<Line>,
}

impl<T: Message + Recordable> Replayed for Source<T> {
    fn send(&mut self, job: u64) {
        let mut value = None;
        let number = self.line.number.load(Ordering::Relaxed);
        (self.line.edge.replay)(number, job, &mut |bytes| value = T::from_bytes(bytes).ok());
        match value {
            Some(value) => self.publisher.send(job, value),
            None => panic!("the recording has no value of this job, or one of another type"),
        }
    }
}

/// An output of a source that is replayed, and is not recorded.
struct NotRecorded(String);

impl Replayed for NotRecorded {
    fn send(&mut self, _job: u64) {
        panic!(
            "topic `{topic}` is not recorded, and another one of the source is; add \
             `dag.record::<T>(\"{topic}\")`, and record again",
            topic = self.0
        );
    }
}

/// A source that is not called.
struct ReplayedSource(Vec<Box<dyn Replayed>>);

impl Subtask for ReplayedSource {
    fn take_turn(&mut self, job: u64) {
        self.0.iter_mut().for_each(|output| output.send(job));
    }

    fn discard(&mut self, _job: u64) {}
}
