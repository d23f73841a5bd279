//! The journal: the events of a run, each recorded once.
//!
//! A driver writes an [`Event`] at each moment: the kernel with its cores' clocks, virtual time
//! with the scheduler's time, Linux with its clock or, for a start, with the scheduler's time. All
//! later statements about a run are computed from these events: the times of jobs and instances,
//! breaches of the rules and statistics by [`law`](crate::law), the lines of a trace, the drawings
//! of a viewer.
//!
//! [`EventKind`] is the only list of event words. This module prints and reads them, and packs an
//! event into three [words](Event::words) of 64 bits and unpacks it.
//!
//! # Order
//!
//! Events are in the order in which the scheduler of their cluster learnt of them: among the events
//! of one instance, of one job and of one core, each event comes after all its causes. Their times
//! need not ascend: on a machine a function returns before the scheduler hears of it, and another
//! core may come between.

use core::fmt;
use core::str::FromStr;

use crate::ids::{CoreId, DagId, Instance, SubtaskId};

/// An event of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// The time, in nanoseconds from the run's epoch.
    pub time_ns: u64,
    /// The kind of event.
    pub what: EventKind,
    /// The core of the event, or the core that made the scheduler's step; for a
    /// [`Request`](EventKind::Request) the core that shall switch.
    pub core: CoreId,
    /// The DAG; 0 for an event of the whole run.
    pub dag: DagId,
    /// The job; 0 for an event of a whole DAG, the number of the mode for
    /// [`Entered`](EventKind::Entered).
    pub job: u64,
    /// The subtask; `None` for an event of a whole job, of a DAG or of the run.
    pub subtask: Option<SubtaskId>,
}

/// The subject of an event, packed: an instance or a whole job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EventSubject {
    /// The DAG in bits 44 to 63, the subtask in bits 24 to 43. At most 2^20 instances may be in
    /// flight, so the numbers of DAGs and subtasks fit.
    pub ids: u64,
    /// The job.
    pub job: u64,
}

const DAG: u32 = 44;
const SUBTASK: u32 = 24;
const CORE: u32 = 8;
const ID: u64 = (1 << 20) - 1;

impl EventSubject {
    /// Packs an instance.
    #[inline]
    pub const fn of(instance: Instance) -> Self {
        let Instance { dag, job, subtask } = instance;
        Self {
            ids: (dag.0 as u64) << DAG | (subtask.0 as u64) << SUBTASK,
            job,
        }
    }

    /// Packs a whole job.
    pub const fn of_job(dag: DagId, job: u64) -> Self {
        Self {
            ids: (dag.0 as u64) << DAG,
            job,
        }
    }

    /// Unpacks an instance.
    #[allow(clippy::cast_possible_truncation, reason = "20 bits are left")]
    pub const fn instance(self) -> Instance {
        let subtask = SubtaskId((self.ids >> SUBTASK & ID) as u32);
        Instance::new(DagId((self.ids >> DAG) as u32), self.job, subtask)
    }
}

impl Event {
    /// Returns the words of an event: time, job, and the rest.
    #[inline]
    pub const fn words(
        time_ns: u64,
        what: EventKind,
        core: CoreId,
        subject: EventSubject,
    ) -> [u64; 3] {
        let rest = subject.ids | (core.0 as u64) << CORE | what as u64;
        [time_ns, subject.job, rest]
    }

    /// Returns the words of an event with its core counted from core `first`, modulo 2^16.
    #[allow(clippy::cast_possible_truncation, reason = "a part of a word is meant")]
    pub(crate) const fn on_core_from([time_ns, job, rest]: [u64; 3], first: u32) -> [u64; 3] {
        let core = ((rest >> CORE) as u16).wrapping_add(first as u16);
        let others = rest & !((u16::MAX as u64) << CORE);
        [time_ns, job, others | (core as u64) << CORE]
    }

    /// Unpacks an event. Returns `None` if the words are not an event.
    #[allow(clippy::cast_possible_truncation, reason = "parts of a word are meant")]
    pub fn unpack([time_ns, job, rest]: [u64; 3]) -> Option<Self> {
        let what = EventKind::from_number(rest as u8)?;
        let Instance { dag, job, subtask } = EventSubject { ids: rest, job }.instance();
        Some(Self {
            time_ns,
            what,
            core: CoreId(u32::from((rest >> CORE) as u16)),
            dag,
            job,
            subtask: (!what.is_of_job()).then_some(subtask),
        })
    }

    /// Returns the instance of the event, if it has one.
    pub fn instance(&self) -> Option<Instance> {
        let Self { dag, job, .. } = *self;
        self.subtask.map(|subtask| Instance { dag, job, subtask })
    }
}

/// The kind of object an event happens to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum EventTarget {
    /// A job as a whole.
    Job,
    /// A DAG, or the run.
    Dag,
    /// An instance, in the scheduler's books only.
    Instance,
    /// An instance, on a core.
    Core,
}

