//! Which job's value each instance has sampled, from the events of a run.
//!
//! An instance samples when it starts, and a value shows when its writer's instance is complete.
//! Both are events of the journal, which stand in the order in which they happened under the
//! scheduler's lock. So the value is that of the writer's last finish before the start. On a
//! machine the function is called a little after its start was written; a writer that finishes
//! in these instructions is taken for too late. In a replay samples are those of the recording,
//! whatever has finished before.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::{Place, Sampling};
use crate::ids::Instance;
use crate::journal::{Event, What};

/// What was sampled in a run.
#[derive(Clone, Debug, Default)]
pub struct SampledJobs {
    /// By instance, and by the writer of what it samples: the job.
    jobs: BTreeMap<(Instance, Place), u64>,
}

impl SampledJobs {
    /// Follows the events of a run, in the order of the journal.
    #[must_use]
    pub fn new(samplings: &[Sampling], events: impl Iterator<Item = Event>) -> Self {
        let mut readers: BTreeMap<Place, Vec<Place>> = BTreeMap::new();
        // Of the writers: the last job that is complete.
        let mut latest: BTreeMap<Place, Option<u64>> = BTreeMap::new();
        for sampling in samplings {
            let writers = readers.entry(sampling.reader).or_default();
            writers.push(sampling.writer);
            latest.insert(sampling.writer, None);
        }
        let mut jobs = BTreeMap::new();
        for event in events {
            let Some(instance) = event.instance() else {
                continue;
            };
            let place = (instance.dag, instance.subtask);
            match event.what {
                What::Start => {
                    for writer in readers.get(&place).into_iter().flatten() {
                        if let Some(Some(job)) = latest.get(writer) {
                            jobs.insert((instance, *writer), *job);
                        }
                    }
                }
                What::Finish => {
                    if let Some(latest) = latest.get_mut(&place) {
                        *latest = Some(event.job);
                    }
                }
                _ => {}
            }
        }
        Self { jobs }
    }

    /// Returns the job whose value an instance has sampled of a writer; `None`: it has not
    /// started, or found nothing.
    #[must_use]
    pub fn job(&self, reader: Instance, writer: Place) -> Option<u64> {
        self.jobs.get(&(reader, writer)).copied()
    }

    /// Returns all that was sampled: by which instance, and whose value.
    pub fn all(&self) -> impl Iterator<Item = (Instance, Instance)> {
        self.jobs.iter().map(|((reader, (dag, subtask)), job)| {
            let (dag, job, subtask) = (*dag, *job, *subtask);
            (*reader, Instance { dag, job, subtask })
        })
    }
}
