//! The scheduler's own record of each instant: the journal, and notices for its driver.
//!
//! The journal may have no room, or drop old events for newer ones. So information a driver has to
//! act on, such as the inputs of a cancelled instance, does not depend on the journal. A *notice*
//! is an event of one of the few kinds that the driver asked for, kept until the driver looks.

use alloc::vec::Vec;

use crate::ids::{CoreId, DagId, Instance};
use crate::journal::{Event, EventKind, EventSubject};
use crate::kept::Journal;

/// An event for the driver to act on, with a time that does not fit into the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverNotice {
    /// The event.
    pub event: Event,
    /// The nominal release of the job, or its deadline, in nanoseconds; `None` for an event with
    /// neither.
    pub at_ns: Option<u64>,
}

/// The journal, with the data common to its next events.
#[derive(Clone, Debug, Default)]
pub struct EventLog {
    /// The instant.
    pub(super) now_ns: u64,
    /// The core making the scheduler's step.
    pub here: CoreId,
    /// Whether anything has happened to a job as a whole, or a wait has begun.
    pub(super) has_job_event: bool,
    /// Ended jobs of DAGs with a limit.
    pub jobs_ended: u64,
    /// By bits of [`EventKind`], the events kept as notices.
    heard: u32,
    /// The most notices from a single change; there is room for twice as many.
    most_at_once: usize,
    notices: Vec<DriverNotice>,
    /// The events so far.
    pub journal: Journal,
}

impl EventLog {
    /// Keeps events of these kinds as notices from now on. One change of the scheduler causes at
    /// most `most_at_once` of them. Returns the number of notices there is room for.
    pub(super) fn hear(
        &mut self,
        kinds: impl IntoIterator<Item = EventKind>,
        most_at_once: usize,
    ) -> usize {
        self.heard = kinds.into_iter().fold(0, |heard, what| heard | bit(what));
        self.most_at_once = most_at_once;
        // Twice: a change may begin while there is just room for one more.
        self.notices.reserve_exact(2 * most_at_once);
        2 * most_at_once
    }

    /// Reports whether there is room for the notices of one more change.
    #[inline]
    pub(super) const fn has_room(&self) -> bool {
        self.notices.len() <= self.most_at_once
    }

    /// Returns the latest instant.
    #[inline]
    pub const fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Reports whether there are notices.
    #[inline]
    pub const fn has_notices(&self) -> bool {
        !self.notices.is_empty()
    }

    /// Takes the notices out, in exchange for a list whose room is used next.
    #[inline]
    pub fn exchange_notices(&mut self, room: &mut Vec<DriverNotice>) {
        // Exchanged, not copied: both lists keep their memory, so neither ever allocates.
        room.clear();
        core::mem::swap(&mut self.notices, room);
    }

    /// Reports whether, since the last call, anything has happened to a job as a whole, or a wait
    /// has begun.
    #[inline]
    pub const fn take_job_event(&mut self) -> bool {
        core::mem::replace(&mut self.has_job_event, false)
    }

    /// Records what a core does with an instance.
    #[inline]
    pub fn on_core(&mut self, core: CoreId, what: EventKind, time_ns: u64, instance: Instance) {
        (self.journal).write(core, what, time_ns, EventSubject::of(instance));
    }

    /// Records what the core making this step has done with an instance.
    #[inline]
    pub(super) fn on_this(&mut self, what: EventKind, time_ns: u64, instance: Instance) {
        self.on_core(self.here, what, time_ns, instance);
    }

    /// Records an event of an instance, at this instant.
    #[inline]
    pub(super) fn of_instance(&mut self, what: EventKind, instance: Instance) {
        self.write(what, self.now_ns, EventSubject::of(instance));
        self.notify(what, EventSubject::of(instance), None);
    }

    /// Records an event of a job as a whole, or of a DAG, with the time the event was due or late.
    #[inline]
    pub(super) fn of_job(&mut self, what: EventKind, dag: DagId, job: u64, at_ns: Option<u64>) {
        self.has_job_event = true;
        self.write(what, self.now_ns, EventSubject::of_job(dag, job));
        self.notify(what, EventSubject::of_job(dag, job), at_ns);
    }

    /// Records an event of a DAG.
    #[inline]
    pub(super) fn of_dag(&mut self, what: EventKind, dag: DagId) {
        self.of_job(what, dag, 0, None);
    }

    /// Records that a sporadic DAG's job was due at `release_ns`, right before its release.
    #[inline]
    pub(super) fn due(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.write(EventKind::Due, release_ns, EventSubject::of_job(dag, job));
        self.notify(
            EventKind::Due,
            EventSubject::of_job(dag, job),
            Some(release_ns),
        );
    }

    #[inline]
    fn write(&mut self, what: EventKind, time_ns: u64, subject: EventSubject) {
        self.journal.write(self.here, what, time_ns, subject);
    }

    #[inline]
    fn notify(&mut self, what: EventKind, subject: EventSubject, at_ns: Option<u64>) {
        if self.heard & bit(what) != 0 {
            self.keep(what, subject, at_ns);
        }
    }

    #[cold]
    #[inline(never)]
    fn keep(&mut self, what: EventKind, subject: EventSubject, at_ns: Option<u64>) {
        // Packed and unpacked, so that a notice equals the event in the journal.
        let words = Event::words(self.now_ns, what, self.here, subject);
        let event = Event::unpack(words);
        (self.notices).extend(event.map(|event| DriverNotice { event, at_ns }));
    }
}

#[inline]
const fn bit(what: EventKind) -> u32 {
    1 << what as u32
}
