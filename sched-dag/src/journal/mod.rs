//! The journal: what happened in a run, each moment written down once.
//!
//! A driver writes an [`Event`] at each moment: the kernel with its cores' clocks,
//! virtual time and host threads with the scheduler's. All that is said of a run
//! later is computed from these events: the times of jobs and instances, breaches of
//! the rules and statistics by [`law`](crate::law), the lines of a trace, what a
//! viewer draws.
//!
//! [`What`] is the only list of words. Here they are printed and read, and here an
//! event is packed into three [words](Event::words) of 64 bits and unpacked.
//!
//! # Order
//!
//! Events stand in the order in which the scheduler learnt of them: of the events of
//! one instance, one job and one core each comes after all that it follows from. Their
//! times need not ascend: on a machine a function returns before the scheduler hears
//! of it, and another core may come between.

mod what;

pub use what::{UnknownWord, What};

use crate::ids::{CoreId, DagId, Instance, SubtaskId};

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// When, in nanoseconds from the run's epoch.
    pub time_ns: u64,
    /// What.
    pub what: What,
    /// The core that it happened on, or that made the scheduler's step; of a
    /// [`Request`](What::Request) the core that shall switch.
    pub core: CoreId,
    /// The DAG.
    pub dag: DagId,
    /// The job.
    pub job: u64,
    /// The subtask; `None` if it happened to a whole job.
    pub subtask: Option<SubtaskId>,
}

/// The subject of an event, packed: an instance or a whole job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subject {
    /// The DAG in bits 44 to 63, the subtask in bits 24 to 43: at most 2^20 instances
    /// may be in flight, so at most so many DAGs and subtasks there are.
    pub ids: u64,
    /// The job.
    pub job: u64,
}

const DAG: u32 = 44;
const SUBTASK: u32 = 24;
const CORE: u32 = 8;
const ID: u64 = (1 << 20) - 1;

impl Subject {
    /// Packs an instance.
    #[inline]
    #[must_use]
    pub const fn of(instance: Instance) -> Self {
        let Instance { dag, job, subtask } = instance;
        Self {
            ids: (dag.0 as u64) << DAG | (subtask.0 as u64) << SUBTASK,
            job,
        }
    }

    /// Packs a whole job.
    #[must_use]
    pub const fn of_job(dag: DagId, job: u64) -> Self {
        Self {
            ids: (dag.0 as u64) << DAG,
            job,
        }
    }

    /// Unpacks an instance.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "20 bits are left")]
    pub const fn instance(self) -> Instance {
        Instance {
            dag: DagId((self.ids >> DAG) as u32),
            job: self.job,
            subtask: SubtaskId((self.ids >> SUBTASK & ID) as u32),
        }
    }
}

impl Event {
    /// Returns the words of something that happened: time, job, and the rest.
    #[inline]
    #[must_use]
    pub const fn words(time_ns: u64, what: What, core: CoreId, subject: Subject) -> [u64; 3] {
        let rest = subject.ids | (core.0 as u64) << CORE | what as u64;
        [time_ns, subject.job, rest]
    }

    /// Returns the words of an event whose core counts from another one, modulo 2^16.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a part of a word is meant")]
    pub(crate) const fn on_core_from([time_ns, job, rest]: [u64; 3], first: u32) -> [u64; 3] {
        let core = ((rest >> CORE) as u16).wrapping_add(first as u16);
        let others = rest & !((u16::MAX as u64) << CORE);
        [time_ns, job, others | (core as u64) << CORE]
    }

    /// Unpacks an event, `None` if the words are of none.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "parts of a word are meant")]
    pub fn unpack([time_ns, job, rest]: [u64; 3]) -> Option<Self> {
        let what = What::from_number(rest as u8)?;
        let Instance { dag, job, subtask } = Subject { ids: rest, job }.instance();
        Some(Self {
            time_ns,
            what,
            core: CoreId(u32::from((rest >> CORE) as u16)),
            dag,
            job,
            subtask: (!what.is_of_job()).then_some(subtask),
        })
    }

    /// Returns the instance, if it happened to one.
    #[must_use]
    pub fn instance(&self) -> Option<Instance> {
        let Self { dag, job, .. } = *self;
        self.subtask.map(|subtask| Instance { dag, job, subtask })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_ids_do_not_get_in_each_others_way() {
        for what in (0..).map_while(What::from_number) {
            let event = Event {
                time_ns: u64::MAX,
                what,
                core: CoreId(0xffff),
                dag: DagId(0xf_ffff),
                job: u64::MAX,
                subtask: (!what.is_of_job()).then_some(SubtaskId(0xf_fffe)),
            };
            let of_job = Subject::of_job(event.dag, event.job);
            let subject = event.instance().map_or(of_job, Subject::of);
            let words = Event::words(event.time_ns, what, event.core, subject);
            assert_eq!(Event::unpack(words), Some(event));
        }
        assert_eq!(Event::unpack([0, 0, 0xff]), None);
    }
}
