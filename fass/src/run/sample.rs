//! What a subtask samples of a recorded topic, written down or given back in a replay.
//!
//! The value is written down when the subtask looks, and goes to the platform when
//! the instance is complete, or has failed: without it nobody could compute its fault again.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::any::Any;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};

use recording::{Recordable, Schema};

use super::crossing::Edge;
use super::latest::{Entry, Probe, SharedLatest, Slot};
use super::line::Line;

/// What the probe of a sampling subtask, its body and its completion share.
pub(crate) struct SampleLine {
    pub(super) way: Arc<Line>,
    /// The job whose instance runs.
    job: AtomicU64,
}

/// A sample as it is written down: its job, when that was complete, and the value.
type Sample<T> = Option<(u64, u64, T)>;

/// Sets a probe, and returns the type of the samples, and what the probe has of its instance.
pub(super) fn probe<T: Recordable + Send + 'static>(
    shared: &SharedLatest<T>,
    sampler: usize,
    edge: &'static Edge,
) -> (Schema, Arc<SampleLine>) {
    let line = Arc::new(SampleLine {
        way: Arc::new(Line::new(edge)),
        job: AtomicU64::new(0),
    });
    shared.set_probe(
        sampler,
        Box::new(SampleProbe {
            line: Arc::clone(&line),
            of: PhantomData::<fn() -> T>,
        }),
    );
    (Sample::<T>::schema(), line)
}

impl SampleLine {
    /// Notes the job whose instance runs.
    pub(super) fn begin(&self, job: u64) {
        self.job.store(job, Ordering::Relaxed);
    }
}

/// The probe of a subtask that samples values of this type.
struct SampleProbe<T> {
    line: Arc<SampleLine>,
    of: PhantomData<fn() -> T>,
}

impl<T: Recordable + 'static> Probe for SampleProbe<T> {
    fn replay(&self, slot: &dyn Any) -> bool {
        let way = &self.line.way;
        let mut found = None;
        let job = self.line.job.load(Ordering::Relaxed);
        (way.edge.replay)(way.number(), job, &mut |bytes| {
            found = Sample::<T>::from_bytes(bytes).ok();
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
        let Some(sample) = slot.and_then(Slot::look) else {
            return;
        };
        let job = self.line.job.load(Ordering::Relaxed);
        self.line.way.stage::<Sample<T>>(job, |out| {
            // As an `Option` of a tuple is written.
            sample.is_some().encode(out);
            if let Some(entry) = &*sample {
                (entry.job, entry.completed_ns).encode(out);
                entry.value.encode(out);
            }
        });
    }
}
