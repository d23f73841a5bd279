//! Latest values: the slots carrying a value from its writer to a sampling subtask.
//!
//! Each sampling subtask has three slots of its own: one filled by the writer, one read by the
//! reader, and one in the middle. At its completion, the writer swaps its slot for the middle one;
//! the reader does so if the middle one is fresh (a triple buffer). So neither waits for the other,
//! and a value shows as a whole or not at all.

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
    /// A triple buffer for each sampling subtask.
    triples: RefCell<Vec<Arc<TripleBuffer<T>>>>,
}

impl<T> SharedLatest<T> {
    pub(crate) fn new(topic: &str) -> Self {
        Self {
            topic: topic.into(),
            triples: RefCell::default(),
        }
    }

    /// Adds a sampling subtask. Returns its reading end and its number.
    pub(crate) fn sampler(&self) -> (Sampler<T>, usize) {
        let triple = Arc::new(TripleBuffer::new());
        let mut triples = self.triples.borrow_mut();
        triples.push(Arc::clone(&triple));
        // At first slot 0 is the writer's, and slot 1 the one in the middle.
        (Sampler { triple, front: 2 }, triples.len() - 1)
    }

    /// Sets the probe looking at each sample of a sampling subtask.
    pub(crate) fn set_probe(&self, sampler: usize, probe: Arc<dyn Probe>) {
        // Cannot fail: the commit, which comes once, does so once for each sampler.
        let _ = self.triples.borrow()[sampler].probe.set(probe);
    }
}

/// A latest value of any type.
pub(crate) trait AnyLatest: Any {
    fn topic(&self) -> &str;

    /// Returns the topic with the type of the value.
    fn port(&self) -> TopicPort;

    /// Returns the number of sampling subtasks.
    fn samplers(&self) -> usize;

    /// Returns the writing ends, a `Vec<Box<dyn Stage<T>>>`, or the function putting a relay
    /// between the writer and all readers, a [`Wrap<T>`](super::topic::Wrap).
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

/// The place for a value that shows at its writer's completion.
pub(crate) trait Stage<T>: Send + Sync {
    fn stage(&mut self, job: u64, value: T);
}

/// A probe recording or replaying the samples of one subtask. It gets the reader's slot, a
/// [`LatestSlot<T>`] of a type known to the probe, so a subtask without recorded samples has almost
/// no code for it.
pub(crate) trait Probe: Send + Sync {
    /// Notes the job of the running instance.
    fn note_job(&self, job: u64);

    /// In a replay, puts the recorded sample of the instance into the slot, or empties the slot if
    /// the instance found no value. Reports whether the recording has an entry for the instance.
    fn replay(&self, slot: &dyn Any) -> bool;

    /// Looks at the instance's sample.
    fn look_at(&self, slot: &dyn Any);
}

/// A slot of a sampling subtask.
pub(crate) type LatestSlot<T> = SharedCell<Option<LatestEntry<T>>>;

/// The slots of one sampling subtask.
struct TripleBuffer<T> {
    slots: [LatestSlot<T>; 3],
    /// The slot in the middle, with [`FRESH`] if the reader has not had it.
    middle: AtomicU8,
    /// The writer's slot. Only the writer's body uses it, through `&mut`.
    back: AtomicU8,
    /// Whether the writer's slot has a value to show at the completion.
    staged: AtomicBool,
    /// Looks at the reader's samples, if the topic is recorded.
    probe: SetOnce<Arc<dyn Probe>>,
}

/// A value, its job, and the time of its writer's completion.
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
                // The completion sets the time; until then nobody sees the entry.
                completed_ns: 0,
            });
        });
        self.staged.store(true, Ordering::Relaxed);
    }
}

impl<T: Send + Sync> Effect for Arc<TripleBuffer<T>> {
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        // An instance that failed, or sends nothing, has staged no value: the older value stays the
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
        // Release: the reader taking the slot sees the value. Acquire: nobody reads the slot coming
        // back any more.
        let middle = self.middle.swap(back | FRESH, Ordering::AcqRel);
        // Relaxed: only the writer uses `back`.
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
    /// Takes the slot of the latest complete instance, for the life of the guard.
    pub(crate) fn look(&mut self) -> SampledSlot<'_, T> {
        let Self { triple, front } = self;
        let probe = triple.probe.get();
        let slot = &triple.slots[usize::from(*front)];
        // In a replay the recorded sample takes the place of the value shown by the writer.
        // If the middle slot were not fresh, the exchange would bring back an older value.
        if probe.is_none_or(|probe| !probe.replay(slot))
            && triple.middle.load(Ordering::Relaxed) & FRESH != 0
        {
            // The reader's own slot goes to the middle, so the writer never waits for a reader.
            *front = triple.middle.swap(*front, Ordering::AcqRel) & SLOT;
        }
        let slot = &triple.slots[usize::from(*front)];
        if let Some(probe) = probe {
            // After the exchange: the recorded sample is the one passed to the function.
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

/// The greatest age of a sampled value at the start of the sampling instance.
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
    /// The DAG of the sampling subtask.
    pub reader_dag: DagLabel,
    /// The sampling subtask.
    pub reader: SubtaskLabel,
    /// The writing DAG.
    pub writer_dag: DagLabel,
    /// The topic.
    pub topic: String,
    /// The bound on the value's age: from the nominal release of the job writing the value to the
    /// start of the sampling instance. The age is always less. The bound holds while jobs of the
    /// writer come: neither in a pause, up to the first job after it, nor after the last job.
    /// `None` if the writer has no proven bound, or is sporadic.
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
