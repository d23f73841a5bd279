//! The file that is made of what a tape has taken.
//!
//! Values and events wait in places of their own. The drain takes the earliest of those that are
//! there, so the file has them nearly in the order of their times, and each channel's in its own.

use alloc::vec::Vec;
use core::sync::atomic::Ordering;

use recording::{Encoder, Entry, Header, Recordable, What};
use sched_dag::{Instance, TaskSet};

use super::guard::narrow;
use super::lost::Lost;
use super::{Drain, Drained, Record};
use crate::run::cell::outbox::{OutboxReader, Published};

/// An event in its record: the place of what it is among [`EVENTS`], DAG and subtask, and when the
/// job was due, where that is known.
pub(super) type Event = (u8, u16, u16, Option<u64>);

/// The most bytes of an event.
pub(super) const EVENT_BYTES: usize = 14;

const EVENTS: [What; 6] = [
    What::Signal,
    What::Skip,
    What::Cut,
    What::Restart,
    What::Clock,
    What::Fault,
];

/// Returns what happened to an instance as a record has it.
pub(super) fn event(what: What, of: Instance, release_ns: Option<u64>) -> Event {
    let place = (0..).zip(EVENTS).find(|(_, other)| *other == what);
    let (dag, subtask) = narrow(of).unwrap_or((u16::MAX, u16::MAX));
    (
        place.map_or(0, |(place, _)| place),
        dag,
        subtask,
        release_ns,
    )
}

/// The bytes of a list of one time.
const TOLD: usize = 4 + 8;

/// Writes down what an instance was told that asked for the time, as a list of one.
fn write_told(clock_ns: u64, bytes: &mut [u8; TOLD]) -> &[u8] {
    (1_u32, clock_ns).encode(&mut Encoder::new(bytes));
    bytes
}

/// Makes the file.
pub(super) struct OfTape {
    events: OutboxReader,
    /// By channel.
    records: Vec<OutboxReader>,
    lost: Lost,
    header: Header,
    releases: Vec<Releases>,
    /// When the run's time begins, on the clock, on which values were complete.
    epoch_ns: u64,
}

/// When a DAG's jobs are due.
pub(super) enum Releases {
    Periodic {
        offset_ns: u64,
        period_ns: u64,
    },
    /// The signals in flight: job and release, a place for each.
    Sporadic(Vec<(u64, u64)>),
}

/// How many signals of a DAG are remembered.
pub(super) const SIGNALS: u32 = 64;

impl Releases {
    /// Returns those of each DAG.
    pub(super) fn of_all(task_set: &TaskSet) -> Vec<Self> {
        let releases = task_set.dags().iter().map(|dag| match dag.is_sporadic() {
            true => Self::Sporadic((0..SIGNALS).map(|_| (u64::MAX, 0)).collect()),
            false => Self::Periodic {
                offset_ns: dag.offset_ns(),
                period_ns: dag.period_ns(),
            },
        });
        releases.collect()
    }

    pub(super) fn of(&self, job: u64) -> Option<u64> {
        match self {
            Self::Periodic {
                offset_ns,
                period_ns,
            } => offset_ns.checked_add(period_ns.checked_mul(job)?),
            Self::Sporadic(signals) => {
                let (of, release_ns) = signals[place_of(job)?];
                (of == job).then_some(release_ns)
            }
        }
    }

    pub(super) fn note(&mut self, job: u64, release_ns: u64) {
        if let Self::Sporadic(signals) = self
            && let Some(place) = place_of(job)
        {
            signals[place] = (job, release_ns);
        }
    }
}

/// Returns the place of a signal.
fn place_of(job: u64) -> Option<usize> {
    usize::try_from(job % u64::from(SIGNALS)).ok()
}

impl OfTape {
    pub(super) fn new(
        events: OutboxReader,
        records: Vec<OutboxReader>,
        header: Header,
        lost: Lost,
        task_set: &TaskSet,
    ) -> Self {
        Self {
            events,
            records,
            lost,
            header,
            releases: Releases::of_all(task_set),
            epoch_ns: 0,
        }
    }

