//! The two ends of a topic in its subtasks, and how the commit ties them together.
//!
//! A [`Publisher`] is the writing end of a topic. It owns a writer for each edge leaving the topic
//! (there is an edge for each reading port), and a place for each subtask sampling the topic's
//! latest value. If the topic is recorded, a *tap* looks at each value first. A [`Subscriber`] is
//! one reading port. At the commit, [`DagWiring`] hands out the ends: the first request for either
//! end of an edge makes the ring, and leaves the other end for the second request. All rings exist
//! before the first release, so no job can be missed because its reader was not there yet.
//!
//! The verification has already compared the types of both ends; the downcast in [`DagWiring`]
//! relies on it.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::vec::Vec;
use core::any::Any;

use sched_dag::{DagSpec, Wait, sorted_by_key};

use super::cell::{Reader, Writer, ring};
use super::latest::{AnyLatest, Stage};
use super::message::Message;

/// The reading end of a topic in one subtask. Made by the commit only.
///
/// ```
/// use fass::{Subscriber, Subscribers, VecToSubs};
///
/// fn same<T>(_: fn(T), _: fn(T)) {}
/// same::<<(i32,) as VecToSubs>::Subs>(|_| (), |_: Subscribers<(Subscriber<i32>,)>| ());
/// ```
pub struct Subscriber<T>(Reader<T>);

impl<T> Subscriber<T> {
    /// Takes the value of `job`.
    ///
    /// # Panics
    ///
    /// If the value is not there: the platform started the instance before a predecessor was
    /// complete.
    #[inline]
    pub(crate) fn recv(&mut self, job: u64) -> T {
        self.0.take(job).unwrap_or_else(|| missing(job))
    }

    /// Gives up the value of `job` if it has arrived.
    pub(crate) fn discard(&mut self, job: u64) {
        self.0.give_up(job);
    }
}

/// The writing end of a topic in its single writer. Made by the commit only.
///
/// ```
/// use fass::{Publisher, Publishers, VecToPubs};
///
/// fn same<T>(_: fn(T), _: fn(T)) {}
/// same::<<(i32,) as VecToPubs>::Pubs>(|_| (), |_: Publishers<(Publisher<i32>,)>| ());
/// ```
pub struct Publisher<T>(PublisherKind<T>);

enum PublisherKind<T> {
    /// To the only reading port, if nobody else reads the topic.
    One(Writer<T>),
    /// To any number of readers, or through a relay looking at the values.
    Other(Box<dyn Relay<T>>),
}

/// A relay of values on their way to a topic's readers.
pub(super) trait Relay<T>: Send + Sync {
    fn send(&mut self, job: u64, value: T);
}

/// A function putting a relay between a writer and its readers.
pub(super) type Wrap<T> = Option<Box<dyn FnOnce(Publisher<T>) -> Publisher<T>>>;

/// Any number of readers.
struct FanOut<T> {
    /// A writer for each reading port.
    writers: Box<[Writer<T>]>,
    /// A place for each subtask sampling the topic's latest value.
    stages: Box<[Box<dyn Stage<T>>]>,
}

impl<T: Message> Publisher<T> {
    fn new(mut writers: Vec<Writer<T>>, stages: Box<[Box<dyn Stage<T>>]>) -> Self {
        // The usual case, a single reader, pays for no indirect call.
        if stages.is_empty()
            && writers.len() == 1
            && let Some(writer) = writers.pop()
        {
            return Self(PublisherKind::One(writer));
        }
        let writers = writers.into();
        Self::by_way_of(FanOut { writers, stages })
    }

    pub(super) fn by_way_of(relay: impl Relay<T> + 'static) -> Self {
        Self(PublisherKind::Other(Box::new(relay)))
    }

    /// Hands the value of `job` to every reader: clones to all but the last, and the value itself
    /// to the last. For a subtask sampling the latest value, the value is only prepared, and shows
    /// at the completion.
    ///
    /// # Panics
    ///
    /// If no slot is free: the platform cancelled an instance without discarding its inputs, or let
    /// more jobs be in flight than the plan permits.
    #[inline]
    pub(crate) fn send(&mut self, job: u64, value: T) {
        match &mut self.0 {
            PublisherKind::One(writer) => put(writer, job, value),
            PublisherKind::Other(relay) => relay.send(job, value),
        }
    }
}

