//! The last jobs before a fault, kept where nothing else is recorded or replayed.
//!
//! Only inputs are kept, in memory allocated at the launch ([`LatestJobs`]). Nothing is sent unless
//! an instance fails; then a drain makes a recording of the inputs when the run is over. This
//! recording is marked as cut, since some of its jobs may lack an input.
//!
//! This is the evidence of a crash. A recording of a whole run needs memory or a way out for all
//! its values. To compute a fault again, the inputs of the last jobs mostly suffice: values
//! returned by sources and samples taken by subtasks, both of recorded topics, recorded states, and
//! recorded answers of devices. Each such channel has a place for each of the kept jobs, made at
//! the commit; a value replaces the value of as many jobs before.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
use core::mem;
use core::ops::Range;

use recording::{Channel, EntryKind, Header, Role};
use sched_dag::{DagId, DriverNotice, Instance, journal};

use super::replay::narrow;
use super::tape::{ReleaseTimes, SIGNALS, place_of};
use super::{Crossing, Drain, Record, RecordingState, name, open};
use crate::run::line::{LineOf, RecordedValue, room_for};
use crate::run::plan::Plan;

/// Keeps the last jobs.
pub(super) struct RecentJobs {
    app: &'static str,
    jobs: u32,
    /// The header of the next plan.
    header: Header,
    /// `Some` from the launch on, if there is memory.
    kept: Option<PlanHistory>,
}

/// The history kept of a plan.
struct PlanHistory {
    header: Header,
    latest: LatestJobs,
    releases: ReleaseTimes,
    lines: Vec<LineOf>,
    /// The first failed instance of each DAG, and the time of its fault.
    faults: Vec<(Instance, u64)>,
}

impl RecentJobs {
    pub(super) fn new(app: &'static str, jobs: u32) -> Self {
        Self {
            app,
            // Not more jobs than remembered signals.
            jobs: jobs.min(SIGNALS),
            header: Header::default(),
            kept: None,
        }
    }
}

impl Crossing for RecentJobs {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool {
        open(&mut self.header, dag, graph, channels);
        false
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        let mut header = mem::take(&mut self.header);
        name(&mut header, self.app, &plan.task_set);
        // A replay begins at one of these jobs, so the states before each have to be known.
        plan.keep_states_of(self.jobs);
        // A lack of memory is no error: nobody has asked for this history.
        let latest = LatestJobs::new(&header.channels, self.jobs);
        self.kept = latest.map(|latest| PlanHistory {
            header,
            latest,
            releases: ReleaseTimes::new(&plan.task_set),
            lines: mem::take(&mut plan.lines),
            faults: Vec::with_capacity(plan.task_set.dags().len()),
        });
        Ok(())
    }

    fn record(&mut self, value: &RecordedValue<'_>, at_ns: u64) {
        if let Some(kept) = &mut self.kept {
            kept.latest.store(&RecordedValue {
                completed_ns: at_ns,
                ..*value
            });
        }
    }

    fn happened(&mut self, notice: &DriverNotice) {
        let (dag, job) = (notice.event.dag.index(), notice.event.job);
        // A skipped job counts, too: otherwise later jobs would have other numbers in a replay.
        if let journal::EventKind::Due | journal::EventKind::Skipped = notice.event.what
            && let Some(kept) = &mut self.kept
            && let Some(release_ns) = notice.at_ns
            && kept.latest.is_of_interest(dag, job)
        {
            kept.releases.note(dag, job, release_ns);
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64, _clock_ns: u64) {
        if let Some(kept) = &mut self.kept {
            for of in kept.lines.iter().filter(|of| of.is_found_by(instance)) {
                of.line.show(at_ns, |sample| kept.latest.store(sample));
            }
            // From now on the jobs up to the fault stay, whatever comes after them.
            kept.latest.hold(instance.dag.index(), instance.job);
            if kept
                .faults
                .iter()
                .all(|(other, _)| other.dag != instance.dag)
            {
                // One fault for each DAG: only the first has to be computed again.
                kept.faults.push((instance, at_ns));
            }
        }
    }

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        // A run without a fault leaves no file: nobody has asked for one.
        let kept = self.kept.take_if(|kept| !kept.faults.is_empty())?;
        Some(Box::new(OfLatest(kept)))
    }
}

/// Makes the file.
struct OfLatest(PlanHistory);

