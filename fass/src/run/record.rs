//! A recorded topic: writing its values down, and giving them back in a replay.
//!
//! Where somebody wants its values, a recorded topic has a *tap* between its writer and its
//! readers. The tap looks at each value when the writer's function has returned, and writes the
//! value down; the writer's completion passes the record to the platform. In a replay a source of
//! recorded topics has another body, which asks the platform for the values of the job, and sends
//! them.
//!
//! A sample of such a topic is written down when the subtask takes it, and goes to the platform
//! when the instance is complete, or has failed: without the sample nobody could compute its fault
//! again.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};

use recording::{Recordable, Schema};
use sched_dag::TopicPort;

use super::effect::Effect;
use super::latest::{AnyLatest, LatestEntry, LatestSlot, Probe, SharedLatest};
use super::line::{ChannelState, InstanceOutputs, TopicEdge};
use super::message::{Message, MessageType};
use super::plan::{PolledSubtask, SubtaskCode};
use super::subtask::MakeBody;
use super::topic::{Ports, Publisher, Relay, Wrap};
use super::turn::TurnState;

/// A recorded topic while DAGs are built.
pub(crate) struct RecordedTopic<T> {
    topic: String,
    line: Arc<ChannelState>,
    of: PhantomData<fn() -> T>,
}

/// A recorded topic of any type.
pub(crate) trait AnyRecorded: AnyLatest {
    /// Returns the type of the values, and their line.
    fn line(&self) -> (Schema, Arc<ChannelState>);