impl<T: Message> Relay<T> for FanOut<T> {
    fn send(&mut self, job: u64, value: T) {
        // For a type returning `None`, the commit refuses several readers.
        let stage = |stage: &mut Box<dyn Stage<T>>| {
            if let Some(clone) = value.for_another_reader() {
                stage.stage(job, clone);
            }
        };
        // The value itself goes to the last reader, so a single reader costs no clone.
        if let Some((last, others)) = self.writers.split_last_mut() {
            // Before the value is moved away.
            for part in &mut self.stages {
                stage(part);
            }
            for writer in others {
                if let Some(clone) = value.for_another_reader() {
                    put(writer, job, clone);
                }
            }
            put(last, job, value);
        } else if let Some((last, others)) = self.stages.split_last_mut() {
            for part in others {
                stage(part);
            }
            last.stage(job, value);
        }
    }
}

// Always, like `Writer::put`.
#[inline(always)]
fn put<T>(writer: &mut Writer<T>, job: u64, value: T) {
    if writer.put(job, value).is_err() {
        no_free_slot(job);
    }
}

#[cold]
fn missing(job: u64) -> ! {
    panic!(
        "an input of job {job} is missing: the platform started the instance before all \
         its predecessors were complete"
    )
}

#[cold]
fn no_free_slot(job: u64) -> ! {
    panic!(
        "an output of job {job} finds no free slot: the platform cancelled an instance \
         without discarding its inputs, or exceeded the jobs in flight"
    )
}

/// The message of an edge between untyped subtasks: the predecessor's instance is complete.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Token;

/// The edges of a DAG while the commit ties them.
pub(crate) struct DagWiring {
    /// The number of slots of every ring.
    in_flight: usize,
    /// For each edge, the end made but not yet requested.
    ends: Vec<Option<Box<dyn Any>>>,
    /// The edges with their topics, by topic and in the order of the reading ports.
    edges_by_topic: Vec<(String, usize)>,
    /// For each subtask, the edges of its input ports.
    edges_of_inputs: Vec<Vec<usize>>,
    /// For each subtask, the topics of its output ports.
    outputs: Vec<Vec<String>>,
    /// For each subtask, the edges carrying tokens to it.
    tokens_to: Vec<Vec<usize>>,
    /// For each subtask, the edges carrying tokens from it.
    tokens_from: Vec<Vec<usize>>,
    /// For each latest value, its topic and the places written by its writer, a `Vec<Box<dyn
    /// Stage<T>>>`; or a function putting a relay in between, a [`Wrap<T>`].
    stages: Vec<(String, Box<dyn Any>)>,
    /// For each subtask, its waits.
    waits: Vec<Vec<Wait>>,
}

impl DagWiring {
    /// Numbers the edges of a verified DAG: first one for each reading port, then those between
    /// untyped subtasks.
    pub(crate) fn new(spec: &DagSpec, latest: &[Rc<dyn AnyLatest>], in_flight: usize) -> Self {
        let mut topics = Vec::new();
        let mut edges_of_inputs = Vec::with_capacity(spec.subtasks.len());
        for subtask in &spec.subtasks {
            let first = topics.len();
            topics.extend(subtask.inputs.iter().map(|port| &port.topic));
            edges_of_inputs.push((first..topics.len()).collect());
        }
        // A stable sort: the readers of a topic stay in the order of their registration.
        let by_topic = sorted_by_key(topics.len(), |edge| topics[edge]).into_iter();
        let edges_by_topic = by_topic.map(|edge| (topics[edge].clone(), edge)).collect();
        let outputs = spec
            .subtasks
            .iter()
            .map(|subtask| subtask.outputs.iter().map(|port| port.topic.clone()))
            .map(Iterator::collect)
            .collect();
        let none = || alloc::vec![Vec::new(); spec.subtasks.len()];
        let (mut tokens_to, mut tokens_from) = (none(), none());
        for (edge, &(earlier, later)) in (topics.len()..).zip(&spec.edges) {
            tokens_to[later].push(edge);
            tokens_from[earlier].push(edge);
        }
        let edges = topics.len() + spec.edges.len();
        Self {
            in_flight,
            ends: (0..edges).map(|_| None).collect(),
            edges_by_topic,
            edges_of_inputs,
            outputs,
            tokens_to,
            tokens_from,
            stages: (latest.iter())
                .map(|latest| (latest.topic().into(), latest.stages()))
                .collect(),
            waits: (spec.subtasks.iter())
                .map(|subtask| subtask.waits.to_vec())
                .collect(),
        }
    }

