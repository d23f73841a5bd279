//! A recorded topic: what writes its values down, and what gives them back in a replay.
//!
//! Such a topic has a *tap* between its writer and its readers. It looks at each value when the
//! writer's function has returned, and writes it down; the writer's completion lets that go to
//! the platform. In a replay the body of a source is another one, which asks the
//! platform for the values of the job, and sends them.
//!
//! A sample that a subtask takes of such a topic is written down when it looks, and goes to the
//! platform when
//! the instance is complete, or has failed: without it nobody could compute its fault again.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};

use recording::{Channel, Recordable, Role, Schema};
use sched_dag::wcets::graph_hash;
use sched_dag::{DagId, DagSpec, SubtaskId, TopicPort};

use super::answers::AnyDevice;
use super::effect::Effect;
use super::latest::{AnyLatest, LatestEntry, LatestSlot, Probe, SharedLatest};
use super::line::{ChannelState, InstanceOutputs, KeptState, LineOf, TopicEdge};
use super::message::{Message, MessageType};
use super::plan::{PolledSubtask, SubtaskCode};
use super::topic::{DagWiring, Ports, Publisher, Relay, Wrap};
use super::turn::TurnState;

/// A recorded topic while DAGs are built.
pub(crate) struct RecordedTopic<T> {
    topic: String,
    line: Arc<ChannelState>,
    of: PhantomData<fn() -> T>,
}

/// A recorded topic of whatever type.
pub(crate) trait AnyRecorded: AnyLatest {
    fn edge(&self) -> &'static TopicEdge;

    /// Returns the type of its values, and their way.
    fn line(&self) -> (Schema, Arc<ChannelState>);

    /// Returns a sender of recorded values, in the place of the writer's next output port.
    fn replayed(&self, ports: &mut Ports<'_>) -> Replayed;

    /// Sets a probe for samples of the topic, and returns it, with the type of the samples and
    /// their line; none if the latest value is of another type.
    fn probe(
        &self,
        latest: &dyn Any,
        sampler: usize,
    ) -> Option<(Arc<dyn Probe>, Schema, Arc<ChannelState>)>;

    /// Numbers all recorded topics of a DAG, what its subtasks sample of such topics, and its
    /// recorded states, tells the platform, and adds their lines to those before. Returns what is
    /// put around subtasks for that.
    #[allow(
        clippy::too_many_lines,
        reason = "gives numbers in one order, which a reader has to see whole"
    )]
    fn open_all(&self, of: &OfDag<'_>, lines: &mut Vec<LineOf>) -> Vec<(usize, Around)> {
        let (dag, spec) = (of.dag, of.spec);
        // Nobody records or replays: no channel is opened, and no value is copied.
        if !(self.edge().crosses)() {
            return Vec::new();
        }
        let first = lines.len();
        let mut channels = Vec::new();
        let mut open =
            |subtask, role, topic: &str, (schema, line): (Schema, Arc<ChannelState>), state| {
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
            // Where nobody compares results, only inputs are kept.
            if has_results || role != Role::Result {
                open(subtask, role, topic.topic(), topic.line(), None);
            }
        }
        let mut around = Vec::new();
        for sample in of.samples {
            let latest = &*sample.latest;
            // A topic of another type, or one that is not recorded, has no probe.
            if let Some((probe, schema, line)) = sample.of.probe(latest, sample.sampler) {
                let way = (schema, Arc::clone(&line));
                open(sample.subtask, Role::Sample, latest.topic(), way, None);
                let look = move |job| probe.note_job(job);
                around.push((sample.subtask, looking(line, look)));
            }
        }
        for (subtask, device) in of.devices {
            if let Some((schema, line)) = device.line() {
                let way = (schema, Arc::clone(&line));
                open(*subtask, Role::Answer, device.name(), way, None);
                around.push((*subtask, finding(line)));
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
            // The first user that changes it sees it as the job before has left it.
            if let Some(subtask) = subtasks.find(changes) {
                let line = Arc::new(ChannelState::new(self.edge()));
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
        // One call for each DAG, so that the platform sees all its channels together.
        if !channels.is_empty() {
            let is_read = (self.edge().open)(dag, graph_hash(spec), &channels);
            for (of, channel) in lines[first..].iter().zip(&channels) {
                of.line.open(is_read, channel.schema.least_bytes());
            }
        }
        around
    }

    /// Puts these around the bodies of subtasks.
    fn attach(&self, around: Vec<(usize, Around)>, bodies: &mut Vec<SubtaskCode>) {
        let mut all: Vec<Option<SubtaskCode>> =
            core::mem::take(bodies).into_iter().map(Some).collect();
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
        wiring: &mut DagWiring,
        subtask: usize,
    ) -> Option<SubtaskCode> {
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
        let outputs = outputs.collect();
        let turn = Arc::new(TurnState::new(wiring.waits(subtask)));
        Some(SubtaskCode::new(Box::new(ReplayedSource { outputs, turn })))
    }
}

/// A DAG whose topics are recorded.
pub(crate) struct OfDag<'d> {
    pub(crate) dag: DagId,
    pub(crate) spec: &'d DagSpec,
    /// The subtasks, each behind those that it waits for.
    pub(crate) order: &'d [SubtaskId],
    pub(crate) recorded: &'d [Rc<dyn AnyRecorded>],
    pub(crate) samples: &'d [SampledValue],
    /// The devices that its subtasks ask.
    pub(crate) devices: &'d [(usize, Arc<dyn AnyDevice>)],
    /// Its recorded states, by their positions.
    pub(crate) states: &'d [(usize, Arc<KeptState>)],
}

/// A latest value of a recorded topic, as a subtask samples it.
pub(crate) struct SampledValue {
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

    /// The tap, which is a reader.
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
    fn edge(&self) -> &'static TopicEdge {
        self.line.edge
    }

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

/// A source that is not called.
struct ReplayedSource {
    outputs: Vec<Replayed>,
    /// It takes its waits all the same.
    turn: Arc<TurnState>,
}

impl PolledSubtask for ReplayedSource {
    fn take_turn(&mut self, job: u64) {
        if self.turn.pass(job) {
            self.outputs.iter_mut().for_each(|send| send(job));
        }
    }

    fn turn(&self) -> Option<&Arc<TurnState>> {
        Some(&self.turn)
    }

    fn discard(&mut self, _job: u64) {}

    // It has no function.
    fn forget(self: Box<Self>) {}
}

/// A sample as it is written down: its job, when that was complete, and the value.
type FoundSample<T> = Option<(u64, u64, T)>;

/// The probe of a subtask that samples values of this type.
struct SampleProbe<T> {
    line: Arc<ChannelState>,
    /// The job whose instance runs.
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
type Around = Box<dyn FnOnce(SubtaskCode) -> SubtaskCode>;

/// Has a subtask look for something before each turn, and the line give away what it has found.
fn looking(line: Arc<ChannelState>, look: impl Fn(u64) + Send + 'static) -> Around {
    let found = finding(line);
    let look = move |job| {
        look(job);
        true
    };
    Box::new(|body| found(body.before(look)))
}

/// Has the line give away what a subtask finds.
fn finding(line: Arc<ChannelState>) -> Around {
    let found: Box<dyn Effect> = Box::new(InstanceOutputs(line));
    Box::new(|mut body| {
        body.add_effects([found]);
        body
    })
}
