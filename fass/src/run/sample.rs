//! What a subtask samples of a recorded topic, written down or given back in a replay.
//!
//! The value is written into a buffer when the subtask looks, and given to the platform when
//! the instance is complete, or has failed: without it nobody could compute its fault again.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::fmt;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU16, AtomicU64, Ordering};

use recording::{Encoder, Recordable, Schema};
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Instance};

use super::cell::Shared;
use super::crossing::{Edge, Recorded, room_of};
use super::effect::Effect;
use super::latest::{Entry, Probe, SharedLatest, Slot};

/// What the probe of a sampling subtask, its body and its completion share.
pub(crate) struct SampleLine {
    number: AtomicU16,
    edge: &'static Edge,
    /// The job whose instance runs.
    job: AtomicU64,
    room: Shared<Room>,
}

/// The sample of an instance that is not complete yet.
struct Room {
    bytes: Vec<u8>,
    /// Its job, and how many bytes it has, if it fitted.
    sample: Option<(u64, Option<usize>)>,
}

/// Sets a probe, and returns the type of the samples, and what the probe has of its instance.
pub(super) fn probe<T: Recordable + Send + 'static>(
    shared: &SharedLatest<T>,
    sampler: usize,
    edge: &'static Edge,
) -> (Schema, Arc<SampleLine>) {
    let room = Room {
        bytes: alloc::vec![0; room_of::<Option<(u64, u64, T)>>()],
        sample: None,
    };
    let line = Arc::new(SampleLine {
        number: AtomicU16::new(0),
        edge,
        job: AtomicU64::new(0),
        room: Shared::new(room),
    });
    shared.set_probe(
        sampler,
        Box::new(SampleProbe {
            line: Arc::clone(&line),
            of: PhantomData::<fn() -> T>,
        }),
    );
    (<Option<(u64, u64, T)>>::schema(), line)
}

impl SampleLine {
    /// Notes the job whose instance runs.
    pub(super) fn begin(&self, job: u64) {
        self.job.store(job, Ordering::Relaxed);
    }

    pub(super) fn set_number(&self, number: u16) {
        self.number.store(number, Ordering::Relaxed);
    }

    /// Gives the sample to the platform.
    fn give(&self, at_ns: u64) {
        self.take(at_ns, &mut |sample| (self.edge.record)(sample));
    }

    /// Takes the sample, if there is one.
    fn take(&self, at_ns: u64, take: &mut dyn FnMut(&Recorded<'_>)) {
        // Only the subtask's body uses the room, which is `&mut` there.
        let Some(mut room) = self.room.change() else {
            return;
        };
        if let Some((job, length)) = room.sample.take() {
            take(&Recorded {
                channel: self.number.load(Ordering::Relaxed),
                job,
                completed_ns: at_ns,
                bytes: length.and_then(|length| room.bytes.get(..length)),
            });
        }
    }
}

/// The probe of a subtask that samples values of this type.
struct SampleProbe<T> {
    line: Arc<SampleLine>,
    of: PhantomData<fn() -> T>,
}

impl<T: Recordable + 'static> Probe for SampleProbe<T> {
    fn replay(&self, slot: &dyn Any) -> bool {
        let line = &self.line;
        let mut found = None;
        let number = line.number.load(Ordering::Relaxed);
        let job = line.job.load(Ordering::Relaxed);
        (line.edge.replay)(number, job, &mut |bytes| {
            found = <Option<(u64, u64, T)>>::from_bytes(bytes).ok();
        });
        let slot = slot.downcast_ref::<Slot<T>>();
        let Some((found, mut slot)) = found.zip(slot.and_then(Slot::change)) else {
            return false;
        };
        *slot = found.map(|(job, completed_ns, value)| Entry {
            value,
            job,
            completed_ns,
        });
        true
    }

    fn look_at(&self, slot: &dyn Any) {
        let slot = slot.downcast_ref::<Slot<T>>();
        let (Some(mut room), Some(sample)) = (self.line.room.change(), slot.and_then(Slot::look))
        else {
            return;
        };
        let mut out = Encoder::new(&mut room.bytes);
        // As `Option<(u64, u64, T)>` is written.
        sample.is_some().encode(&mut out);
        if let Some(entry) = &*sample {
            (entry.job, entry.completed_ns).encode(&mut out);
            entry.value.encode(&mut out);
        }
        let length = out.finish().ok();
        room.sample = Some((self.line.job.load(Ordering::Relaxed), length));
    }
}

impl Effect for Arc<SampleLine> {
    fn happen(&mut self, completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.give(completed_ns);
    }

    fn fail(&mut self, failed_ns: u64) {
        self.give(failed_ns);
    }
}

/// What a subtask samples, for a platform on which a fault takes the body with it.
pub(crate) struct SampledBy {
    dag: DagId,
    subtask: usize,
    line: Arc<SampleLine>,
}

impl SampledBy {
    /// Notes whose line it is.
    pub(super) fn new(dag: DagId, subtask: usize, line: &Arc<SampleLine>) -> Self {
        Self {
            dag,
            subtask,
            line: Arc::clone(line),
        }
    }
}

impl fmt::Debug for SampledBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SampledBy")
    }
}

/// Gives what a failed instance had sampled, once.
pub(crate) fn give_failed(
    samplers: &[SampledBy],
    failed: Instance,
    at_ns: u64,
    take: &mut dyn FnMut(&Recorded<'_>),
) {
    let of_failed = |sampler: &&SampledBy| {
        (sampler.dag, sampler.subtask) == (failed.dag, failed.subtask.index())
    };
    let samplers = samplers.iter().filter(of_failed);
    samplers.for_each(|sampler| sampler.line.take(at_ns, take));
}
