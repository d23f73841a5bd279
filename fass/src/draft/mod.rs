//! Drafts: DAGs as registered before their commit.
//!
//! A draft accepts everything and remembers what it could not express as a
//! [`DagSpec`]: durations that do not fit, topic lists that do not fit the
//! function. The commit reports those together with all other faults. So that
//! one mistake is not reported as several, a subtask whose list does not fit
//! keeps its topics in the spec, but with the type [`UnstatedType`], which the commit
//! takes to be whatever the topic's other end says.

pub(crate) mod fault;
pub(crate) mod part;

use alloc::borrow::Cow;
use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

use sched_dag::{
    Activation, DagLabel, DagSpec, LatestSpec, Priority, SubtaskId, SubtaskLabel, SubtaskSpec,
    TopicPort, Wait,
};

use crate::run::effect::{InstanceRequests, RequestKind, RequestTarget, Wish};
use crate::run::latest::AnyLatest;
use crate::run::message::MessageType;
use crate::run::subtask::MakeBody;
use fault::Fault;
use part::{CheckedDag, DraftPart, PartKind};

/// A DAG as registered so far.
#[derive(Default)]
pub(crate) struct DagDraft {
    pub(crate) spec: DagSpec,
    /// One for each of `spec.subtasks`.
    pub(crate) make_bodies: Vec<MakeBody>,
    pub(crate) is_committed: bool,
    /// A source that states a period.
    periodic_source: Option<SubtaskLabel>,
    /// Whether the relative deadline is the DAG's own, rather than its sinks' longest.
    states_deadline: bool,
    /// Whether the commit is to be refused unless the deadlines are proven.
    pub(crate) demands_proof: bool,
    /// Faults that are known but for the label of its DAG.
    pub(crate) flaws: Vec<Box<dyn Fn(DagLabel) -> Fault>>,
    /// All else that it states, in the order of registration.
    pub(crate) parts: Vec<(PartKind, Box<dyn DraftPart>)>,
    /// Which DAG it is, for others that send it signals, or pause it.
    pub(crate) target: Arc<RequestTarget>,
}

/// The topics that a subtask names, and the types of its function.
#[derive(Default)]
pub(crate) struct NamedTopics<'a> {
    pub(crate) inputs: (&'a [&'a str], &'a [MessageType]),
    pub(crate) outputs: (&'a [&'a str], &'a [MessageType]),
}

/// The type of a topic's end that no function states.
#[derive(Clone)]
struct UnstatedType;

impl DagDraft {
    /// Takes what was registered, for the commit, and leaves what handles may still ask for.
    pub(crate) fn close(&mut self) -> Self {
        // What stays answers for the handle: its name in complaints, and where its signals go.
        let committed = Self {
            spec: DagSpec {
                name: self.spec.name.clone(),
                ..DagSpec::default()
            },
            is_committed: true,
            target: Arc::clone(&self.target),
            ..Self::default()
        };
        core::mem::replace(self, committed)
    }

    /// Adds a subtask and returns its label.
    pub(crate) fn register(
        &mut self,
        body: MakeBody,
        ends: NamedTopics<'_>,
        attributes: SubtaskAttributes,
    ) -> SubtaskLabel {
        let (inputs, input_types) = ends.inputs;
        let (outputs, output_types) = ends.outputs;
        self.make_bodies.push(body);
        let subtask = self.next_label(&attributes);
        // Noted, not reported: a commit tells all faults of all DAGs at once.
        if input_types.len() != inputs.len() {
            let subtask = subtask.clone();
            let (expected, given) = (input_types.len(), inputs.len());
            self.flaw(move |dag| Fault::InputArity {
                dag,
                subtask: subtask.clone(),
                expected,
                given,
            });
        }
        if output_types.len() != outputs.len() {
            let subtask = subtask.clone();
            let (expected, given) = (output_types.len(), outputs.len());
            self.flaw(move |dag| Fault::OutputArity {
                dag,
                subtask: subtask.clone(),
                expected,
                given,
            });
        }
        let spec = self.specify(&subtask, attributes);
        self.spec.subtasks.push(SubtaskSpec {
            inputs: ports(inputs, input_types),
            outputs: ports(outputs, output_types),
            ..spec
        });
        subtask
    }

