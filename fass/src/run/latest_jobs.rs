//! The inputs of the last jobs, kept in bounded memory: what a crash leaves behind.
//!
//! A recording of a whole run needs memory or a way out for all of it. To compute a fault again,
//! the inputs of the last jobs mostly suffice: what sources returned and what subtasks sampled,
//! of topics that are recorded. Each such channel has a place for each of so many jobs, made at
//! the commit; a value takes the place of the one so many jobs before.

use alloc::vec::Vec;

use recording::{Channel, Role};

use super::crossing::{Recorded, room_for};

/// The inputs of each DAG's last jobs. It allocates nothing but when it is made.
///
/// ```
/// use fass::{LatestJobs, Recorded};
/// use recording::{Channel, Recordable, Role};
///
/// let (dag, subtask, role, topic) = (0, 0, Role::Source, "turns".into());
/// let schema = u32::schema();
/// let mut latest = LatestJobs::new(&[Channel { dag, subtask, role, topic, schema }], 2);
/// for job in 0..5_u32 {
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
    /// Makes room for the inputs of so many jobs.
    ///
    /// See [`LatestJobs`].
    #[must_use]
    pub fn new(channels: &[Channel], jobs: u32) -> Self {
        let count = usize::try_from(jobs).unwrap_or(usize::MAX);
        let places = channels.iter().map(|channel| {
            let count = match channel.role {
                Role::Source | Role::Sample => count,
                Role::Result => 0,
            };
            let room = room_for(channel.schema.least_bytes());
            Places {
                dag: channel.dag.into(),
                room,
                bytes: alloc::vec![0; room * count],
                values: alloc::vec![None; count],
            }
        });
        let dags = channels.iter().map(|channel| usize::from(channel.dag) + 1);
        Self {
            jobs,
            places: places.collect(),
            ends: alloc::vec![0; dags.max().unwrap_or(0)],
        }
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
        let end = &mut self.ends[places.dag];
        *end = (*end).max(value.job.saturating_add(1));
        let room = &mut places.bytes[place * places.room..][..places.room];
        let fitting = value.bytes.and_then(|bytes| {
            room.get_mut(..bytes.len())?.copy_from_slice(bytes);
            Some(bytes.len())
        });
        places.values[place] = Some((value.job, value.completed_ns, fitting));
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
            let end = self.ends.get(places.dag).copied().unwrap_or(0);
            let jobs = end.saturating_sub(self.jobs.into())..end;
            jobs.filter_map(move |job| {
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

/// Returns the place of a job, if there are places.
fn place_of(job: u64, places: usize) -> Option<usize> {
    usize::try_from(job.checked_rem(u64::try_from(places).ok()?)?).ok()
}