    /// Returns a sender of recorded values, in place of the writer's next output port.
    fn replayed(&self, ports: &mut Ports<'_>) -> Replayed;

    /// Sets a probe for samples of the topic. Returns the probe, with the type of the samples and
    /// their line; `None` if the latest value has another type.
    fn probe(
        &self,
        latest: &dyn Any,
        sampler: usize,
    ) -> Option<(Arc<dyn Probe>, Schema, Arc<ChannelState>)>;
}

/// Defers making the body of a source, not called in a replay, until the commit knows the wiring.
pub(crate) fn defer_replayed(outputs: Vec<Rc<dyn AnyRecorded>>) -> MakeBody {
    Box::new(move |wiring, subtask| {
        let turn = Arc::new(TurnState::new(wiring.waits(subtask)));
        let mut ports = wiring.ports(subtask);
        let outputs = outputs.iter().map(|topic| topic.replayed(&mut ports));
        let outputs = outputs.collect();
        SubtaskCode::new(Box::new(ReplayedSource { outputs, turn }))
    })
}

pub(crate) fn narrow(number: usize) -> u16 {
    u16::try_from(number).unwrap_or(u16::MAX)
}

/// Sends the recorded value of a job to a topic.
type Replayed = Box<dyn FnMut(u64) + Send>;

impl<T: Recordable> RecordedTopic<T> {
    pub(crate) fn new(topic: &str, edge: &'static TopicEdge) -> Self {
        Self {
            topic: topic.into(),
            line: Arc::new(ChannelState::new(edge)),
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

    /// Returns 1: the tap is a reader.
    fn samplers(&self) -> usize {
        1
    }

    fn stages(&self) -> Box<dyn Any> {
        let line = Arc::clone(&self.line);
        let tap = |to| Publisher::by_way_of(TopicTap { line, to });
        let wrap: Wrap<T> = (self.line.is_open()).then(|| Box::new(tap) as _);
        Box::new(wrap)
    }

    fn effects(&self) -> Vec<Box<dyn Effect>> {
        let effect = self.line.is_open().then(|| self.line.effect());
        effect.into_iter().collect()
    }
}

impl<T: Message + Recordable> AnyRecorded for RecordedTopic<T> {
    fn line(&self) -> (Schema, Arc<ChannelState>) {
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
    ) -> Option<(Arc<dyn Probe>, Schema, Arc<ChannelState>)> {
        let shared = latest.downcast_ref::<SharedLatest<T>>()?;
        let line = Arc::new(ChannelState::new(self.line.edge));
        let probe: Arc<dyn Probe> = Arc::new(SampleProbe::<T> {
            line: Arc::clone(&line),
            job: AtomicU64::new(0),
            of: PhantomData,
        });
        shared.set_probe(sampler, Arc::clone(&probe));
        Some((probe, FoundSample::<T>::schema(), line))
    }
}

/// The tap of a topic: looks at each value on its way.
struct TopicTap<T> {
    line: Arc<ChannelState>,
    to: Publisher<T>,
}

impl<T: Message + Recordable> Relay<T> for TopicTap<T> {
    fn send(&mut self, job: u64, value: T) {
        // Before the value is moved to its readers.
        self.line.stage::<T>(job, |out| value.encode(out));
        self.to.send(job, value);
    }
}

/// A source that the replay does not call.
struct ReplayedSource {
    outputs: Vec<Replayed>,
    /// The turns of the source, which takes its waits all the same.
    turn: Arc<TurnState>,
}

impl PolledSubtask for ReplayedSource {
    fn take_turn(&mut self, job: u64) {
        // Only in the last turn: values go out at the finish, and not at a wait.
        if self.turn.pass(job) {
            self.outputs.iter_mut().for_each(|send| send(job));
        }
    }

    fn turn(&self) -> Option<&Arc<TurnState>> {
        Some(&self.turn)
    }

    fn discard(&mut self, _job: u64) {}

    // Nothing to leave out: there is no function of the app in here.
    fn forget(self: Box<Self>) {}
}

/// A sample in the recorded format: its job, the completion time of the writer's instance in ns,
/// and the value.
type FoundSample<T> = Option<(u64, u64, T)>;

/// The probe of a subtask sampling values of this type.
struct SampleProbe<T> {
    line: Arc<ChannelState>,
    /// The job of the running instance.
    job: AtomicU64,
    of: PhantomData<fn() -> T>,
}

impl<T: Recordable + 'static> Probe for SampleProbe<T> {
    fn note_job(&self, job: u64) {
        // One instance of the subtask at a time (R2), so this needs no order.
        self.job.store(job, Ordering::Relaxed);
    }

    fn replay(&self, slot: &dyn Any) -> bool {
        let mut found = None;
        let job = self.job.load(Ordering::Relaxed);
        (self.line.edge.replay)(self.line.number(), job, &mut |bytes| {
            found = FoundSample::<T>::from_bytes(bytes).ok();
        });
        let slot = slot.downcast_ref::<LatestSlot<T>>();
        let Some((found, mut slot)) = found.zip(slot.and_then(LatestSlot::change)) else {
            return false;
        };
        *slot = found.map(|(job, completed_ns, value)| LatestEntry {
            value,
            job,
            completed_ns,
        });
        true
    }

    fn look_at(&self, slot: &dyn Any) {
        let slot = slot.downcast_ref::<LatestSlot<T>>();
        let Some(sample) = slot.and_then(LatestSlot::look) else {
            return;
        };
        let job = self.job.load(Ordering::Relaxed);
        self.line.stage::<FoundSample<T>>(job, |out| {
            // In the format of an `Option` of a tuple.
            sample.is_some().encode(out);
            if let Some(entry) = &*sample {
                (entry.job, entry.completed_ns).encode(out);
                entry.value.encode(out);
            }
        });
    }
}

/// A function putting something around a body.
pub(crate) type Around = Box<dyn FnOnce(SubtaskCode) -> SubtaskCode>;

/// Calls `look` before each job's first turn, and has the line pass on the subtask's findings.
pub(crate) fn looking(line: Arc<ChannelState>, look: impl Fn(u64) + Send + 'static) -> Around {
    let found = finding(line);
    let look = move |job| {
        look(job);
        true
    };
    Box::new(|body| found(body.before(look)))
}

/// Has the line pass on a subtask's findings when its instance is complete, or has failed.
pub(crate) fn finding(line: Arc<ChannelState>) -> Around {
    let found: Box<dyn Effect> = Box::new(InstanceOutputs(line));
    Box::new(|mut body| {
        body.add_effects([found]);
        body
    })
}
