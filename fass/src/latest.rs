//! Latest values: what passes between DAGs of different rates.
//!
//! DAGs have no edges between them, since their jobs do not correspond. A subtask
//! can *sample* a topic of any DAG instead: it gets, at its start, the latest value
//! whose instance is complete, and waits for nothing. In ROS 2 terms: the timer
//! callback that looks at what subscriptions have left in member variables.
//!
//! # What is guaranteed
//!
//! - *Wait-free, both ways.* A sampling subtask never waits for the writer, nor the
//!   writer for it, whatever cores they run on and whoever is preempted. Nothing is
//!   allocated after the commit (a message's `clone` is its own affair).
//! - *Completion boundary.* A value shows when its writer's instance is complete, not
//!   before, and then whole.
//! - *Never backwards.* One subtask's samples are of ever later jobs, or the same
//!   again. During an instance its sample does not change.
//! - *Visible staleness.* A [`Sample`] says of which job it is and when that was
//!   complete. How old it can be follows from the writer's bound
//!   ([`Commit::staleness`](crate::Commit::staleness)).
//!
//! # What is not
//!
//! - Two samples of one function may be of different times, and two subtasks that
//!   sample the same topic in one job may get different values. Sample once and send
//!   the value along an edge to have one for all.
//! - Values may be sampled several times, or never.
//!
//! # How
//!
//! Each sampling subtask has three slots for itself: one that the writer fills, one
//! that the reader looks at, and one in the middle. The writer, when complete, swaps
//! its slot for the middle one; the reader does so if that is fresh (a triple buffer).

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::cell::RefCell;
use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use sched_dag::{DagId, TopicPort};

use crate::cell::{Looking, Shared};
use crate::dag::Dag;
use crate::effect::Effect;
use crate::message::{Message, MessageType};
use crate::uses::{Uses, sealed};

/// The latest value of a topic, for subtasks of any DAG. Made by [`Dag::latest`].
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{Sample, SubtaskAttributes, create_dag, finish_create_dags};
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
/// localizer.register_periodic_subtask(step, vec!["pose"], fast, named("localize"));
/// let pose = localizer.latest::<u64>("pose");
///
/// let planner = create_dag();
/// planner.name("planner").jobs(4).relative_deadline(slow);
/// planner.using(pose.sample()).register_periodic_subtask(
///     |pose: Option<Sample<'_, u64>>| {
///         if let Some(pose) = pose {
///             assert_eq!(*pose.value, pose.job + 1); // job k writes k + 1
///         }
///     },
///     vec![],
///     slow,
///     named("plan"),
/// );
/// let commit = finish_create_dags(&[localizer, planner]).unwrap();
/// assert_eq!(commit.staleness().len(), 1);
/// machine.run();
/// ```
pub struct Latest<T> {
    pub(crate) shared: Rc<SharedLatest<T>>,
}

/// The use of a [`Latest`]: the function gets an `Option<Sample<T>>`. Made by
/// [`Latest::sample`].
///
/// See [`Latest`].
pub struct Sampling<T> {
    shared: Rc<SharedLatest<T>>,
}

/// A value as a subtask finds it at its start: that of the latest complete instance
/// of its writer. `None` in its place: none has been complete yet.
///
/// ```
/// use fass::Sample;
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
    /// The job of the writer's DAG that it is of.
    pub job: u64,
    /// When the writer's instance was complete, on the clock of [`crate::now_ns`].
    pub completed_ns: u64,
}

impl<T> Sample<'_, T> {
    /// Returns the time since the writer was complete, in nanoseconds.
    ///
    /// See [`Sample`].
    #[must_use]
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
    /// Returns the use of a subtask that samples the value.
    ///
    /// See [`Latest`].
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn sample(&self) -> Sampling<T> {
        Sampling {
            shared: Rc::clone(&self.shared),
        }
    }
}

impl Dag {
    /// Offers the latest value of a topic of this DAG to subtasks of any DAG.
    ///
    /// The topic's writer may be registered before or after. It counts as read by
    /// that, so the writer may be the DAG's sink. The type must be the writer's,
    /// which the commit checks, as it does that some subtask samples the value.
    ///
    /// See [`Latest`].
    #[track_caller]
    #[must_use = "a latest value that no subtask samples is a fault at commit"]
    pub fn latest<T: Message + Sync>(&self, topic: &str) -> Latest<T> {
        let shared = Rc::new(SharedLatest {
            topic: topic.into(),
            triples: RefCell::default(),
        });
        self.open()
            .latest
            .push(Rc::<SharedLatest<T>>::clone(&shared));
        Latest { shared }
    }
}

/// A latest value while DAGs are built.
pub(crate) struct SharedLatest<T> {
    topic: String,
    /// One for each sampling subtask.
    triples: RefCell<Vec<Arc<Triple<T>>>>,
}

/// A latest value of whatever type.
pub(crate) trait AnyLatest {
    fn topic(&self) -> &str;

    /// Returns the topic with the type that is read.
    fn port(&self) -> TopicPort;

    /// Returns the number of subtasks that sample it.
    fn samplers(&self) -> usize;

    /// Returns the writing ends: a `Vec<Box<dyn Stage<T>>>`.
    fn stages(&self) -> Box<dyn Any>;

