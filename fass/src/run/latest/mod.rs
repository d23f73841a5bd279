//! Latest values: slots that carry one from its writer to a subtask that samples it.
//!
//! Each sampling subtask has three slots for itself: one that the writer fills, one
//! that the reader looks at, and one in the middle. The writer, when complete, swaps
//! its slot for the middle one; the reader does so if that is fresh (a triple buffer).
//! So neither waits for the other, and a value shows as a whole or not at all.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::cell::RefCell;
use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use core::time::Duration;

use sched_dag::lifecycle::Request;
use sched_dag::{DagLabel, SubtaskLabel, TopicPort};

use super::cell::{ReadClaim, SetOnce, SharedCell};
use super::effect::Effect;
use super::message::{Message, MessageType};

/// A latest value while DAGs are built.
pub(crate) struct SharedLatest<T> {
    pub(crate) topic: String,
    /// One for each sampling subtask.
    triples: RefCell<Vec<Arc<TripleBuffer<T>>>>,
}

impl<T> SharedLatest<T> {
    pub(crate) fn new(topic: &str) -> Self {
        Self {
            topic: topic.into(),
            triples: RefCell::default(),
        }
    }

    /// Adds a sampling subtask and returns its reading end, and its number.
    pub(crate) fn sampler(&self) -> (Sampler<T>, usize) {
        let triple = Arc::new(TripleBuffer::new());
        let mut triples = self.triples.borrow_mut();
        triples.push(Arc::clone(&triple));
        (Sampler { triple, front: 2 }, triples.len() - 1)
    }

    /// Sets what looks at each sample of a sampling subtask.
    pub(crate) fn set_probe(&self, sampler: usize, probe: Arc<dyn Probe>) {
        // The commit, which comes once, does so for each sampler once.
        let _ = self.triples.borrow()[sampler].probe.set(probe);
    }
}

/// A latest value of whatever type.
pub(crate) trait AnyLatest: Any {
    fn topic(&self) -> &str;

    /// Returns the topic with the type that is read.
    fn port(&self) -> TopicPort;

    /// Returns the number of subtasks that sample it.
    fn samplers(&self) -> usize;

    /// Returns the writing ends, a `Vec<Box<dyn Stage<T>>>`, or what shall stand between the
    /// writer and all others, a [`Wrap<T>`](super::topic::Wrap).
    fn stages(&self) -> Box<dyn Any>;

    /// Returns the effects of the writer's completion.
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
pub(crate) trait Stage<T>: Send + Sync {
    fn stage(&mut self, job: u64, value: T);
}

/// A probe of the samples of one subtask, which it records or replays. It gets the reader's slot,
/// a [`LatestSlot<T>`] whose type it knows, so that a subtask whose samples are not recorded has
/// next to
/// no code for it.
pub(crate) trait Probe: Send + Sync {
    /// Notes the job whose instance runs.
    fn note_job(&self, job: u64);

    /// Puts into the slot what the instance found when it was recorded, and reports whether that
    /// is known.
    fn replay(&self, slot: &dyn Any) -> bool;

    /// Looks at what the instance finds.
    fn look_at(&self, slot: &dyn Any);
}

/// A slot of a sampling subtask.
pub(crate) type LatestSlot<T> = SharedCell<Option<LatestEntry<T>>>;

/// The slots of one sampling subtask.
struct TripleBuffer<T> {
    slots: [LatestSlot<T>; 3],
    /// The slot in the middle, with [`FRESH`] if the reader has not had it.
    middle: AtomicU8,
    /// The writer's slot. Only the writer's body uses it, which is `&mut` there.
    back: AtomicU8,
    /// Whether the writer's slot has a value that shall show at its completion.
    staged: AtomicBool,
    /// Looks at what the reader finds, if the topic is recorded.
    probe: SetOnce<Arc<dyn Probe>>,
}

/// A value, the job that it is of, and when its writer was complete.
pub(crate) struct LatestEntry<T> {
    pub(crate) value: T,
    pub(crate) job: u64,
    pub(crate) completed_ns: u64,
}

const FRESH: u8 = 0b100;
const SLOT: u8 = 0b011;

impl<T> TripleBuffer<T> {
    fn new() -> Self {
        Self {
            slots: [const { SharedCell::new(None) }; 3],
            back: AtomicU8::new(0),
            middle: AtomicU8::new(1),
            staged: AtomicBool::new(false),
            probe: SetOnce::new(),
        }
    }