    /// Returns the spec of a subtask by its attributes, without its ports.
    fn specify(&mut self, subtask: &SubtaskLabel, attributes: SubtaskAttributes) -> SubtaskSpec {
        let wcet = attributes.wcet;
        // A duration that does not fit into nanoseconds becomes a fault of the commit, not a panic
        // here.
        let wcet_ns = wcet.and_then(|wcet| self.convert(wcet, Some(subtask), "WCET"));
        let mut waits = alloc::vec![Wait::default(); attributes.waits.len()];
        for (wait, (limit, segment)) in waits.iter_mut().zip(attributes.waits) {
            wait.limit_ns = self.convert(limit, Some(subtask), "wait").unwrap_or(0);
            // Else the WCET of the first segment would pass for a sum of which nothing is known for
            // the segments; the verification refuses 0.
            let segment = segment.or(wcet.map(|_| Duration::ZERO));
            wait.segment_ns = segment.and_then(|wcet| self.convert(wcet, Some(subtask), "WCET"));
        }
        // The sum; where a part is missing, the verification says so.
        let later_ns = waits.iter().filter_map(|wait| wait.segment_ns);
        let wcet_ns = wcet_ns.map(|first_ns| later_ns.fold(first_ns, u64::saturating_add));
        let budget = attributes.budget;
        let budget_ns = budget.and_then(|budget| self.convert(budget, Some(subtask), "budget"));
        SubtaskSpec {
            name: attributes.name,
            wcet_ns,
            waits,
            budget_ns,
            stack_bytes: attributes.stack_bytes,
            priority: attributes.priority.map(Priority),
            non_preemptive: attributes.non_preemptive,
            ..SubtaskSpec::default()
        }
    }

    /// Replaces the period, whatever a source said before.
    pub(crate) fn replace_period(&mut self, period: Duration) {
        let period_ns = self.convert(period, None, "period");
        self.spec.period_ns = period_ns.or(self.spec.period_ns);
    }

    /// States the DAG's own relative deadline.
    pub(crate) fn set_dag_deadline(&mut self, deadline: Duration) {
        if let Some(deadline_ns) = self.convert(deadline, None, "relative deadline") {
            self.spec.relative_deadline_ns = Some(deadline_ns);
            self.states_deadline = true;
        }
    }

    pub(crate) fn set_offset(&mut self, offset: Duration) {
        self.spec.offset_ns = self.convert(offset, None, "offset").unwrap_or(0);
    }

    /// Makes the DAG sporadic, which it cannot be if a source states a period.
    pub(crate) fn set_sporadic(&mut self, min_inter_arrival: Duration) {
        self.spec.activation = Activation::Sporadic;
        // The analysis takes the minimum inter-arrival time for the period.
        self.replace_period(min_inter_arrival);
        if let Some(subtask) = self.periodic_source.clone() {
            self.flaw(move |dag| Fault::ActivationsDiffer {
                dag,
                subtask: subtask.clone(),
            });
        }
    }

    /// States the period of a source, which that of all others must be.
    #[inline(never)]
    pub(crate) fn set_period(&mut self, period: Duration, subtask: SubtaskLabel) {
        if self.spec.activation == Activation::Sporadic {
            self.flaw(move |dag| Fault::ActivationsDiffer {
                dag,
                subtask: subtask.clone(),
            });
            return;
        }
        self.periodic_source = Some(subtask.clone());
        let Some(period_ns) = self.convert(period, Some(&subtask), "period") else {
            return;
        };
        // The first source sets it; a second one that differs is a fault.
        let first_ns = *self.spec.period_ns.get_or_insert(period_ns);
        if first_ns != period_ns {
            self.flaw(move |dag| Fault::PeriodsDiffer {
                dag,
                subtask: subtask.clone(),
                first_ns,
                second_ns: period_ns,
            });
        }
    }