    /// Returns what the writer's completion does.
    fn effects(&self) -> Vec<Box<dyn Effect>>;
}

impl<T: Message + Sync> AnyLatest for SharedLatest<T> {
    fn topic(&self) -> &str {
        &self.topic
    }

    fn port(&self) -> TopicPort {
        MessageType::of::<T>().port(&self.topic)
    }

    fn samplers(&self) -> usize {
        self.triples.borrow().len()
    }

    fn stages(&self) -> Box<dyn Any> {
        let triples = self.triples.borrow();
        let stages: Vec<Box<dyn Stage<T>>> = (triples.iter())
            .map(|triple| -> Box<dyn Stage<T>> { Box::new(Arc::clone(triple)) })
            .collect();
        Box::new(stages)
    }

    fn effects(&self) -> Vec<Box<dyn Effect>> {
        let triples = self.triples.borrow();
        (triples.iter())
            .map(|triple| -> Box<dyn Effect> { Box::new(Arc::clone(triple)) })
            .collect()
    }
}

/// Where a writer puts what shall show at its completion.
pub(crate) trait Stage<T>: Send {
    fn stage(&mut self, job: u64, value: T);
}

/// The slots of one sampling subtask.
struct Triple<T> {
    slots: [Shared<Option<Entry<T>>>; 3],
    /// The slot in the middle, with [`FRESH`] if the reader has not had it.
    middle: AtomicU8,
    /// The writer's slot. Only the writer's body uses it, which is `&mut` there.
    back: AtomicU8,
    /// Whether the writer's slot has a value that shall show at its completion.
    staged: AtomicBool,
}

struct Entry<T> {
    value: T,
    job: u64,
    completed_ns: u64,
}

const FRESH: u8 = 0b100;
const SLOT: u8 = 0b011;

impl<T> Triple<T> {
    fn new() -> Self {
        Self {
            slots: [const { Shared::new(None) }; 3],
            back: AtomicU8::new(0),
            middle: AtomicU8::new(1),
            staged: AtomicBool::new(false),
        }
    }

    /// Changes the writer's slot.
    fn write(&self, change: impl FnOnce(&mut Option<Entry<T>>)) {
        let back = usize::from(self.back.load(Ordering::Relaxed));
        let Some(mut slot) = self.slots[back].change() else {
            panic!("a topic has two writers at one time: the platform runs a subtask twice");
        };
        change(&mut slot);
    }
}

impl<T: Send + Sync> Stage<T> for Arc<Triple<T>> {
    fn stage(&mut self, job: u64, value: T) {
        self.write(|slot| {
            *slot = Some(Entry {
                value,
                job,
                completed_ns: 0,
            });
        });
        self.staged.store(true, Ordering::Relaxed);
    }
}

impl<T: Send + Sync> Effect for Arc<Triple<T>> {
    fn happen(&mut self, completed_ns: u64, _raise: &mut dyn FnMut(DagId)) {
        if !self.staged.load(Ordering::Relaxed) {
            return;
        }
        self.staged.store(false, Ordering::Relaxed);
        self.write(|slot| {
            if let Some(entry) = slot {
                entry.completed_ns = completed_ns;
            }
        });
        let back = self.back.load(Ordering::Relaxed);
        let middle = self.middle.swap(back | FRESH, Ordering::AcqRel);
        self.back.store(middle & SLOT, Ordering::Relaxed);
    }
}

/// The reading end, kept by the sampling subtask.
#[doc(hidden)]
pub struct Sampler<T> {
    triple: Arc<Triple<T>>,
    front: u8,
}

/// The reader's slot for the time of an instance.
#[doc(hidden)]
pub struct Looked<'a, T>(Looking<'a, Option<Entry<T>>>);

impl<T> sealed::Sealed for Sampling<T> {}

impl<T: Message + Sync> Uses for Sampling<T> {
    type Borrowed<'a> = Option<Sample<'a, T>>;
    type Held = Sampler<T>;
    type Guard<'a> = Looked<'a, T>;

    fn is_of(&self, _dag: &Dag) -> bool {
        true
    }

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        let triple = Arc::new(Triple::new());
        self.shared.triples.borrow_mut().push(Arc::clone(&triple));
        dag.draft.borrow_mut().samples.push((subtask, self.shared));
        Sampler { triple, front: 2 }
    }

    fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
        let Sampler { triple, front } = held;
        if triple.middle.load(Ordering::Relaxed) & FRESH != 0 {
            *front = triple.middle.swap(*front, Ordering::AcqRel) & SLOT;
        }
        match triple.slots[usize::from(*front)].look() {
            Some(slot) => Looked(slot),
            None => unreachable!("the writer has another slot"),
        }
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        guard.0.as_ref().map(|entry| Sample {
            value: &entry.value,
            job: entry.job,
            completed_ns: entry.completed_ns,
        })
    }
}

impl<T> fmt::Debug for Latest<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Latest").field(&self.shared.topic).finish()
    }
}

impl<T> fmt::Debug for Sampling<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Sampling").field(&self.shared.topic).finish()
    }
}

#[cfg(test)]
#[path = "latest_tests.rs"]
mod tests;
