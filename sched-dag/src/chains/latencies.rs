//! The times of a chain in one run.
//!
//! Outputs count up to the instant at which the next job of one of the chain's DAGs would have
//! been due and did not come, because the DAG had ended: from then on what is sampled only gets
//! older. Outputs that go back to nothing, as the first ones of a run, do not count.
//!
//! Let outputs m and m+1 follow each other and go back to jobs s(m) and s(m+1). The data age of
//! m is f(m+1) - r(s(m)). If s(m+1) > s(m), this is the reaction time to what happens after the
//! release of job s(m); else that is longer still. Conversely, the reaction time to what happens
//! after the release of job k >= s(m), where m+1 is the first output that goes back to a later
//! one, is f(m+1) - r(k) <= f(m+1) - r(s(m)). So the longest of each are the same, if the run
//! does not end between.
//!
//! # Samples
//!
//! An instance samples when it starts, and a value shows when its writer's instance is complete.
//! Both are events of the journal, which stand in the order in which they happened under the
//! scheduler's lock. So the value is that of the writer's last finish before the start. On a
//! machine the function is called a little after its start was written; a writer that finishes
//! in these instructions is taken for too late. In a replay samples are those of the recording,
//! whatever has finished before.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::{Chain, Place, Sampling};
use crate::ids::{DagId, Instance};
use crate::journal::{Event, What};
use crate::task_set::TaskSet;

/// The times of a chain in one run, in nanoseconds; `chains` says what they are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Latencies {
    /// Of each output: its age at its finish.
    pub output_age_ns: Vec<u64>,
    /// Of each output that was followed by another one: its data age.
    pub data_age_ns: Vec<u64>,
    /// The reaction time to what happens just after each job's release, if it was seen.
    pub reaction_ns: Vec<u64>,
}

impl Chain {
    /// Measures the chain in the events of a run, which are in the order of the journal.
    #[must_use]
    pub fn latencies(
        &self,
        task_set: &TaskSet,
        events: impl Iterator<Item = Event> + Clone,
    ) -> Latencies {
        let hops = self.segments.windows(2).map(|hop| Sampling {
            writer: (hop[0].dag, hop[0].exit),
            reader: (hop[1].dag, hop[1].entry),
        });
        let hops: Vec<Sampling> = hops.collect();
        let sampled = SampledJobs::new(&hops, events.clone());
        let releases = Releases::of(task_set, events.clone());
        let end_ns = self.segments.iter().map(|segment| {
            let model = task_set.dag(segment.dag);
            let last = releases.0.keys().rfind(|(dag, _)| *dag == segment.dag);
            match last {
                Some((_, job)) if !model.is_sporadic() => model.grid_ns(job.saturating_add(1)),
                _ => u64::MAX,
            }
        });
        let end_ns = end_ns.min().unwrap_or(u64::MAX);
        let (first, last) = (self.segments[0], self.segments[self.segments.len() - 1]);
        let mut latencies = Latencies::default();
        // The job that the output before goes back to, and its release.
        let mut before: Option<(u64, u64)> = None;
        let is_output = |event: &Event| {
            (event.what, event.dag, event.subtask) == (What::Finish, last.dag, Some(last.exit))
                && event.time_ns <= end_ns
        };
        for output in events.filter(is_output) {
            // What it goes back to, hop by hop.
            let origin = hops.iter().rev().try_fold(output.job, |job, hop| {
                let (dag, subtask) = hop.reader;
                sampled.job(Instance { dag, job, subtask }, hop.writer)
            });
            let release_ns = |job| releases.0.get(&(first.dag, job)).copied();
            let Some((origin, release_ns)) = origin.and_then(|job| Some((job, release_ns(job)?)))
            else {
                before = None;
                continue;
            };
            let since = |start_ns: u64| output.time_ns.saturating_sub(start_ns);
            latencies.output_age_ns.push(since(release_ns));
            if let Some((before, before_ns)) = before {
                latencies.data_age_ns.push(since(before_ns));
                let missed = releases
                    .0
                    .range((first.dag, before)..(first.dag, origin.max(before)));
                let reactions = missed.map(|(_, release_ns)| since(*release_ns));
                latencies.reaction_ns.extend(reactions);
            }
            before = Some((origin, release_ns));
        }
        latencies
    }
}

/// The nominal releases of all jobs that were released.
struct Releases(BTreeMap<(DagId, u64), u64>);

impl Releases {
    fn of(task_set: &TaskSet, events: impl Iterator<Item = Event>) -> Self {
        let mut due_ns = BTreeMap::new();
        let mut releases = BTreeMap::new();
        for event in events {
            let of = (event.dag, event.job);
            match event.what {
                What::Due => {
                    due_ns.insert(of, event.time_ns);
                }
                What::Released => {
                    let model = task_set.dag(event.dag);
                    let due_ns = due_ns.get(&of).copied().unwrap_or(event.time_ns);
                    releases.insert(of, model.release_ns(event.job, due_ns));
                }
                _ => {}
            }
        }
        Self(releases)
    }
}

/// The samples of a run.
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
