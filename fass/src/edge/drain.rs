//! The file that is made of what a tape has written.

use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

use recording::{Entry, Header, Stream, What};
use sched_dag::{DagId, TaskSet};

use super::ring::RingReader;
use super::{Drain, Drained};

/// What a record is, in 40 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tag {
    /// The value of a job.
    Value { channel: u16 },
    /// Lost values: the record has the first job, and its bytes the last one.
    Lost { channel: u16 },
    /// What else happened; the bytes have the job's release, where it is known.
    Event {
        what: What,
        dag: DagId,
        subtask: u32,
    },
}

const EVENTS: [What; 4] = [What::Signal, What::Skip, What::Cut, What::Restart];

impl Tag {
    #[inline(always)]
    pub(super) fn to_word(self) -> u64 {
        match self {
            Self::Value { channel } => u64::from(channel) << 8,
            Self::Lost { channel } => 1 | u64::from(channel) << 8,
            Self::Event { what, dag, subtask } => {
                let place = EVENTS.iter().position(|other| *other == what);
                let narrow = |number: u32| u64::from(u16::try_from(number).unwrap_or(u16::MAX));
                let number = 2 + place.unwrap_or(0) as u64;
                number | narrow(subtask) << 8 | narrow(dag.0) << 24
            }
        }
    }

    fn of_word(word: u64) -> Self {
        let [kind, low, high, dag @ ..] = word.to_le_bytes();
        let channel = u16::from_le_bytes([low, high]);
        match kind {
            0 => Self::Value { channel },
            1 => Self::Lost { channel },
            _ => Self::Event {
                what: EVENTS[usize::from(kind - 2) % EVENTS.len()],
                dag: DagId(u16::from_le_bytes([dag[0], dag[1]]).into()),
                subtask: channel.into(),
            },
        }
    }
}

/// Makes the file.
pub(super) struct OfTape {
    ring: RingReader,
    header: Header,
    stream: Option<Stream>,
    releases: Vec<Releases>,
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
    pub(super) fn new(ring: RingReader, header: Header, task_set: &TaskSet) -> Self {
        Self {
            ring,
            header,
            stream: None,
            releases: Releases::of_all(task_set),
        }
    }
}

impl Drain for OfTape {
    fn begin(&mut self, send: &mut dyn FnMut(&[u8])) {
        self.stream = Some(Stream::begin(&self.header, send));
    }

    fn step(&mut self, send: &mut dyn FnMut(&[u8])) -> bool {
        let Self {
            ring,
            header,
            stream: Some(stream),
            releases,
        } = self
        else {
            return false;
        };
        ring.take(|head, words, length| {
            let first = || words.first().map(|word| word.load(Ordering::Relaxed));
            let mut entry = Entry {
                what: What::Value,
                dag: 0,
                place: 0,
                job: head.job,
                release_ns: 0,
                at_ns: head.at_ns,
                value: &[],
            };
            let tag = Tag::of_word(head.tag);
            if let Tag::Value { channel } | Tag::Lost { channel } = tag {
                entry.place = channel;
                entry.dag = header.channels[usize::from(channel)].dag;
            }
            let of_dag = |dag: u16| releases.get(usize::from(dag));
            let release_ns = |dag, job| of_dag(dag).and_then(|releases| releases.of(job));
            match tag {
                Tag::Value { .. } => {
                    entry.release_ns = release_ns(entry.dag, entry.job).unwrap_or(entry.at_ns);
                    let value = |part: &mut dyn FnMut(&[u8])| parts(words, length, part);
                    stream.write_parts(&entry, length, value, send);
                }
                Tag::Lost { .. } => {
                    entry.what = What::Lost;
                    for job in head.job..=first().unwrap_or(head.job) {
                        let release_ns = release_ns(entry.dag, job).unwrap_or(0);
                        // What is told at the end only has no time of its own.
                        let at_ns = match head.at_ns {
                            u64::MAX => release_ns,
                            at_ns => at_ns,
                        };
                        stream.write(
                            &Entry {
                                job,
                                release_ns,
                                at_ns,
                                ..entry
                            },
                            send,
                        );
                    }
                }
                Tag::Event { what, dag, subtask } => {
                    entry.what = what;
                    entry.dag = u16::try_from(dag.0).unwrap_or(u16::MAX);
                    entry.place = u16::try_from(subtask).unwrap_or(u16::MAX);
                    let known = first().or_else(|| release_ns(entry.dag, entry.job));
                    entry.release_ns = known.unwrap_or(entry.at_ns);
                    if what == What::Signal
                        && let Some(releases) = releases.get_mut(dag.index())
                    {
                        releases.note(entry.job, entry.release_ns);
                    }
                    stream.write(&entry, send);
                }
            }
        })
    }

    fn end(&mut self, send: &mut dyn FnMut(&[u8])) -> Drained {
        let is_cut = self.ring.is_closed();
        let Some(stream) = self.stream.take() else {
            return Drained {
                entries: 0,
                lost: 0,
                is_cut,
            };
        };
        let (entries, lost) = (stream.entries(), stream.lost());
        match is_cut {
            true => stream.cut(send),
            false => stream.end(send),
        }
        Drained {
            entries,
            lost,
            is_cut,
        }
    }
}

/// Gives the bytes that words hold.
fn parts(words: &[AtomicU64], length: usize, part: &mut dyn FnMut(&[u8])) {
    let mut left = length;
    for word in words {
        let bytes = word.load(Ordering::Relaxed).to_le_bytes();
        part(&bytes[..left.min(bytes.len())]);
        left = left.saturating_sub(bytes.len());
    }
}