/// Makes the vocabulary from its table: adding an event means adding a row.
macro_rules! events {
    ($($(#[$doc:meta])+ $name:ident = $word:literal, $object:ident;)+) => {
        /// The kind of an event. Printed, and read, as its name in lower case.
        ///
        /// ```
        /// use sched_dag::journal::EventKind;
        ///
        /// assert_eq!(EventKind::Suspend.to_string(), "suspend");
        /// assert_eq!("suspend".parse(), Ok(EventKind::Suspend));
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum EventKind {
            $($(#[$doc])+ $name,)+
        }

        /// All kinds, by number: each kind's word and object.
        const EVENTS: &[(EventKind, &str, EventTarget)] = &[$((EventKind::$name, $word, EventTarget::$object),)+];
    };
}

events! {
    /// A job is released.
    Released = "released", Job;
    /// A job's release waits for an older job to end.
    Queued = "queued", Job;
    /// A job's release does not happen.
    Skipped = "skipped", Job;
    /// A job starts no further instance.
    Aborted = "aborted", Job;
    /// The first of a job's deadlines to be missed has passed: a sink has not finished.
    Missed = "missed", Job;
    /// No instance of a job is left.
    Completed = "completed", Job;
    /// An instance waits for nothing any more but a core.
    Ready = "ready", Instance;
    /// An instance will not run, or not run on after a wait: its job is cut.
    Cancelled = "cancelled", Instance;
    /// A core shall run the instance instead of its present instance.
    Request = "request", Instance;
    /// The instance's function is called.
    Start = "start", Core;
    /// The instance loses its core.
    Suspend = "suspend", Core;
    /// The instance continues.
    Resume = "resume", Core;
    /// The instance's function has returned.
    Finish = "finish", Core;
    /// The instance was ended by a fault.
    Ended = "ended", Core;
    /// A signal came: a sporadic DAG's job is due now, or as soon as its distance allows.
    Signalled = "signalled", Job;
    /// A signal came while another was kept for the job, or the DAG was closed, ended or at its
    /// limit of jobs.
    Dropped = "dropped", Job;
    /// A sporadic DAG's job that is being released was due: the event's time is the nominal
    /// release, which no grid tells.
    Due = "due", Job;
    /// A DAG starts no further instance, because of a fault or an end request. The event's job is 0
    /// and means nothing.
    DagEnded = "dag_ended", Dag;
    /// A fault has ended the instance and cut its job, and its subtask goes on with another
    /// function.
    Restarted = "restarted", Instance;
    /// A DAG is paused: it releases no job until it is resumed. As with the next two kinds, the
    /// event's job is 0 and means nothing.
    Off = "off", Dag;
    /// A DAG is resumed: jobs due from now on are released.
    On = "on", Dag;
    /// A DAG is closed: it releases no further job.
    Closed = "closed", Dag;
    /// The run enters a mode, whose number is in the place of the job. The event's DAG is 0 and
    /// means nothing.
    Entered = "entered", Dag;
    /// The instance gives its core up and begins a wait.
    Wait = "wait", Core;
    /// The wait of an instance ends, by an answer or by its limit.
    Wake = "wake", Instance;
}

/// A text that is not an event word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownWord;

impl EventKind {
    /// Returns the kind with a number; the inverse of `as u8`.
    pub fn from_number(number: u8) -> Option<Self> {
        EVENTS.get(usize::from(number)).map(|(what, ..)| *what)
    }

    /// Returns the word.
    pub const fn word(self) -> &'static str {
        EVENTS[self as usize].1
    }

    /// Reports whether the event happens to a DAG as a whole, or to the run, and to no job.
    pub const fn is_of_dag(self) -> bool {
        matches!(EVENTS[self as usize].2, EventTarget::Dag)
    }

    /// Reports whether the event happens to a job or a DAG, not to an instance.
    pub const fn is_of_job(self) -> bool {
        matches!(EVENTS[self as usize].2, EventTarget::Job | EventTarget::Dag)
    }

    /// Reports whether the event happens on a core, not only in the scheduler's books.
    pub const fn is_of_machine(self) -> bool {
        matches!(EVENTS[self as usize].2, EventTarget::Core)
    }
}

impl fmt::Display for EventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for EventKind {
    type Err = UnknownWord;

    fn from_str(text: &str) -> Result<Self, UnknownWord> {
        let known = EVENTS.iter().find(|(_, word, _)| *word == text);
        known.map(|(what, ..)| *what).ok_or(UnknownWord)
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn the_largest_ids_do_not_get_in_each_others_way() {
        for what in (0..).map_while(EventKind::from_number) {
            let event = Event {
                time_ns: u64::MAX,
                what,
                core: CoreId(0xffff),
                dag: DagId(0xf_ffff),
                job: u64::MAX,
                subtask: (!what.is_of_job()).then_some(SubtaskId(0xf_fffe)),
            };
            let of_job = EventSubject::of_job(event.dag, event.job);
            let subject = event.instance().map_or(of_job, EventSubject::of);
            let words = Event::words(event.time_ns, what, event.core, subject);
            assert_eq!(Event::unpack(words), Some(event));
        }
        assert_eq!(Event::unpack([0, 0, 0xff]), None);
    }

    #[test]
    fn every_word_is_read_back_and_stands_at_its_number() {
        for (number, &(what, ..)) in (0..).zip(EVENTS) {
            assert_eq!(what as u8, number);
            assert_eq!(EventKind::from_number(number), Some(what));
            assert_eq!(what.to_string().parse(), Ok(what));
        }
        assert_eq!(EventKind::from_number(25), None);
        assert_eq!("Start".parse::<EventKind>(), Err(UnknownWord));
    }
}
