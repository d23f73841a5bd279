//! The inputs of the last jobs, kept in bounded memory: what a crash leaves behind.
//!
//! A recording of a whole run needs memory or a way out for all of it. To compute a fault again,
//! the inputs of the last jobs mostly suffice: what sources returned and what subtasks sampled,
//! of topics that are recorded, and what they found in recorded states. Each such channel has a
//! place for each of so many jobs, made at the commit; a value takes the place of the one so many
//! jobs before.

use alloc::vec::Vec;
use core::ops::Range;

use recording::{Channel, Role};

use super::crossing::{Recorded, room_for};

/// The inputs of each DAG's last jobs, or, once one has failed, of those up to it. It allocates
/// nothing but when it is made.
///
/// ```
/// use fass::{LatestJobs, Recorded};
/// use recording::{Channel, Recordable, Role};
///
/// let (dag, subtask, role, topic) = (0, 0, Role::Source, "turns".into());
/// let schema = u32::schema();
/// let channels = [Channel { dag, subtask, role, topic, schema }];
/// let mut latest = LatestJobs::new(&channels, 2).expect("there is memory");
/// for job in 0..9_u32 {
///     if job == 5 {
///         latest.hold(0, 4); // it has failed
///     }
///     latest.take(&Recorded {
///         channel: 0,
///         job: job.into(),
///         completed_ns: 0,
///         bytes: Some(&job.to_le_bytes()),
///     });
/// }
/// let jobs: Vec<u64> = latest.values().map(|value| value.job).collect();
/// assert_eq!(jobs, [3, 4]);
/// assert!(latest.has(0, 3) && !latest.has(0, 2));
/// ```
#[derive(Clone, Debug)]
pub struct LatestJobs {
    jobs: u32,
    /// One for each channel; empty for one that is no input.
    places: Vec<Places>,
    /// For each DAG, the jobs before the next one.
    ends: Vec<u64>,
    /// For each DAG, the last job of interest.
    last: Vec<u64>,
}

/// The places of a channel.
#[derive(Clone, Debug)]
struct Places {
    dag: usize,
    /// The room of a value.
    room: usize,
    bytes: Vec<u8>,
    /// By place: the job, when it was complete, and its length, if it fitted.
    values: Vec<Option<(u64, u64, Option<usize>)>>,
}

impl LatestJobs {
    /// Makes room for the inputs of so many jobs; `None`: there is no memory.
    ///
    /// See [`LatestJobs`].
    #[must_use]
    pub fn new(channels: &[Channel], jobs: u32) -> Option<Self> {
        let count = usize::try_from(jobs).unwrap_or(usize::MAX);
        let mut places = Vec::with_capacity(channels.len());
        for channel in channels {
            let count = match channel.role {
                Role::Source | Role::Sample | Role::State => count,
                Role::Result => 0,
            };
            let room = room_for(channel.schema.least_bytes());
            places.push(Places {
                dag: channel.dag.into(),
                room,
                bytes: filled(0, room.checked_mul(count)?)?,
                values: filled(None, count)?,
            });
        }
        let dags = channels.iter().map(|channel| usize::from(channel.dag) + 1);
        let dags = dags.max().unwrap_or(0);
        Some(Self {
            jobs,
            places,
            ends: filled(0, dags)?,
            last: filled(u64::MAX, dags)?,
        })
    }

    /// Takes a value, if it is an input.
    ///
    /// See [`LatestJobs`].
    pub fn take(&mut self, value: &Recorded<'_>) {
        let Some(places) = self.places.get_mut(usize::from(value.channel)) else {
            return;
        };
        let Some(place) = place_of(value.job, places.values.len()) else {
            return;
        };
        if value.job > self.last[places.dag] {
            return;
        }
        let end = &mut self.ends[places.dag];
        *end = (*end).max(value.job.saturating_add(1));
        let room = &mut places.bytes[place * places.room..][..places.room];
        let fitting = value.bytes.and_then(|bytes| {
            room.get_mut(..bytes.len())?.copy_from_slice(bytes);
            Some(bytes.len())
        });
        places.values[place] = Some((value.job, value.completed_ns, fitting));
    }

    /// Holds what is kept of a DAG, one job of which has failed: later jobs take no place of
    /// those before. What is held already stays.
    ///
    /// See [`LatestJobs`].
    pub fn hold(&mut self, dag: usize, job: u64) {
        if let Some(last @ &mut u64::MAX) = self.last.get_mut(dag) {
            *last = job;
        }
    }

    /// Reports whether an input of a job would be kept: it is not behind one that has failed.
    ///
    /// See [`LatestJobs`].
    #[must_use]
    pub fn is_of_interest(&self, dag: usize, job: u64) -> bool {
        self.last.get(dag).is_some_and(|last| job <= *last)
    }

    /// Returns the last jobs of a DAG.
    ///
    /// See [`LatestJobs`].
    #[must_use]
    pub fn jobs(&self, dag: usize) -> Range<u64> {
        let end = self.ends.get(dag).copied().unwrap_or(0);
        end.saturating_sub(self.jobs.into())..end
    }

    /// Reports whether a job is among the last ones of its DAG.
    ///
    /// See [`LatestJobs`].
    #[must_use]
    pub fn has(&self, dag: usize, job: u64) -> bool {
        let end = self.ends.get(dag).copied().unwrap_or(0);
        job.saturating_add(self.jobs.into()) >= end
    }

    /// Returns what is kept, channel by channel, and of each job by job.
    ///
    /// See [`LatestJobs`].
    pub fn values(&self) -> impl Iterator<Item = Recorded<'_>> {
        (0_u16..).zip(&self.places).flat_map(|(channel, places)| {
            self.jobs(places.dag).filter_map(move |job| {
                let place = place_of(job, places.values.len())?;
                let (_, completed_ns, length) =
                    places.values[place].filter(|(of, ..)| *of == job)?;
                let room = &places.bytes[place * places.room..][..places.room];
                Some(Recorded {
                    channel,
                    job,
                    completed_ns,
                    bytes: length.and_then(|length| room.get(..length)),
                })
            })
        })
    }
}

/// Returns so many of a value; `None`: there is no memory.
fn filled<T: Clone>(value: T, count: usize) -> Option<Vec<T>> {
    let mut all = Vec::new();
    all.try_reserve_exact(count).ok()?;
    all.resize(count, value);
    Some(all)
}

/// Returns the place of a job, if there are places.
fn place_of(job: u64, places: usize) -> Option<usize> {
    usize::try_from(job.checked_rem(u64::try_from(places).ok()?)?).ok()
}