    /// Changes the writer's slot.
    fn write(&self, change: impl FnOnce(&mut Option<LatestEntry<T>>)) {
        let back = usize::from(self.back.load(Ordering::Relaxed));
        let Some(mut slot) = self.slots[back].change() else {
            panic!("a topic has two writers at one time: the platform runs a subtask twice");
        };
        change(&mut slot);
    }
}

impl<T: Send + Sync> Stage<T> for Arc<TripleBuffer<T>> {
    fn stage(&mut self, job: u64, value: T) {
        self.write(|slot| {
            *slot = Some(LatestEntry {
                value,
                job,
                completed_ns: 0,
            });
        });
        self.staged.store(true, Ordering::Relaxed);
    }
}

impl<T: Send + Sync> Effect for Arc<TripleBuffer<T>> {
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        // An instance that failed, or sends nothing, has staged no value: the older one stays the
        // latest.
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
        // Release: the reader that takes the slot sees the value. Acquire: the slot that comes
        // back is no longer read.
        let middle = self.middle.swap(back | FRESH, Ordering::AcqRel);
        // Only the writer reads it.
        self.back.store(middle & SLOT, Ordering::Relaxed);
    }
}

/// The reading end, kept by the sampling subtask.
#[doc(hidden)]
pub struct Sampler<T> {
    triple: Arc<TripleBuffer<T>>,
    front: u8,
}

/// The reader's slot for the time of an instance.
#[doc(hidden)]
pub struct SampledSlot<'a, T>(ReadClaim<'a, Option<LatestEntry<T>>>);

impl<T: 'static> Sampler<T> {
    /// Takes the slot of the latest complete instance, for the time of the guard.
    pub(crate) fn look(&mut self) -> SampledSlot<'_, T> {
        let Self { triple, front } = self;
        let probe = triple.probe.get();
        let slot = &triple.slots[usize::from(*front)];
        // In a replay the recorded sample takes the place of what the writer has shown.
        if probe.is_none_or(|probe| !probe.replay(slot))
            && triple.middle.load(Ordering::Relaxed) & FRESH != 0
        {
            // The reader's own slot goes to the middle, so that the writer never waits for a
            // reader.
            *front = triple.middle.swap(*front, Ordering::AcqRel) & SLOT;
        }
        let slot = &triple.slots[usize::from(*front)];
        if let Some(probe) = probe {
            // After the exchange: what is recorded is what the function gets.
            probe.look_at(slot);
        }
        match slot.look() {
            Some(slot) => SampledSlot(slot),
            None => unreachable!("the writer has another slot"),
        }
    }
}

impl<T> SampledSlot<'_, T> {
    /// Returns the entry in the slot; `None` before the writer's first completion.
    pub(crate) fn entry(&self) -> Option<&LatestEntry<T>> {
        self.0.as_ref()
    }
}

#[cfg(test)]
mod tests;

/// How old the value that a subtask samples can be at its start.
///
/// ```
/// use core::time::Duration;
/// use fass::shared::Sample;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// let period = Duration::from_millis(10);
/// let taking = |name, ms| SubtaskAttributes::named(name).wcet(Duration::from_millis(ms));
/// let writer = create_dag();
/// writer.name("writer").jobs(3).relative_deadline(period);
/// writer.register_periodic_subtask(|| (1,), ["pose"], period, taking("localize", 2));
/// let pose = writer.latest::<i32>("pose");
/// let reader = create_dag();
/// reader.name("reader").jobs(3).relative_deadline(period);
/// reader
///     .period(period)
///     .using(pose.sample())
///     .source(|_: Option<Sample<'_, i32>>| ())
///     .register(taking("plan", 1));
/// let commit = finish_create_dags(&[writer, reader]).unwrap();
/// assert!(commit.staleness()[0].bound.is_some_and(|bound| bound >= Duration::from_millis(12)));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Staleness {
    /// The DAG of the subtask that samples.
    pub reader_dag: DagLabel,
    /// The subtask that samples.
    pub reader: SubtaskLabel,
    /// The DAG that writes.
    pub writer_dag: DagLabel,
    /// The topic.
    pub topic: String,
    /// The time, never reached, from the nominal release of the job that the value is
    /// of to the start of the instance that samples it, while jobs of the writer come: not in a pause,
    /// up to the first job after it, and not after the last one. `None` if the writer has no proven bound, or is sporadic.
    pub bound: Option<Duration>,
}

impl fmt::Display for Staleness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            reader_dag,
            reader,
            writer_dag,
            topic,
            bound,
        } = self;
        write!(
            f,
            "{reader} of {reader_dag} samples topic `{topic}` of {writer_dag}, "
        )?;
        match bound {
            Some(bound) => write!(f, "less than {bound:?} old while its jobs come"),
            None => f.write_str("of unknown age"),
        }
    }
}