impl Drain for OfLatest {
    fn send_header(&mut self, to: &mut Record) {
        let PlanHistory {
            header,
            latest,
            releases,
            faults,
            ..
        } = &self.0;
        to.header(header);
        let mut write = |what, of, job, at_ns, value: &[u8]| {
            to.write(&releases.entry(what, of, job, at_ns, value));
        };
        let dags = (0_u16..).zip(releases.task_set.dags());
        for (dag, _) in dags.filter(|(_, model)| model.is_sporadic()) {
            for job in latest.jobs(dag.into()) {
                // A job without a noted signal was never due.
                if let Some(release_ns) = releases.of(dag.into(), job) {
                    write(EntryKind::Signal, [dag, 0], job, release_ns, &[]);
                }
            }
        }
        // Values after signals, as a replay needs the release of a job before its inputs.
        for value in latest.values() {
            let dag = header.channels[usize::from(value.channel)].dag;
            let what = value.bytes.map_or(EntryKind::Lost, |_| EntryKind::Value);
            let (at_ns, bytes) = (value.completed_ns, value.bytes.unwrap_or_default());
            write(what, [dag, value.channel], value.job, at_ns, bytes);
        }
        for &(instance, at_ns) in faults {
            if let Some((dag, place)) = narrow(instance) {
                write(EntryKind::Fault, [dag, place], instance.job, at_ns, &[]);
            }
        }
    }

    /// Does nothing, as everything is sent with the header.
    fn step(&mut self, _to: Option<&mut Record>) -> bool {
        false
    }

    fn send_losses(&mut self, to: &mut Record) -> Option<RecordingState> {
        Some(RecordingState::of(to, true))
    }
}

/// The inputs of each DAG's last jobs, or, after a fault, of the jobs up to the failed one.
/// Allocates only when made.
///
/// ```
/// use fass::edge::{LatestJobs, RecordedValue};
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
///     latest.store(&RecordedValue {
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
    /// The history of each channel; empty for a channel whose values are no inputs.
    places: Vec<ChannelHistory>,
    /// For each DAG, the job after the latest job seen.
    ends: Vec<u64>,
    /// For each DAG, the last job of interest.
    last: Vec<u64>,
}

/// The places of a channel.
#[derive(Clone, Debug)]
struct ChannelHistory {
    dag: usize,
    /// The room for a value, in bytes.
    room: usize,
    bytes: Vec<u8>,
    /// By place: the job, the time of its completion in ns, and the value's length, if it fitted.
    values: Vec<Option<(u64, u64, Option<usize>)>>,
}

impl LatestJobs {
    /// Makes room for the inputs of `jobs` jobs; `None`: there is no memory.
    pub fn new(channels: &[Channel], jobs: u32) -> Option<Self> {
        let count = usize::try_from(jobs).unwrap_or(usize::MAX);
        let mut places = Vec::with_capacity(channels.len());
        for channel in channels {
            let count = match channel.role {
                Role::Source | Role::Sample | Role::State | Role::Answer => count,
                // A replay computes results itself.
                Role::Result => 0,
            };
            let room = room_for(channel.schema.least_bytes());
            places.push(ChannelHistory {
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

    /// Stores a value, if it is an input.
    pub fn store(&mut self, value: &RecordedValue<'_>) {
        let Some(places) = self.places.get_mut(usize::from(value.channel)) else {
            return;
        };
        let Some(place) = place_of(value.job, places.values.len()) else {
            return;
        };
        // After a fault, later jobs would take the places of the inputs that led to it.
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

    /// Holds the kept jobs of a DAG after a job has failed: later jobs no longer replace them. A
    /// second call for the DAG has no effect.
    pub fn hold(&mut self, dag: usize, job: u64) {
        if let Some(last @ &mut u64::MAX) = self.last.get_mut(dag) {
            *last = job;
        }
    }

    /// Reports whether an input of a job would be kept: the job is not after a failed one.
    pub fn is_of_interest(&self, dag: usize, job: u64) -> bool {
        self.last.get(dag).is_some_and(|last| job <= *last)
    }

    /// Returns the range of a DAG's last jobs.
    pub fn jobs(&self, dag: usize) -> Range<u64> {
        let end = self.ends.get(dag).copied().unwrap_or(0);
        end.saturating_sub(self.jobs.into())..end
    }

    /// Reports whether a job is among the last of its DAG.
    pub fn has(&self, dag: usize, job: u64) -> bool {
        let end = self.ends.get(dag).copied().unwrap_or(0);
        job.saturating_add(self.jobs.into()) >= end
    }

    /// Returns the kept values, ordered by channel and then by job.
    pub fn values(&self) -> impl Iterator<Item = RecordedValue<'_>> {
        (0_u16..).zip(&self.places).flat_map(|(channel, places)| {
            self.jobs(places.dag).filter_map(move |job| {
                let place = place_of(job, places.values.len())?;
                // A job without a value has left the value of an older job in the place.
                let (_, completed_ns, length) =
                    places.values[place].filter(|(of, ..)| *of == job)?;
                let room = &places.bytes[place * places.room..][..places.room];
                Some(RecordedValue {
                    channel,
                    job,
                    completed_ns,
                    bytes: length.and_then(|length| room.get(..length)),
                })
            })
        })
    }
}

/// Returns a vector of `count` copies of a value; `None`: there is no memory.
fn filled<T: Clone>(value: T, count: usize) -> Option<Vec<T>> {
    let mut all = Vec::new();
    all.try_reserve_exact(count).ok()?;
    all.resize(count, value);
    Some(all)
}
