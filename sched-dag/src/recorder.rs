//! Writes the journal of a driver that reads its clock once a step.

use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::ids::{CoreId, DagId, Instance, ModeId};
use crate::journal::{Event, Subject, What};
use crate::kept::Journal;
use crate::policy::JobOutcome;
use crate::scheduler::Observer;
use crate::task_set::TaskSet;

/// What events are written into.
pub trait Events {
    /// Writes down that something has happened.
    fn write(&mut self, core: CoreId, what: What, time_ns: u64, subject: Subject);
}

/// With room for all, as much as there is memory.
impl Events for Vec<Event> {
    fn write(&mut self, core: CoreId, what: What, time_ns: u64, subject: Subject) {
        self.extend(Event::unpack(Event::words(time_ns, what, core, subject)));
    }
}

/// In the memory that was taken before.
impl Events for Journal {
    #[inline]
    fn write(&mut self, core: CoreId, what: What, time_ns: u64, subject: Subject) {
        Self::write(self, core, what, time_ns, subject);
    }
}

/// Writes down what the scheduler reports, and what the driver says that cores do, at
/// the time that the driver has set last.
#[derive(Clone, Debug)]
pub struct Recorder<J = Vec<Event>> {
    task_set: Arc<TaskSet>,
    /// The present instant on the scheduler's clock.
    pub now_ns: u64,
    /// The core that takes the scheduler's step: the one on which an instance has ended
    /// last.
    here: CoreId,
    /// What has happened, in its order.
    pub events: J,
    is_closed: bool,
}

impl Recorder {
    /// Begins at time 0, with room for all events; until an instance has ended, core 0
    /// takes the steps.
    #[must_use]
    pub const fn new(task_set: Arc<TaskSet>) -> Self {
        Self::into(task_set, Vec::new())
    }
}

impl<J> Recorder<J> {
    /// Begins likewise, and writes into what there is.
    #[must_use]
    pub const fn into(task_set: Arc<TaskSet>, events: J) -> Self {
        Self {
            task_set,
            now_ns: 0,
            here: CoreId(0),
            events,
            is_closed: false,
        }
    }

    /// Writes nothing down any more.
    pub const fn close(&mut self) {
        self.is_closed = true;
    }
}

impl<J: Events> Recorder<J> {
    /// Writes down what a core does with an instance.
    pub fn on_core(&mut self, what: What, instance: Instance, core: CoreId) {
        if matches!(what, What::Finish | What::Ended) {
            self.here = core;
        }
        self.write(what, self.now_ns, core, Subject::of(instance));
    }

    fn of_job(&mut self, what: What, dag: DagId, job: u64) {
        let subject = Subject::of_job(dag, job);
        self.write(what, self.now_ns, self.here, subject);
    }

    fn write(&mut self, what: What, time_ns: u64, core: CoreId, subject: Subject) {
        if !self.is_closed {
            self.events.write(core, what, time_ns, subject);
        }
    }
}

impl<J: Events> Observer for Recorder<J> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        if self.task_set.dag(dag).is_sporadic() {
            let subject = Subject::of_job(dag, job);
            self.write(What::Due, release_ns, self.here, subject);
        }
        self.of_job(What::Released, dag, job);
    }

    fn queued(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Queued, dag, job);
    }

    fn skipped(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Skipped, dag, job);
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        let what = match release_ns {
            Some(_) => What::Signalled,
            None => What::Dropped,
        };
        self.of_job(what, dag, job);
    }

    fn ready(&mut self, instance: Instance) {
        self.on_core(What::Ready, instance, self.here);
    }

    fn cancelled(&mut self, instance: Instance) {
        self.on_core(What::Cancelled, instance, self.here);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.of_job(What::Aborted, dag, job);
    }

    fn restarted(&mut self, instance: Instance) {
        self.on_core(What::Restarted, instance, self.here);
    }

    fn ended(&mut self, dag: DagId) {
        self.of_job(What::Stopped, dag, 0);
    }

    fn switched_off(&mut self, dag: DagId) {
        self.of_job(What::Off, dag, 0);
    }

    fn switched_on(&mut self, dag: DagId) {
        self.of_job(What::On, dag, 0);
    }

    fn closed(&mut self, dag: DagId) {
        self.of_job(What::Closed, dag, 0);
    }

    fn entered(&mut self, mode: ModeId) {
        self.of_job(What::Entered, DagId(0), mode.0.into());
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Missed, dag, job);
    }

    fn job_completed(&mut self, dag: DagId, job: u64, _: JobOutcome) {
        self.of_job(What::Completed, dag, job);
    }
}
