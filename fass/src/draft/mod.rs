//! Drafts: registered DAGs before their commit.
//!
//! A draft accepts almost everything, and also remembers mistakes that a [`DagSpec`] cannot
//! express: durations out of range, topic lists not fitting the function. The commit reports such
//! mistakes together with all other faults. A subtask whose list does not fit keeps its topics in
//! the spec, but with the type [`UnstatedType`], and the commit then takes the type from the
//! topic's other end. So one mistake is not reported as several.

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
    /// One function for each of `spec.subtasks`.
    pub(crate) make_bodies: Vec<MakeBody>,
    pub(crate) is_committed: bool,
    /// A source with a stated period.
    periodic_source: Option<SubtaskLabel>,
    /// Whether the DAG states its own relative deadline; otherwise the longest of its sinks'
    /// deadlines holds.
    states_deadline: bool,
    /// Whether the commit fails unless the deadlines are proven.
    pub(crate) demands_proof: bool,
    /// Faults found at registration, complete except for the label of the DAG.
    pub(crate) flaws: Vec<Box<dyn Fn(DagLabel) -> Fault>>,
    /// All other statements of the DAG, in the order of registration.
    pub(crate) parts: Vec<(PartKind, Box<dyn DraftPart>)>,
    /// The identity of the DAG, for raising its signal or pausing the DAG.
    pub(crate) target: Arc<RequestTarget>,
}

/// The topics named for a subtask, and the types of its function.
#[derive(Default)]
pub(crate) struct NamedTopics<'a> {
    pub(crate) inputs: (&'a [&'a str], &'a [MessageType]),
    pub(crate) outputs: (&'a [&'a str], &'a [MessageType]),
}

/// Stands for the type of a topic's end when no function states the type.
#[derive(Clone)]
struct UnstatedType;

impl DagDraft {
    /// Takes the registered DAG out for the commit, and leaves a remainder for later calls on
    /// handles.
    pub(crate) fn close(&mut self) -> Self {
        // The remainder answers for the handle: with the name in complaints, and with the target of
        // signals.
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
        // Noted, not reported: a commit reports all faults of all DAGs at once.
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

    /// Returns the spec of a subtask from the attributes, without ports.
    fn specify(&mut self, subtask: &SubtaskLabel, attributes: SubtaskAttributes) -> SubtaskSpec {
        let wcet = attributes.wcet;
        // A duration not fitting into nanoseconds becomes a fault of the commit, not a panic here.
        let wcet_ns = wcet.and_then(|wcet| self.convert(wcet, Some(subtask), "WCET"));
        let mut waits = alloc::vec![Wait::default(); attributes.waits.len()];
        for (wait, (limit, segment)) in waits.iter_mut().zip(attributes.waits) {
            wait.limit_ns = self.convert(limit, Some(subtask), "wait").unwrap_or(0);
            // Otherwise the WCET of the first segment would pass for the sum of all segments,
            // although nothing is known of the others; the verification refuses 0.
            let segment = segment.or(wcet.map(|_| Duration::ZERO));
            wait.segment_ns = segment.and_then(|wcet| self.convert(wcet, Some(subtask), "WCET"));
        }
        // The sum of all segments; the verification reports a missing part.
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

    /// Replaces the period, whatever a source has stated before.
    pub(crate) fn replace_period(&mut self, period: Duration) {
        let period_ns = self.convert(period, None, "period");
        self.spec.period_ns = period_ns.or(self.spec.period_ns);
    }

    /// Sets the DAG's own relative deadline.
    pub(crate) fn set_dag_deadline(&mut self, deadline: Duration) {
        if let Some(deadline_ns) = self.convert(deadline, None, "relative deadline") {
            self.spec.relative_deadline_ns = Some(deadline_ns);
            self.states_deadline = true;
        }
    }

    pub(crate) fn set_offset(&mut self, offset: Duration) {
        self.spec.offset_ns = self.convert(offset, None, "offset").unwrap_or(0);
    }

    /// Makes the DAG sporadic; a fault if a source states a period.
    pub(crate) fn set_sporadic(&mut self, min_inter_arrival: Duration) {
        self.spec.activation = Activation::Sporadic;
        // The analysis uses the minimum inter-arrival time as the period.
        self.replace_period(min_inter_arrival);
        if let Some(subtask) = self.periodic_source.clone() {
            self.flaw(move |dag| Fault::ActivationsDiffer {
                dag,
                subtask: subtask.clone(),
            });
        }
    }

    /// Sets the period of a source. All sources of a DAG need the same period.
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
        // The first source sets the period; a second source with another period is a fault.
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

    /// Sets the relative deadline of a sink. A DAG without a deadline of its own has the longest
    /// deadline stated by its sinks.
    #[inline(never)]
    pub(crate) fn set_sink_deadline(&mut self, deadline: Duration, sink: &SubtaskLabel) {
        let Some(deadline_ns) = self.convert(deadline, Some(sink), "relative deadline") else {
            return;
        };
        self.spec.subtasks[sink.id.index()].relative_deadline_ns = Some(deadline_ns);
        // Without a deadline of its own the DAG has the deadline of its latest sink.
        if !self.states_deadline {
            let longest_ns = self.spec.relative_deadline_ns.max(Some(deadline_ns));
            self.spec.relative_deadline_ns = longest_ns;
        }
    }

    /// Records that completions of a subtask may make a request.
    pub(crate) fn ask(&mut self, subtask: usize, of: RequestKind) -> Wish {
        let wish = Wish::default();
        let asked = InstanceRequests {
            wish: Arc::clone(&wish),
            of,
        };
        // Only the completion turns a wish into a request (R3).
        self.act(subtask, Box::new(asked));
        wish
    }

    fn flaw(&mut self, flaw: impl Fn(DagLabel) -> Fault + 'static) {
        self.flaws.push(Box::new(flaw));
    }

    /// Makes any declared waits of a subtask a fault.
    pub(crate) fn refuse_waits(&mut self, code: &'static str, subtask: usize, says: &'static str) {
        if !self.spec.subtasks[subtask].waits.is_empty() {
            let fault = move |of: &CheckedDag<'_>| Some(of.fault(code, subtask, says));
            self.add(PartKind::Wait, fault);
        }
    }

    /// Returns the label of a registered subtask, used in messages.
    pub(crate) fn label(&self, subtask: usize) -> SubtaskLabel {
        SubtaskLabel {
            id: SubtaskId(u32::try_from(subtask).unwrap_or(u32::MAX)),
            name: self.spec.subtasks[subtask].name.clone(),
        }
    }

    /// Returns the spec with every [`UnstatedType`] end replaced by the type of its other end, if
    /// known.
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
        // The usual case borrows the spec unchanged.
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
                // A list of the wrong length has no types; with the types of the other ends, no
                // second fault is reported for the list.
                if port.type_id == unknown
                    && let Some(other_end) = known.iter().find(|other| other.topic == port.topic)
                {
                    // One end with a known type is enough; two different known types are a fault of
                    // their own.
                    port.clone_from(other_end);
                }
            }
        }
        spec
    }

    /// Converts a duration to nanoseconds, or records a fault if it is too long.
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