    /// States the relative deadline of a sink. The DAG's is that of the sink which has the
    /// longest, unless it states its own.
    #[inline(never)]
    pub(crate) fn set_sink_deadline(&mut self, deadline: Duration, sink: &SubtaskLabel) {
        let Some(deadline_ns) = self.convert(deadline, Some(sink), "relative deadline") else {
            return;
        };
        self.spec.subtasks[sink.id.index()].relative_deadline_ns = Some(deadline_ns);
        // Without a deadline of its own the DAG has that of its latest sink.
        if !self.states_deadline {
            let longest_ns = self.spec.relative_deadline_ns.max(Some(deadline_ns));
            self.spec.relative_deadline_ns = longest_ns;
        }
    }

    /// Notes that completions of a subtask may ask for something.
    pub(crate) fn ask(&mut self, subtask: usize, of: RequestKind) -> Wish {
        let wish = Wish::default();
        let asked = InstanceRequests {
            wish: Arc::clone(&wish),
            of,
        };
        // A wish becomes a request by the completion (R3), and by nothing else.
        self.act(subtask, Box::new(asked));
        wish
    }

    fn flaw(&mut self, flaw: impl Fn(DagLabel) -> Fault + 'static) {
        self.flaws.push(Box::new(flaw));
    }

    /// Makes waits of a subtask a fault, if it states any.
    pub(crate) fn refuse_waits(&mut self, code: &'static str, subtask: usize, says: &'static str) {
        if !self.spec.subtasks[subtask].waits.is_empty() {
            let fault = move |of: &CheckedDag<'_>| Some(of.fault(code, subtask, says));
            self.add(PartKind::Wait, fault);
        }
    }

    /// Returns how messages call a subtask that is registered.
    pub(crate) fn label(&self, subtask: usize) -> SubtaskLabel {
        SubtaskLabel {
            id: SubtaskId(u32::try_from(subtask).unwrap_or(u32::MAX)),
            name: self.spec.subtasks[subtask].name.clone(),
        }
    }

    /// Returns the spec with every [`UnstatedType`] end replaced by its other end's
    /// type, where that is known.
    pub(crate) fn spec_with_known_types(&self) -> Cow<'_, DagSpec> {
        let mut spec = Cow::Borrowed(&self.spec);
        if self.has::<Rc<dyn AnyLatest>>() {
            let latest = self.all::<Rc<dyn AnyLatest>>().map(|latest| LatestSpec {
                port: latest.port(),
                samplers: latest.samplers(),
            });
            spec.to_mut().latest = latest.collect();
        }
        let unknown = MessageType::of::<UnstatedType>().id();
        let ports = (self.spec.subtasks.iter())
            .flat_map(|subtask| subtask.inputs.iter().chain(&subtask.outputs));
        // The usual case borrows the spec as it is.
        if ports.clone().all(|port| port.type_id != unknown) {
            return spec;
        }
        let known: Vec<TopicPort> = ports
            .filter(|port| port.type_id != unknown)
            .cloned()
            .chain(spec.latest.iter().map(|latest| latest.port.clone()))
            .collect();
        for subtask in &mut spec.to_mut().subtasks {
            for port in subtask.inputs.iter_mut().chain(&mut subtask.outputs) {
                // A list of the wrong length has no types; those of the other ends keep it from
                // being reported twice.
                if port.type_id == unknown
                    && let Some(other_end) = known.iter().find(|other| other.topic == port.topic)
                {
                    // One end with a known type is enough; two that differ are a fault of their
                    // own.
                    port.clone_from(other_end);
                }
            }
        }
        spec
    }

    /// Converts a duration, or notes that it is too long.
    #[inline(never)]
    fn convert(
        &mut self,
        duration: Duration,
        subtask: Option<&SubtaskLabel>,
        what: &'static str,
    ) -> Option<u64> {
        let ns = u64::try_from(duration.as_nanos()).ok();
        if ns.is_none() {
            let subtask = subtask.cloned();
            self.flaw(move |dag| Fault::DurationTooLong {
                dag,
                subtask: subtask.clone(),
                what,
            });
        }
        ns
    }

    fn next_label(&self, attributes: &SubtaskAttributes) -> SubtaskLabel {
        let number = u32::try_from(self.spec.subtasks.len()).unwrap_or(u32::MAX);
        SubtaskLabel {
            id: SubtaskId(number),
            name: attributes.name.clone(),
        }
    }
}

