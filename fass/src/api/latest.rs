//! Latest values: data between DAGs of different rates.
//!
//! DAGs have no edges between them, since their jobs do not correspond. Instead, a subtask can
//! *sample* a topic of any DAG: at its start the subtask gets the latest value whose instance is
//! complete, if there is one, and waits for nothing. In ROS 2 terms: a timer callback looking at
//! member variables filled by subscriptions.
//!
//! # Guarantees
//!
//! - *Wait-free, both ways.* A sampling subtask never waits for the writer, nor the writer for the
//!   sampling subtask, whatever cores they run on and whichever is preempted. Nothing is allocated
//!   after the commit (apart from the message's own `clone`).
//! - *Completion boundary.* A value becomes visible when its writer's instance is complete, not
//!   before, and then as a whole.
//! - *Never backwards.* Successive samples of one subtask come from ever later jobs, or from the
//!   same job again. During an instance its sample does not change.
//! - *Visible staleness.* A [`Sample`] contains the writer's job and the completion time of the
//!   writer's instance. If the writer's DAG is periodic and has a proven bound, the greatest age of
//!   a value follows from that bound ([`Commit::staleness`](crate::commit::Commit::staleness)).
//!
//! # Limits
//!
//! - Two samples of one function may be of different times, and two subtasks sampling the same
//!   topic in one job may get different values. To have the same value for all, sample once and
//!   send the value along an edge.
//! - Values may be sampled several times, or never.

use alloc::boxed::Box;
use alloc::rc::Rc;
use core::ptr;

use super::dag::Dag;
use super::uses::{Uses, sealed};
use crate::draft::fault::Fault;
use crate::draft::part::{CheckedDag, DraftPart, Drafts, PartKind, TiedDag};
use crate::run::latest::{AnyLatest, SampledSlot, Sampler, SharedLatest};
use crate::run::message::Message;

/// The latest value of a topic, for subtasks of any DAG. Made by [`Dag::latest`].
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::shared::Sample;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let named = SubtaskAttributes::named;
/// let (fast, slow) = (Duration::from_millis(10), Duration::from_millis(25));
///
/// let localizer = create_dag();
/// localizer.name("localizer").jobs(10).relative_deadline(fast);
/// let mut x = 0_u64;
/// let step = move || {
///     x += 1;
///     (x,)
/// };
/// localizer.register_periodic_subtask(step, ["pose"], fast, named("localize"));
/// let pose = localizer.latest::<u64>("pose");
///
/// let planner = create_dag();
/// planner.name("planner").jobs(4).relative_deadline(slow);
/// planner
///     .period(slow)
///     .using(pose.sample())
///     .source(|pose: Option<Sample<'_, u64>>| {
///         if let Some(pose) = pose {
///             assert_eq!(*pose.value, pose.job + 1); // job k writes k + 1
///         }
///     })
///     .register(named("plan"));
/// let commit = finish_create_dags(&[localizer, planner]).unwrap();
/// assert_eq!(commit.staleness().len(), 1);
/// machine.run();
/// ```
pub struct Latest<T> {
    pub(crate) shared: Rc<SharedLatest<T>>,
}

/// The declaration that a subtask samples a [`Latest`] value: the function gets an
/// `Option<Sample<T>>`. Made by [`Latest::sample`].
///
/// See [`Latest`].
#[derive(Debug)]
pub struct LatestUse<T>(Latest<T>);

/// A sampled value: the value of the writer's latest complete instance when the sampling subtask
/// started. The function gets `None` instead if no instance of the writer was complete by then.
///
/// ```
/// use fass::shared::Sample;
///
/// fn speed(pose: Option<Sample<'_, f64>>) -> f64 {
///     match pose {
///         Some(pose) if pose.age_ns() < 100_000_000 => 1.0,
///         _ => 0.0, // without a fresh pose, stop
///     }
/// }
/// ```
#[derive(Debug)]
pub struct Sample<'a, T> {
    /// The value.
    pub value: &'a T,
    /// The job of the writer's DAG in which the value was written.
    pub job: u64,
    /// The completion time of the writer's instance in nanoseconds, on the clock of
    /// [`crate::now_ns`].
    pub completed_ns: u64,
}