/// Pairs topics with types. If the numbers differ, all types are unknown, since the missing topic
/// is unknown.
fn ports(topics: &[&str], types: &[MessageType]) -> Vec<TopicPort> {
    // Without equal counts the assignment of types to topics is unknown.
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
/// The paper leaves the attributes to the scheduling algorithm. All of them are optional here, and
/// the commit reports a missing one if the chosen policy needs it.
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
    /// The limits of the waits, each with the WCET of the segment after the wait.
    waits: Vec<(Duration, Option<Duration>)>,
    pub(crate) budget: Option<Duration>,
    stack_bytes: Option<u64>,
    non_preemptive: bool,
}

impl SubtaskAttributes {
    /// Makes attributes with a name, used for the subtask in reports and error messages.
    ///
    /// Names are unique within a DAG. Without a name ([`default`](Self::default)) messages say
    /// `subtask 2`, counting from 0 in the order of registration.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.into(),
            ..Self::default()
        }
    }

    /// Sets the static priority; the *smaller* number is the higher priority.
    ///
    /// Used under [`Policy::StaticPriority`](crate::Policy::StaticPriority). Either all subtasks of
    /// a DAG have a priority, or none: then the commit derives the priorities, from the deadlines
    /// between DAGs and from the graph within the DAG.
    pub fn priority(mut self, priority: u32) -> Self {
        self.priority = Some(priority);
        self
    }

    /// Sets the worst-case execution time: the longest execution of one instance, without preempted
    /// time. For a subtask with waits, the first call states the WCET up to the first wait.
    ///
    /// At most `u64::MAX` nanoseconds; a longer time is a fault at commit. After a call of
    /// [`wait`](Self::wait) the time is the WCET of the segment following that wait, and the
    /// waiting itself does not count.
    pub fn wcet(mut self, wcet: Duration) -> Self {
        let segment = self.waits.last_mut().map(|(_, segment)| segment);
        *segment.unwrap_or(&mut self.wcet) = Some(wcet);
        self
    }

    /// Adds a wait, with a limit after which the wait ends at the latest, whatever a device does.
    ///
    /// Each instance of an [async subtask](crate::Dag::register_async_subtask) takes its waits one
    /// after the other, each once. The parts executed between the waits are the instance's
    /// *segments*. Their WCETs are stated in the same order, for all segments or for none:
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

    /// Sets the execution budget: if an instance executes for longer, preempted time not counted,
    /// the platform ends the instance as a fault, and its DAG as well, unless the DAG survives the
    /// fault. (In virtual time only if the test contains panics.)
    ///
    /// Without a budget the platform may enforce a multiple of the [WCET](Self::wcet). At most
    /// `u64::MAX` nanoseconds; a longer budget is a fault at commit.
    pub fn budget(mut self, budget: Duration) -> Self {
        self.budget = Some(budget);
        self
    }

    /// Sets the size of the subtask's stack in bytes, from 16 KiB to 1 MiB; any other number is a
    /// fault at commit. By default the kernel gives 64 KiB. Only the kernel uses the number. All
    /// stacks of a commit are as large as the largest; `measure=stacks` shows how much of its stack
    /// each subtask uses.
    pub fn stack_bytes(mut self, bytes: u64) -> Self {
        self.stack_bytes = Some(bytes);
        self
    }

    /// Makes the subtask non-preemptive: a started instance keeps its core until it finishes, waits
    /// or is ended by a fault, although the platform preempts others.
    pub fn non_preemptive(mut self) -> Self {
        self.non_preemptive = true;
        self
    }
}