    /// Returns the stated waits of a subtask.
    pub(crate) fn waits(&self, subtask: usize) -> &[Wait] {
        self.waits.get(subtask).map_or(&[], Vec::as_slice)
    }

    /// Returns the ends of the edges to and from an untyped subtask. Compiled with the app to make
    /// its sending fast: this crate's own code is compiled for size.
    #[inline]
    pub(crate) fn tokens(&mut self, subtask: usize) -> (Vec<Subscriber<Token>>, Publisher<Token>) {
        let to = core::mem::take(&mut self.tokens_to[subtask]);
        let from = core::mem::take(&mut self.tokens_from[subtask]);
        let readers = to.into_iter().map(|edge| Subscriber(self.reader(edge)));
        let readers = readers.collect();
        let writers = from.into_iter().map(|edge| self.writer(edge)).collect();
        let publisher = Publisher::new(writers, Box::default());
        (readers, publisher)
    }

    /// Returns the ends of subtask number `subtask`, to be taken port by port.
    pub(crate) fn ports<'w>(&'w mut self, subtask: usize) -> Ports<'w> {
        Ports {
            wiring: self,
            subtask,
            next: 0,
        }
    }

    /// Makes the end of a topic leading to these readers.
    fn publisher<T: Message>(&mut self, topic: &str, writers: Vec<Writer<T>>) -> Publisher<T> {
        let mut found = Vec::new();
        let of_topic = self.stages.iter_mut().filter(|(of, _)| of == topic);
        let mut wrap = None;
        for (_, any) in of_topic {
            // A latest value, or the tap of a recorded topic: only the type tells which.
            if let Some(stages) = any.downcast_mut::<Vec<Box<dyn Stage<T>>>>() {
                found.append(stages);
            } else if let Some(found) = any.downcast_mut::<Wrap<T>>() {
                // The tap of a recorded topic comes before all readers, so there is only one.
                wrap = found.take();
            }
        }
        let publisher = Publisher::new(writers, found.into());
        match wrap {
            Some(wrap) => wrap(publisher),
            None => publisher,
        }
    }

    fn reader<T: Message>(&mut self, edge: usize) -> Reader<T> {
        if let Some(end) = self.ends[edge].take() {
            return *end.downcast().expect("the verification compared the types");
        }
        let (writer, reader) = ring::<T>(self.in_flight);
        self.ends[edge] = Some(Box::new(writer));
        reader
    }

    fn writer<T: Message>(&mut self, edge: usize) -> Writer<T> {
        if let Some(end) = self.ends[edge].take() {
            return *end.downcast().expect("the verification compared the types");
        }
        let (writer, reader) = ring::<T>(self.in_flight);
        self.ends[edge] = Some(Box::new(reader));
        writer
    }
}

/// The topic ends of one subtask, taken in order by [`gen_subs`](crate::VecToSubs::gen_subs) and
/// [`gen_pubs`](crate::VecToPubs::gen_pubs). Made by the commit only.
///
/// ```
/// use fass::{Ports, VecToSubs};
///
/// /// What the commit does for a subtask's arguments.
/// fn generate<Args: VecToSubs>(ports: Ports<'_>) -> Args::Subs {
///     Args::gen_subs(ports)
/// }
/// ```
pub struct Ports<'w> {
    wiring: &'w mut DagWiring,
    subtask: usize,
    next: usize,
}

impl Ports<'_> {
    /// Takes the end of the next input port.
    pub(crate) fn subscriber<T: Message>(&mut self) -> Subscriber<T> {
        let edge = self.wiring.edges_of_inputs[self.subtask][self.next];
        self.next += 1;
        Subscriber(self.wiring.reader(edge))
    }

    /// Takes the end of the next output port.
    pub(crate) fn publisher<T: Message>(&mut self) -> Publisher<T> {
        let topic = &self.wiring.outputs[self.subtask][self.next].clone();
        self.next += 1;
        let all = &self.wiring.edges_by_topic;
        // The edges are sorted by topic, so the edges of one topic lie together.
        let first = all.partition_point(|(other, _)| other < topic);
        let of_topic = all[first..].iter().take_while(|(other, _)| other == topic);
        let edges: Vec<usize> = of_topic.map(|(_, edge)| *edge).collect();
        let writers = edges.iter().map(|&e| self.wiring.writer(e)).collect();
        self.wiring.publisher(topic, writers)
    }
}