    /// Finds what is earliest of all that waits: a channel, or `None` for an event, and its time.
    fn earliest(&mut self) -> Option<(u64, Option<u16>)> {
        let event = self.events.next().map(|event| (event.at_ns, None));
        let epoch_ns = self.epoch_ns;
        let values = (0..)
            .zip(&mut self.records)
            .filter_map(|(channel, records)| {
                let at_ns = records.next()?.at_ns.saturating_sub(epoch_ns);
                Some((at_ns, Some(channel)))
            });
        // At one time an event is first, such as the signal that released a job.
        event
            .into_iter()
            .chain(values)
            .min_by_key(|(at_ns, _)| *at_ns)
    }

    fn release_ns(&self, dag: u16, job: u64) -> Option<u64> {
        self.releases.get(usize::from(dag))?.of(job)
    }

    /// Tells of the values of a channel that are lost, before the next one, or at the end.
    fn tell_lost(&mut self, channel: u16, next: Option<(u64, u64)>, to: &mut Record) {
        let before = next.map(|(job, _)| job);
        while let Some((first, last)) = self.lost.values[usize::from(channel)].take(before) {
            for job in first..=last {
                let dag = self.header.channels[usize::from(channel)].dag;
                let release_ns = self.release_ns(dag, job).unwrap_or(0);
                let lost = Entry {
                    what: What::Lost,
                    dag,
                    place: channel,
                    job,
                    release_ns,
                    // What is told at the end only has no time of its own.
                    at_ns: next.map_or(release_ns, |(_, at_ns)| at_ns),
                    value: &[],
                };
                to.write(&lost);
            }
        }
    }

    /// Writes the next value of a channel.
    fn write_value(&mut self, channel: u16, at_ns: u64, to: &mut Record) {
        let number = usize::from(channel);
        let Some(job) = self.records[number].next().map(|record| record.job) else {
            return;
        };
        self.tell_lost(channel, Some((job, at_ns)), to);
        let dag = self.header.channels[number].dag;
        let release_ns = self.release_ns(dag, job).unwrap_or(at_ns);
        let records = &mut self.records[number];
        if let Some(record) = records.next() {
            let value = Entry {
                what: What::Value,
                dag,
                place: channel,
                job,
                release_ns,
                at_ns,
                value: record.bytes,
            };
            to.write(&value);
        }
        records.forget();
    }

    /// Writes the next event.
    fn write_event(&mut self, to: &mut Record) {
        let Some(Published { job, at_ns, bytes }) = self.events.next() else {
            return;
        };
        let event = Event::from_bytes(bytes).unwrap_or_default();
        self.events.forget();
        let (what, dag, place, release_ns) = event;
        let what = EVENTS[usize::from(what) % EVENTS.len()];
        let known = release_ns.or_else(|| self.release_ns(dag, job));
        let release_ns = known.unwrap_or(at_ns);
        if what == What::Signal
            && let Some(releases) = self.releases.get_mut(usize::from(dag))
        {
            releases.note(job, release_ns);
        }
        let mut told = [0; TOLD];
        let entry = Entry {
            what,
            dag,
            place,
            job,
            release_ns,
            at_ns,
            value: match what {
                What::Clock => write_told(at_ns + self.epoch_ns, &mut told),
                _ => &[],
            },
        };
        to.write(&entry);
    }

    /// Reports whether the recording has ended before that time, for something had no room.
    fn has_ended(&self, at_ns: u64) -> bool {
        self.lost.rest_ns.load(Ordering::Acquire) < at_ns
    }
}

impl Drain for OfTape {
    fn begin(&mut self, to: &mut Record) {
        to.header(&self.header);
    }

    fn begin_run(&mut self, epoch_ns: u64) {
        self.epoch_ns = epoch_ns;
    }

    fn step(&mut self, to: Option<&mut Record>) -> bool {
        let Some(to) = to else {
            return false;
        };
        match self.earliest() {
            Some((at_ns, _)) if self.has_ended(at_ns) => return false,
            Some((at_ns, Some(channel))) => self.write_value(channel, at_ns, to),
            Some((_, None)) => self.write_event(to),
            None => return false,
        }
        true
    }

    fn end(&mut self, to: &mut Record) -> Option<Drained> {
        let is_cut = self.has_ended(u64::MAX);
        if !is_cut {
            (0..)
                .take(self.records.len())
                .for_each(|channel| self.tell_lost(channel, None, to));
        }
        Some(Drained {
            entries: to.entries(),
            lost: to.lost(),
            is_cut,
        })
    }
}