impl<T> Sample<'_, T> {
    /// Returns the time since the completion of the writer's instance, in nanoseconds.
    pub fn age_ns(&self) -> u64 {
        crate::now_ns().saturating_sub(self.completed_ns)
    }
}

impl<T> Clone for Sample<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Sample<'_, T> {}

impl<T: Message + Sync> Latest<T> {
    /// Returns the declaration that a subtask samples the value, for [`Dag::using`].
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn sample(&self) -> LatestUse<T> {
        let shared = Rc::clone(&self.shared);
        LatestUse(Latest { shared })
    }
}

impl Dag {
    /// Offers the latest value of a topic of this DAG to subtasks of any DAG.
    ///
    /// The topic's writer may be registered before or after the call. The topic counts as read, so
    /// the writer may be the DAG's sink. The commit checks that `T` is the writer's type, and that
    /// some subtask samples the value.
    ///
    /// See [`Latest`].
    #[track_caller]
    #[must_use = "a latest value that no subtask samples is a fault at commit"]
    pub fn latest<T: Message + Sync>(&self, topic: &str) -> Latest<T> {
        let shared = Rc::new(SharedLatest::new(topic));
        let latest: Rc<dyn AnyLatest> = Rc::<SharedLatest<T>>::clone(&shared);
        self.open().add(PartKind::Effect, latest);
        Latest { shared }
    }
}

impl<T> sealed::Sealed for LatestUse<T> {}

impl<T: Message + Sync> Uses for LatestUse<T> {
    type Borrowed<'a> = Option<Sample<'a, T>>;
    type Held = Sampler<T>;
    type Guard<'a> = SampledSlot<'a, T>;

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        let (sampler, number) = self.0.shared.sampler();
        let sample = SampleUse(subtask, self.0.shared, number);
        dag.draft.borrow_mut().add(PartKind::Sample, sample);
        sampler
    }

    fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
        held.look()
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        guard.entry().map(|entry| Sample {
            value: &entry.value,
            job: entry.job,
            completed_ns: entry.completed_ns,
        })
    }
}

/// The values become visible with the completions of the topic's writer.
impl DraftPart for Rc<dyn AnyLatest> {
    fn tie(self: Box<Self>, dag: &mut TiedDag<'_>) {
        if let Some(writer) = writer(dag.verified, self.topic()) {
            dag.bodies[writer].add_effects(self.effects());
        }
    }
}

/// Returns the subtask writing a topic.
pub(super) fn writer(dag: &sched_dag::Dag, topic: &str) -> Option<usize> {
    let mut topics = dag.topics().iter();
    Some(topics.find(|of| of.name == topic)?.writer.index())
}

/// A subtask, the latest value (of any DAG) it samples, and its number among the samplers of that
/// value.
pub(crate) struct SampleUse(
    pub(crate) usize,
    pub(crate) Rc<dyn AnyLatest>,
    pub(crate) usize,
);

impl DraftPart for SampleUse {
    fn check(&self, of: &CheckedDag<'_>) -> Option<Fault> {
        let Self(subtask, latest, _) = self;
        // The value's DAG has to be in the same commit; otherwise nobody ever writes the value.
        writer_of(of.drafts, latest).is_none().then(|| {
            let says = format_args!(
                "samples the latest value of topic `{}`, whose dag is not in the commit; commit both \
                 dags in one call",
                latest.topic()
            );
            of.fault("latest_not_committed", *subtask, says)
        })
    }
}

/// Returns the position of the DAG with the topic of a latest value.
pub(crate) fn writer_of(drafts: &Drafts, latest: &Rc<dyn AnyLatest>) -> Option<usize> {
    let is_it = |offered: &Rc<dyn AnyLatest>| ptr::addr_eq(Rc::as_ptr(offered), Rc::as_ptr(latest));
    (drafts.iter()).position(|draft| draft.borrow().all().any(is_it))
}

shown_as!(Latest<T>, |of| of.shared.topic);