/// Pairs topics with types; all types are unknown if the numbers differ, since
/// it cannot be told which one is missing.
fn ports(topics: &[&str], types: &[MessageType]) -> Vec<TopicPort> {
    // Which topic has which type is not known if the counts differ.
    let fits = topics.len() == types.len();
    (topics.iter().enumerate())
        .map(|(index, topic)| {
            let known = types.get(index).filter(|_| fits).copied();
            let message = known.unwrap_or_else(MessageType::of::<UnstatedType>);
            message.port(topic)
        })
        .collect()
}

/// Attributes of a subtask beyond its function and its topics.
///
/// The paper leaves these to the scheduling algorithm; all of them are optional
/// here, and the commit says when the chosen policy needs one that is missing.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::SubtaskAttributes;
///
/// let attributes = SubtaskAttributes::named("fuse")
///     .priority(3)
///     .wcet(Duration::from_micros(500))
///     .non_preemptive();
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[must_use = "attributes have no effect until they are registered with a subtask"]
pub struct SubtaskAttributes {
    pub(crate) name: String,
    pub(crate) priority: Option<u32>,
    pub(crate) wcet: Option<Duration>,
    /// The limits of its waits, and the WCETs of the segments behind them.
    waits: Vec<(Duration, Option<Duration>)>,
    pub(crate) budget: Option<Duration>,
    stack_bytes: Option<u64>,
    non_preemptive: bool,
}

impl SubtaskAttributes {
    /// Starts with a name, by which reports and error messages call the subtask.
    ///
    /// Names are unique within a DAG. Without a name
    /// ([`default`](Self::default)) messages say `subtask 2`, counting from 0
    /// in the order of registration.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.into(),
            ..Self::default()
        }
    }

    /// Sets the static priority; the *smaller* number is the higher priority.
    ///
    /// Used under [`Policy::StaticPriority`](crate::Policy::StaticPriority).
    /// Without it the commit derives one from the graph.
    pub fn priority(mut self, priority: u32) -> Self {
        self.priority = Some(priority);
        self
    }

    /// Sets the worst-case execution time: the longest that one instance
    /// executes, preemption not counted.
    ///
    /// At most `u64::MAX` nanoseconds; a longer one is a fault at commit. After a
    /// [`wait`](Self::wait) it is that of the segment which follows that wait, and only what
    /// executes counts.
    pub fn wcet(mut self, wcet: Duration) -> Self {
        let segment = self.waits.last_mut().map(|(_, segment)| segment);
        *segment.unwrap_or(&mut self.wcet) = Some(wcet);
        self
    }

    /// Adds a wait, with the time after which it ends at the latest, whatever a device does.
    ///
    /// Each instance of an [async subtask](crate::Dag::register_async_subtask) takes its waits one
    /// after the other, each once; what it executes between them are its *segments*. Their WCETs are
    /// stated where they stand, of all segments or of none:
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::SubtaskAttributes;
    ///
    /// let ms = Duration::from_millis;
    /// let attributes = SubtaskAttributes::named("ask").wcet(ms(1)).wait(ms(3)).wcet(ms(1));
    /// ```
    pub fn wait(mut self, limit: Duration) -> Self {
        self.waits.push((limit, None));
        self
    }

    /// Sets the execution budget: an instance that executes longer, preemption
    /// not counted, is ended by the platform as a fault, and its DAG with it.
    ///
    /// Without it the platform may enforce a multiple of the
    /// [WCET](Self::wcet). At most `u64::MAX` nanoseconds; a longer one is a
    /// fault at commit.
    pub fn budget(mut self, budget: Duration) -> Self {
        self.budget = Some(budget);
        self
    }

    /// Sets the stack that the subtask needs, in bytes, from 16 KiB to 1 MiB; another number is
    /// a fault at commit. Without it the kernel gives 64 KiB. The stacks of a commit are all as
    /// large as the largest; `measure=stacks` says how much of them each subtask uses.
    pub fn stack_bytes(mut self, bytes: u64) -> Self {
        self.stack_bytes = Some(bytes);
        self
    }

    /// States that a started instance keeps its core until it finishes, although the
    /// platform preempts others.
    pub fn non_preemptive(mut self) -> Self {
        self.non_preemptive = true;
        self
    }
}
